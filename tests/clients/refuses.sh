# Sourced by tests of programs that are called: counts failures, and checks that a refusal is one line.
failed=0
program=knead # refuses() calls it
python3() { /usr/bin/python3 "$@"; } # Debian's, whatever comes first in PATH
ok() { echo "ok   $1"; }
fail() { echo "FAIL $*"; failed=1; }

# refuses CODE EXPECTED-LINE ARGUMENT...: exactly that line on stderr, nothing on stdout
# begun=yes refuses ...: it has told something on stdout before
refuses() {
    local code=$1 expected=$2 status told
    shift 2
    $program "$@" >out 2>err
    status=$?
    mapfile told <err
    [ $status = "$code" ] && [ "$([ ! -s out ] || echo yes)" = "${begun:-}" ] && [ ${#told[@]} = 1 ] && [ "${told[0]}" = "$expected"$'\n' ] && return
    fail "$program $*: exit $status, expected $code and: $expected"
    cat out err
}

# begins CODE WORDS COMMAND...: one line on stderr that begins so, nothing on stdout
begins() {
    local code=$1 words=$2 status told
    "${@:3}" >out 2>err
    status=$?
    mapfile told <err
    [ $status = "$code" ] && [ ! -s out ] && [ ${#told[@]} = 1 ] && [[ ${told[0]} == "$words"*$'\n' ]] && return
    fail "${*:3}: exit $status, expected $code and: $words..."
    cat out err
}
