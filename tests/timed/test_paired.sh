#!/usr/bin/env bash
# A hand presses the dough of 847 nodes for 20 s (KN_SECONDS=N for more), idle and with every processor loaded
# (KN_LOAD=no or yes: only one of them). The test decides whether the machine or kneadd makes a tick late. Two
# references on the servo's core observe the machine in the same run: kneadd's own sentinel, below the servo, and a
# witness ahead of it (tool_paired.c), which no servo can delay. Counts and ratios of that run are judged; times are
# only printed.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
seconds=${KN_SECONDS:-20}
[ "$KN_REALTIME" != off ] && chrt -f 99 true 2>/dev/null || { echo "skipped: no SCHED_FIFO here" && exit 77; }
holds() { awk "BEGIN { exit !($1) }"; }
# summary N: the n-th number of "woken 1 ms late or more A times (B explained), 0.5 ms C (D); its sentinel E and F times in G wakes"
summary() { grep 'kneadd: woken' kneadd.log | grep -oE '[0-9.]+' | sed -n "$1p"; }
run() { # run NAME
    start_kneadd dough.yaml --trace trace.csv
    local task core
    task=$(grep -l '^servo$' "/proc/$server/task/"*/comm | head -1)
    core=$(sed 's/.*) //' "${task%comm}stat" | cut -d' ' -f37)
    presser finger 1e6 profile=bench >felt.csv & hand=$!
    sleep 1
    paired witness "$core" "$seconds" >witness.txt || failed=1
    kill $hand
    wait $hand
    stop_kneadd
    paired judge trace.csv witness.txt | tee judged.txt
    local ticks=$(number ticks judged.txt) n
    awk -v name="$1" -v n="$ticks" -v s1="$(number woken_1ms judged.txt)" -v w="$(number wakes judged.txt)" -v w1="$(number late_1ms judged.txt)" \
        -v e="$(summary 7)" -v g="$(summary 9)" 'BEGIN {
        printf "%s: 1 ms late or more: servo %.4f %%, sentinel %.4f %%, witness %.4f %% of their wakes\n", name, 100 * s1 / n, 100 * e / g, 100 * w1 / w }'
    check "$1: the hand was there for all of it" holds "$ticks > 950 * $seconds"
    check "$1: no tick was woken 1 ms late but by the machine, says the witness" [ "$(number unexplained_1ms judged.txt)" = 0 ]
    check "$1: and the sentinel: $(summary 2) times, $(summary 3) explained" [ "$(summary 2)" = "$(summary 3)" ]
    n=$(number woken_half judged.txt)
    check "$1: a tenth of those of 0.5 ms is unexplained at most, or two" holds "$(number unexplained_half judged.txt) <= 2 + 0.1 * $n"
    # counts of rare events scatter by their square roots
    check "$1: the servo is 1 ms late as seldom as its references: 1.5 times and 0.01 %" \
        holds "$(summary 2) <= 1.5 * $(summary 7) + 1e-4 * $ticks + 3 * sqrt($(summary 2) + $(summary 7))"
    check "$1: one tick in a thousand at most took longer than its millisecond and ten times the median, but by the machine" \
        holds "$(number unexplained_long judged.txt) <= 1e-3 * $ticks"
}
[[ ${KN_LOAD:-no} = yes ]] || run idle
[[ ${KN_LOAD:-yes} = yes ]] || exit $failed
command -v stress-ng >/dev/null || { echo "no stress-ng here: the loaded run is not tried" && exit $failed; }
stress-ng --quiet --cpu 0 --vm 1 --vm-bytes 64m --switch 1 --hdd 1 --hdd-bytes 64m & load=$!
sleep 1
run loaded
kill $load
wait $load 2>/dev/null
exit $failed
