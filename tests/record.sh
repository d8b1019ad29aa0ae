# The record of the last night run (tests/nightly.txt), and the gate's judgement of that record. Sourced by tests/run.
#
#     commit 0123456...        the commit that was tested
#     covers 89abcde...        a hash of the folders in record_covers, as they are in that commit
#     date, processor
#     result green             or red: a test failed, was skipped or did not run
#     release core.law 0.4 1 passed      BUILD TEST SECONDS ATTEMPTS RESULT, one line for each test
record=tests/nightly.txt record_age_max=80 # maximum age, in commits
record_covers=(hdl server/backend tests/timed) # a change to these folders needs a new night run
record_hdl=("${record_covers[@]:0:2}" clients/simdev core/{fixed,solver_fixed}.{c,h}
    tests/hdl tests/e2e/{board,test_circuit,test_circuit_rtl}.sh)
record_threads=({server/,tests/server/test_}{ring,mailbox,keeper,team}.c server/{ring,mailbox,keeper,team}.h)

record_commit() { git rev-parse -q --verify "$1^{commit}" 2>/dev/null || echo unknown; }
record_value() { sed -n "s/^$1 //p" $record 2>/dev/null; }
record_hash() { git ls-tree "$1" "${record_covers[@]}" | git hash-object --stdin; }

# Return whether these files are unchanged since the recorded commit. If git cannot tell, they count as changed.
record_same() {
    local commit
    commit=$(record_value commit)
    [ -n "$commit" ] && git diff --quiet "$commit" -- "$@" 2>/dev/null
}

# Print the age of the record. Return 1 if the record is red, too old, or does not cover the folders of record_covers
# as they are now.
record_judge() {
    local since age
    [ -f $record ] || { echo "$record: there is none: run 'tests/run --all' and commit it" && return 1; }
    if [ "$(record_value result)" != green ]; then
        echo "$record: expected a green one: mend what failed, run 'tests/run --all' and commit it" && return 1
    fi
    [ "$(record_commit HEAD)" != unknown ] || { echo "$record: green; no git here, so its age is unknown" && return 0; }
    since=$(record_commit "$(record_value commit)")
    if [ "$since" = unknown ] && [ "$(git rev-parse --is-shallow-repository)" = false ]; then
        since=$(git rev-list -1 HEAD -- $record) # after a rebase the age counts from the commit of the record itself
    fi
    age=$(git rev-list --count "$since..HEAD" 2>/dev/null)
    if [ -z "$since" ] || [ -z "$age" ]; then
        echo "$record: its age is unknown: expected a commit of it, and a history that goes back to it (git fetch --unshallow)" && return 1
    fi
    echo "$record: green, of $(record_value date), $age commits old"
    if [ "$age" -gt $record_age_max ]; then
        echo "$record: expected at most $record_age_max commits: run 'tests/run --all' and commit it" && return 1
    elif [ "$(record_value covers)" != "$(record_hash HEAD)" ]; then
        echo "$record: ${record_covers[*]} changed since: run 'tests/run --all' and commit it" && return 1
    fi
}

# Return whether the working tree equals HEAD, since the record will name that commit.
record_clean() {
    local changes
    changes=$(git status --porcelain -- . ":!$record") || return 1
    [ -z "$changes" ] || { printf 'tests/run: --all: the record names a commit, expected no other changes:\n%s\n' "$changes" >&2 && return 1; }
}

# record_write COMMIT WANTED ROWS RESULT: write the record.
record_write() {
    {
        echo "commit $1"
        echo "covers $(record_hash "$1")"
        echo "date $(date +%F)"
        echo "processor $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | sort | uniq -c | sed 's/^ *\([0-9]*\) /\1 x /')"
        echo "result $4"
        awk 'NR == FNR { want[$1 " " $2]; next } { t = $1 " " $2; n[t]++; s[t] = $3; r[t] = $4 }
            END { for (t in want) print t, t in n ? s[t] " " n[t] " " r[t] : "0 0 missing" }' "$2" "$3" | sort
    } >$record
    echo "wrote $record: $4; commit it"
}
