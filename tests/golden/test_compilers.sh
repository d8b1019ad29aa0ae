#!/bin/sh
# Same bits from gcc and clang at -O1 and -O3: builds the core and the golden presses four times and compares what they print.
set -eu
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
cd "$KN_SOURCE"

compilers=
for cc in gcc clang; do
    if command -v $cc >/dev/null; then compilers="$compilers $cc"; else echo "no $cc here"; fi
done
test -n "$compilers" || { echo "skipped: no compiler"; exit 77; }

# One line per object file, the flags as in CMakeLists.txt; all compiled together, as many at a time as there are processors.
for cc in $compilers; do
    for level in -O1 -O3; do
        mkdir "$out/$cc$level"
        command="$cc -w -Wno-psabi -std=c17 -D_GNU_SOURCE -I. -ffp-contract=off $level"
        for file in core/*.c tests/golden/test_golden.c; do
            case $file in core/kernel*.c) continue ;; esac
            echo "$command -c $file -o $out/$cc$level/$(basename "$file" .c).o"
        done
        for precision in F32 F64; do
            for file in core/kernel*.c; do
                kernel="-c $file -DKN_KERNEL_$precision=1 -o $out/$cc$level/$(basename "$file" .c)_$precision"
                echo "$command $kernel.base.o -DKN_KERNEL_BASE=1"
                echo "$command $kernel.avx2.o -DKN_KERNEL_AVX2=1 -mavx2 -mfma"
                echo "$command $kernel.avx512.o -DKN_KERNEL_AVX512=1 -mavx512f -mavx512vl -mavx512dq -mfma"
            done
        done
    done
done | xargs -P "$(nproc)" -I{} sh -c '{}'

# every instruction set at -O3, the processor's own at -O1, where base would take minutes
for cc in $compilers; do
    for level in -O1 -O3; do
        $cc -o "$out/$cc$level/golden" "$out/$cc$level"/*.o -lm
        [ $level = -O1 ] && echo "$out/$cc$level" || echo "$out/$cc$level KN_ALL_ISAS=1"
    done
done | xargs -P "$(nproc)" -L1 sh -c 'env $1 "$0/golden" 2>/dev/null | grep "^ *golden " | sort -u >"$0.txt" || true'

presses=$(grep -c '^TEST(' tests/golden/test_golden.c)
reference=
for cc in $compilers; do
    for level in -O1 -O3; do
        # the numbers pinned in test_golden.c do not matter here, only that all builds agree; one line each, whoever
        # computed it
        test "$(wc -l <"$out/$cc$level.txt")" -eq "$presses" || { echo "$cc $level: not one hash each:"; cat "$out/$cc$level.txt"; exit 1; }
        reference=${reference:-$out/$cc$level.txt}
        diff "$reference" "$out/$cc$level.txt" || { echo "$cc $level gives other bits than $(basename "$reference" .txt)"; exit 1; }
        echo "$cc $level: same bits"
    done
done
cat "$reference"
