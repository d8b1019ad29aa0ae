# Sourced by tests of knead: what has failed, and one line for whatever cannot be done.
failed=0
python3() { /usr/bin/python3 "$@"; } # Debian's, whatever comes first in PATH
fail() { echo "FAIL $1"; failed=1; }

refuses() { # refuses CODE EXPECTED-LINE ARGUMENT...: exactly that line on stderr
    local code=$1 expected=$2
    shift 2
    knead "$@" >out 2>err
    local status=$?
    [ $status = "$code" ] && [ "$(cat err)" = "$expected" ] && return
    fail "knead $*: exit $status, expected $code and: $expected"
    cat err
}
