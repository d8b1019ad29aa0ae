# Sourced by the end-to-end tests that talk to a kneadd of their own (inside tests/netns, in an empty working
# directory).
PATH=$KN_BUILD/tests/tools:$PATH
failed=0
check() { # check SENTENCE COMMAND...: one line, like tests/check.h; fails as the command does: check ... || cat what it judged
    local sentence=$1
    shift
    "$@" && echo "ok   $sentence" && return
    echo "FAIL $sentence: $*"
    failed=1
    return 1
}
exec {never}<> <(:)
pause() { read -rt "$1" -u "$never" || return 0; } # seconds, without the fork that sleep is
has() { # has WORD FILE: a line with it; the same
    local line
    while read -r line; do [[ $line != *"$1"* ]] || return 0; done <"$2"
    return 1
}
start_kneadd() { # start_kneadd SCENE OPTION...: a file here, or one of core/scenes; returns once it serves
    local tries scene=$KN_SOURCE/core/scenes/$1
    [ ! -e "$1" ] || scene=$1
    rm -f kneadd.log kneadd.err # or the one before it would be heard
    kneadd --scene "$scene" --realtime "$KN_REALTIME" "${@:2}" >kneadd.log 2>kneadd.err &
    server=$!
    for ((tries = 0; tries < 500; tries++)); do
        [ -e kneadd.log ] && has serving kneadd.log && return
        kill -0 "$server" 2>/dev/null || break
        pause 0.02
    done
    echo "FAIL kneadd did not come up:" && cat kneadd.log kneadd.err && exit 1
}
# press OPTION...: by knead probe; after a pause once more where the machine has spoilt all of its tries
press() {
    local pause status
    for pause in 5 15 0; do
        knead probe --path press --quiet "$@" && return
        status=$?
        [ $status = 3 ] || break
        sleep $pause
    done
    echo "FAIL knead probe: exit $status" && exit 1
}
# record FILE SCENE [SERVED...] -- OPTION...: a press by a hand that waits for kneadd, so that nothing had touched the object and no time
# is lost; spoilt, or with gaps, once more on a fresh one
record() {
    local file=$1 scene=$2 served=() pause played
    shift 2
    while [ "$1" != -- ]; do served+=("$1") && shift; done
    for pause in 2 10 0; do
        knead probe --path press --tries 1 --quiet --record "$file" "${@:2}" 2>record.err &
        hand=$!
        sleep 0.3
        start_kneadd "$scene" "${served[@]}"
        wait $hand
        played=$?
        stop_kneadd >/dev/null
        [ $played = 0 ] && ! grep -q 'has gaps' record.err && return
        cat record.err
        [ $played = 0 ] || [ $played = 3 ] || break
        sleep $pause
    done
    echo "FAIL knead probe: exit $played" && exit 1
}
# lcm-logger that does not run for 0.1 s loses records: ahead of everything but kneadd
start_logger() { # start_logger FILE
    local ahead=
    [ "$KN_REALTIME" = off ] || ! chrt -f 50 true 2>/dev/null || ahead="chrt -f 50"
    $ahead lcm-logger -q -f "$1" >/dev/null 2>&1 &
    logger=$!
    sleep 0.3
}
stop_logger() {
    kill -INT "$logger"
    wait "$logger" 2>/dev/null
}
stop_kneadd() { # sets status to its exit code; its summary is in kneadd.log
    kill -TERM "$server"
    wait "$server"
    status=$?
    grep kneadd: kneadd.log
}
# counter NAME: the number before NAME in the summary, 0 when it is not told
counter() { grep -oE "[0-9]+ $1\b" kneadd.log | head -1 | grep -oE '^[0-9]+' || echo 0; }
# number NAME FILE: the number after NAME in what logcheck printed
number() { grep -oE "\b$1 -?[0-9.]+" "$2" | grep -oE '[0-9.-]+$'; }
