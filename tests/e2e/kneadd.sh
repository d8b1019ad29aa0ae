# Sourced by scripts of several folders. All of them run inside tests/netns, in an empty working directory.
PATH=$KN_BUILD/tests/tools:$PATH
failed=0
# check SENTENCE COMMAND...: print one line as tests/check.h does, and return the result of COMMAND: check ... || cat
# OUTPUT
check() {
    local sentence=$1
    shift
    "$@" && echo "ok   $sentence" && return
    echo "FAIL $sentence: $*"
    failed=1
    return 1
}
skip() { echo "skipped: $1" && exit 77; }
python3() { /usr/bin/python3 "$@"; } # Debian's python3, independent of PATH
exec {never}<> <(:)
pause() { read -rt "$1" -u "$never" || return 0; } # seconds; avoids the fork of sleep
await() { # await COMMAND...: repeat until COMMAND succeeds, for a minute or for $patience seconds
    local tries
    for ((tries = 0; tries < 20 * ${patience:-60}; tries++)); do
        "$@" && return
        pause 0.05
    done
    return 1
}
has() { # has WORD FILE: return whether a line of FILE contains WORD, without a fork
    local line
    while read -r line; do [[ $line != *"$1"* ]] || return 0; done <"$2"
    return 1
}
# expect PATTERN CODE COMMAND...: expect exit code CODE and one line on stderr that matches PATTERN (extended),
# without a fork.
expect() {
    local pattern=$1 code=$2 got said told good=no
    "${@:3}" >out 2>err
    got=$?
    mapfile said <out
    mapfile told <err
    [ "$got ${#said[@]} ${#told[@]} ${told[0]: -1}" = "$code 0 1 "$'\n' ] && [[ ${told[0]%$'\n'} =~ $pattern ]] && good=yes
    check "${told[*]%$'\n'}" [ $good = yes ] && return
    echo "     ${*:3}: exit $got, expected $code and on stderr one line: $pattern"
    cat out
    return 1
}
ended() { # ended PID: expect that the process ends with 0
    wait "$1"
    local got=$?
    [ $got = 0 ] || { echo "     it ended with $got" && return 1; }
}
start_kneadd() { # start_kneadd SCENE OPTION...: SCENE is a file here, or one of core/scenes; return once kneadd serves
    local tries scene=$KN_SOURCE/core/scenes/$1
    [ ! -e "$1" ] || scene=$1
    rm -f kneadd.log kneadd.err # otherwise the files of the server before would be read
    kneadd "$scene" --realtime "$KN_REALTIME" "${@:2}" >kneadd.log 2>kneadd.err &
    server=$!
    for ((tries = 0; tries < 500; tries++)); do
        [ -e kneadd.log ] && has serving kneadd.log && return
        kill -0 "$server" 2>/dev/null || break
        pause 0.02
    done
    echo "FAIL kneadd did not come up:" && cat kneadd.log kneadd.err && exit 1
}
# A standstill of some ms spoils programs that play a hand or write a log. They run ahead of all but kneadd, where the
# machine allows it.
ahead=
[ "$KN_REALTIME" = off ] || ! chrt -f 51 true 2>/dev/null || ahead="chrt -f 50"
# lcm-logger receives in one thread and logs in another, with room for 30 messages between them. Messages are lost
# when the processor of the logging thread alone stands still for 100 ms. So both threads run on one processor,
# logging has the higher priority, and the socket has room for those 100 ms.
start_logger() { # start_logger FILE
    local cpus tasks=()
    cpus=$(taskset -cp $$)
    cpus=${cpus##* }
    taskset -c "${cpus%%[-,]*}" $ahead lcm-logger -q --lcm-url='udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304' -f "$1" >/dev/null 2>&1 &
    logger=$!
    until [ ${#tasks[@]} -ge 3 ] || ! kill -0 $logger; do # the main thread logs, one thread receives, one writes
        pause 0.02
        tasks=(/proc/$logger/task/*)
    done
    pause 0.1
    [ -z "$ahead" ] || chrt -f -p 51 $logger
}
stop_logger() {
    kill -INT "$logger"
    wait "$logger" 2>/dev/null
}
stop_kneadd() { # check that kneadd ends with 0; set status to its exit code; its summary is in kneadd.log
    kill -TERM "$server"
    wait "$server"
    status=$?
    grep kneadd: kneadd.log
    check "kneadd ran to its end and exited with 0" [ $status = 0 ] >&2
}
# The following four functions need a kneadd started with --control control.
ctl() { knead ctl --control control "$@"; }
# field '["mode"]': print a field of the status
field() { ctl --json status | python3 -c "import json, sys; print(json.load(sys.stdin)$1)"; }
touching() { # wait until the hand is in the dough, or has ended
    until ctl --json status 2>/dev/null | grep -q '"in_contact":true' || ! kill -0 $hand 2>/dev/null; do pause 0.1; done
}
pressing() { touching && pause 0.4; }

# A simulated device that obeys lines on its stdin and reports in its CSV.
start_device() { # start_device CSV COMMAND...
    rm -f says && mkfifo says
    "${@:2}" <says >"$1" & device=$!
    exec {says}>says
}
bid() { (trap '' PIPE && echo "$*" >&$says); } # send a line; a device that has ended does not end this script
stop_device() {
    kill $device
    wait $device 2>/dev/null
    exec {says}>&-
    cat hand.txt hand.err
}
# fades CSV COLUMN MS: after MS the force in that column falls from 90 to 10 % in three rows or more, then to 0, and
# stays 0
fades() {
    awk -F, -v c="$2" -v since="$3" 'NR > 1 && $1 >= since { f[++n] = $c; if ($c > held) held = $c }
        END { for (i = 1; i <= n && f[i] != 0; i++) steps += f[i] > 0.1 * held && f[i] < 0.9 * held
              zero = i <= n
              for (; i <= n; i++) back += f[i] != 0
              exit !(zero && steps >= 3 && !back) }' "$1"
}

memory() { awk '/^VmRSS/ { print $2 }' "/proc/$server/status"; } # memory of kneadd, kB
# verifies LOG [OPTION...]: check that the log replays to exactly the forces that it holds.
verifies() { knead replay "$@" --verify >"$1.said" 2>"$1.err" || { cat "$1.said" "$1.err"; return 1; }; }
told() { grep -c -- "$1" hand.err; } # print the number of lines of the hand that contain the text
holds() { awk "BEGIN { exit !($1) }"; } # compare numbers
# counter NAME: print the number before NAME in the summary, or 0 if it is missing.
counter() { [[ $(<kneadd.log) =~ ([0-9]+)\ "$1"($|[^a-z_]) ]] && echo "${BASH_REMATCH[1]}" || echo 0; }
# number NAME FILE: print the number after NAME in the output of logcheck.
number() { [[ $(<"$2") =~ (^|[^a-z_])"$1"\ (-?[0-9.]+) ]] && echo "${BASH_REMATCH[2]}"; }
