# The record of the last night, tests/nightly.txt, and what the gate makes of it. Sourced by tests/run.
#
#     commit 0123456...        the night tested this commit
#     covers 89abcde...        a hash of the folders in record_covers, as that commit has them
#     date, processor
#     result green             or red: a test failed, was skipped or did not run
#     release core.law 0.4 1 passed      BUILD TEST SECONDS ATTEMPTS RESULT, one line a test
record=tests/nightly.txt record_age_max=80 # commits
record_covers=(hdl server/backend tests/timed) # a change to these needs a night of its own
record_hdl=("${record_covers[@]:0:2}" clients/simdev core/{fixed,solver_fixed}.{c,h}
    tests/hdl tests/e2e/{board,test_circuit,test_circuit_rtl}.sh)
record_threads=({server/,tests/server/test_}{ring,mailbox,keeper}.c server/{ring,mailbox,keeper}.h)

record_commit() { git rev-parse -q --verify "$1^{commit}" 2>/dev/null || echo unknown; }
record_value() { sed -n "s/^$1 //p" $record 2>/dev/null; }
record_hash() { git ls-tree "$1" "${record_covers[@]}" | git hash-object --stdin; }

# Return whether these files are as they were that night. Where git cannot tell, they are not.
record_same() {
    local commit
    commit=$(record_value commit)
    [ -n "$commit" ] && git diff --quiet "$commit" -- "$@" 2>/dev/null
}

# Print the age of the record. Return 1 where it is red, too old, or does not cover what it must.
record_judge() {
    local since age
    [ -f $record ] || { echo "$record: there is none: run 'tests/run --all' and commit it" && return 1; }
    if [ "$(record_value result)" != green ]; then
        echo "$record: expected a green one: mend what failed, run 'tests/run --all' and commit it" && return 1
    fi
    [ "$(record_commit HEAD)" != unknown ] || { echo "$record: green; no git here, so its age is unknown" && return 0; }
    since=$(record_commit "$(record_value commit)")
    if [ "$since" = unknown ] && [ "$(git rev-parse --is-shallow-repository)" = false ]; then
        since=$(git rev-list -1 HEAD -- $record) # rebased: the age counts from the record's own commit
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

# Return whether the tree is HEAD, which the record will name.
record_clean() {
    local changes
    changes=$(git status --porcelain -- . ":!$record") || return 1
    [ -z "$changes" ] || { printf 'tests/run: --all: the record names a commit, expected no other changes:\n%s\n' "$changes" >&2 && return 1; }
}

# record_write COMMIT WANTED ROWS RESULT
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
