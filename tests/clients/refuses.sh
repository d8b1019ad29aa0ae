# Sourced by tests of knead: what has failed, and one line for whatever cannot be done.
failed=0 program=knead
python3() { /usr/bin/python3 "$@"; } # Debian's, whatever comes first in PATH
ok() { echo "ok   $1"; }
fail() { echo "FAIL $1"; failed=1; }

# refuses CODE EXPECTED-LINE ARGUMENT...: exactly that line on stderr, nothing on stdout; begun=yes refuses ...: but what it began with
refuses() {
    local code=$1 expected=$2 status told
    shift 2
    $program "$@" >out 2>err
    status=$?
    mapfile -t told <err
    [ $status = "$code" ] && [ ! -s out -o -n "${begun:-}" ] && [ ${#told[@]} = 1 ] && [ "${told[0]}" = "$expected" ] && return
    fail "$program $*: exit $status, expected $code and: $expected"
    cat out err
}
