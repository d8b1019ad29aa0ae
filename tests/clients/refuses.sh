# Sourced by tests of programs: what has failed, and one line for whatever cannot be done.
failed=0 program=knead # that refuses
python3() { /usr/bin/python3 "$@"; } # Debian's, whatever comes first in PATH
ok() { echo "ok   $1"; }
fail() { echo "FAIL $1"; failed=1; }

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
