#!/bin/sh
# gcc and clang at -O1 give the same bits as this build. The script builds the core and the golden presses with each
# compiler and compares the output. golden.golden checks -O3 and every instruction set in the presets that ask for it.
# night: builds the core twelve times over; golden.golden compares the two builds of the gate
set -eu
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
cd "$KN_SOURCE"

compilers=
for cc in gcc clang; do
    if command -v $cc >/dev/null; then compilers="$compilers $cc"; else echo "no $cc here"; fi
done
test -n "$compilers" || { echo "skipped: no compiler"; exit 77; }

# One line per object file, with the flags of CMakeLists.txt. All are compiled in parallel, one job per processor.
for cc in $compilers; do
    mkdir "$out/$cc"
    command="$cc -w -Wno-psabi -std=c17 -D_GNU_SOURCE -DKN_VERSION=0 -I. -ffp-contract=off -O1"
    for file in $(find core -name '*.c' ! -path 'core/scene/*' ! -name 'kernel_*.c') tests/golden/test_golden.c; do
        echo "$command -c $file -o $out/$cc/$(basename "$file" .c).o"
    done
    for precision in F32 F64; do
        for file in core/solve/kernel_*.c; do
            kernel="-c $file -DKN_KERNEL_$precision=1 -o $out/$cc/$(basename "$file" .c)_$precision"
            echo "$command $kernel.base.o -DKN_KERNEL_BASE=1"
            echo "$command $kernel.avx2.o -DKN_KERNEL_AVX2=1 -mavx2 -mfma"
            echo "$command $kernel.avx512.o -DKN_KERNEL_AVX512=1 -mavx512f -mavx512vl -mavx512dq -mfma"
        done
    done
done | xargs -P "$(nproc)" -I{} sh -c '{}'

# The numbers pinned in test_golden.c do not matter here, only that all builds agree. Each number gives one line, for
# any instruction set.
unset KN_ALL_ISAS
hashes() { { "$@" 2>/dev/null || true; } | grep '^ *golden ' | sort -u; }
presses=$(grep -cE '0x[0-9a-f]{16}' tests/golden/test_golden.c)
hashes "$KN_BUILD/tests/test_golden" golden >"$out/this"
for cc in $compilers; do
    $cc -o "$out/$cc/golden" "$out/$cc"/*.o -lm
    hashes "$out/$cc/golden" >"$out/$cc.txt"
    test "$(wc -l <"$out/$cc.txt")" -eq "$presses" || { echo "$cc -O1: not one hash each:"; cat "$out/$cc.txt"; exit 1; }
    diff "$out/this" "$out/$cc.txt" || { echo "$cc -O1 gives other bits than this build"; exit 1; }
    echo "$cc -O1: same bits"
done
cat "$out/this"
