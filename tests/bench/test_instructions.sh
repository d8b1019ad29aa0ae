#!/bin/bash
# The step has not become slower. callgrind counts the instructions of fifty steps, and the script compares them with
# instructions.txt. Other load on the machine does not matter. The counts are of one compiler; other compilers are not
# judged. After an intended change, record the new cost and state the benefit in the commit message:
#
#     KN_RECORD=1 ctest --preset release -R bench.instructions
set -u
list=$KN_SOURCE/tests/bench/instructions.txt
steps=$KN_BUILD/tests/tools/steps
compiler=$(sed -n 's/^# compiler: //p' "$list")
tolerance=5 # per cent: libm and the loader differ a little between Debian versions

command -v valgrind >/dev/null || { echo "skipped: no valgrind here"; exit 77; }
if [ -z "${KN_RECORD:-}" ] && [ "$("$steps")" != "$compiler" ]; then
    echo "skipped: built by $("$steps"), counted with $compiler"
    exit 77
fi
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

count() { # print instructions and iterations of a case
    valgrind --tool=callgrind --toggle-collect=counted --callgrind-out-file="$out/profile" "$steps" "$1" >"$out/iterations" 2>"$out/log"
    case $? in
    0) echo "$(sed -n 's/^summary: //p' "$out/profile") $(cat "$out/iterations")" ;;
    77) echo "skipped: no AVX2 here" >&2 && return 77 ;;
    *) cat "$out/log" >&2 && return 1 ;;
    esac
}

failed=0
sed "s/^# compiler: .*/# compiler: $("$steps")/; /^[^#]/d" "$list" >"$out/new"
while read -r name expected iterations; do
    [ "$name" = "#" ] && continue
    now=$(count "$name") || exit $?
    echo "$name $now" >>"$out/new"
    read -r instructions now_iterations <<<"$now"
    ratio=$(awk "BEGIN { printf \"%.3f\", $instructions / $expected }")
    echo "$name: $instructions instructions in $now_iterations iterations, recorded $expected in $iterations: $ratio"
    awk "BEGIN { exit $ratio > 1 + $tolerance / 100 }" || failed=1
    awk "BEGIN { exit $ratio < 1 - $tolerance / 100 }" || echo "$name: record that it became faster"
done <"$list"
if [ -n "${KN_RECORD:-}" ]; then
    cp "$out/new" "$list"
elif [ $failed = 1 ]; then
    echo "slower by more than $tolerance %: see the lines above"
    exit 1
fi
