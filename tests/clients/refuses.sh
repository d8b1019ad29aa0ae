# Functions for tests of command-line programs: count failures, and check that a refusal is one line.
failed=0
program=knead # the program that refuses() calls
python3() { /usr/bin/python3 "$@"; } # Debian's python3, independent of PATH
ok() { echo "ok   $1"; }
fail() { echo "FAIL $*"; failed=1; }
# json FILE EXPRESSION: return whether a Python expression about the JSON object `o` in FILE is true.
json() { python3 -c "import json, sys; o = json.load(open('$1')); sys.exit(not ($2))"; }
png() { head -c 8 "$1" | od -An -c | grep -q 'P   N   G'; } # png FILE: return whether FILE is a PNG

# refuses CODE EXPECTED-LINE ARGUMENT...: expect exactly that line on stderr and nothing on stdout.
# begun=yes refuses ...: expect some output on stdout before the refusal.
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

# begins CODE WORDS COMMAND...: expect one line on stderr that begins with WORDS, and nothing on stdout.
begins() {
    local code=$1 words=$2 status told
    "${@:3}" >out 2>err
    status=$?
    mapfile told <err
    [ $status = "$code" ] && [ ! -s out ] && [ ${#told[@]} = 1 ] && [[ ${told[0]} == "$words"*$'\n' ]] && return
    fail "${*:3}: exit $status, expected $code and: $words..."
    cat out err
}
