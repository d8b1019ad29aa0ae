#!/usr/bin/env bash
# kneadd is frozen for 5, 20, 50 and 200 ms at random instants of a press (kill -STOP and -CONT, 3 times each;
# KN_STALLS=N for more). Cycles that it missed are counted and skipped, none is made up for, and two cycles later it is
# on time. Every step is 1 ms, as its log replays to the bit. Forces keep the rules of core/safety.h on both sides, and
# a device that hears nothing gives 0 N after 20 ms. tests/tactile/test_link.c does the same in virtual time; here the
# clock and the stops are real, and the lines that kneadd prints are checked.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
stalls=${KN_STALLS:-3}
RANDOM=1
start_logger stall.lcmlog
start_kneadd dough-small.yaml --set device=touch --trace trace.csv
presser finger 1e6 >felt.txt & hand=$!
for ((n = 0; n < stalls; n++)); do
    for ms in 005 020 050 200; do
        sleep "$((RANDOM % 2 + 2)).$((100 + RANDOM % 900))" # a new session begins 1.2 s after a trip, and presses 0.5 s later
        kill -STOP $server
        sleep 0.$ms
        kill -CONT $server
    done
done
sleep 1
kill $hand
wait $hand
pause 1.5 # until its session ends
lines=$(grep -c '^Overrun' kneadd.err)
began=$(date +%s%N)
for ((n = 0; n < 30; n++)); do # ten a second, of 20 ms each
    kill -STOP $server
    pause 0.02
    kill -CONT $server
    pause 0.08
done
pause 1.5 # until the line is printed
lines=$(($(grep -c '^Overrun' kneadd.err) - lines))
burst_ms=$((($(date +%s%N) - began) / 1000000))
stop_kneadd
stop_logger
# a stall: 3 missed cycles or more; normal again: the tick is in its own cycle, none missed and less than 0.5 ms late
awk -F, 'NR > 1 {
        gap = $3 == session ? $1 - last - 1 : 0 # rows are of sessions only
        began = $10 > $9 ? $10 : $9
        own = $9 + 1e6 * gap
        foreign += $3 == session && (began + $11 < own || began + $11 >= own + 1e6)
        late = gap > 0 || $11 >= 5e5
        if (after > 0 && late && gap < 3) slow = after++
        else if (after > 0) { lame += slow > 2; after = slow = 0 }
        if (gap >= 3) { stalls++; skipped += gap; after = 1; if (gap > longest) longest = gap }
        ticks++; last = $1; session = $3
    }
    END { printf "ticks %d stalls %d skipped %d longest %d foreign %d lame %d\n", ticks, stalls, skipped, longest, foreign, lame }' trace.csv |
    tee ticks.txt
rules stall.lcmlog finger 3.3 4 | tee served.txt
cat felt.txt
check "it was frozen $((4 * stalls)) times" [ "$(number stalls ticks.txt)" -ge $((4 * stalls)) ]
check "what it missed is counted" [ "$(counter missed)" -ge "$(number skipped ticks.txt)" ]
line='^Overrun detected! The servo loop missed its desired rate of 1000 Hz. The loop took [0-9]*\.[0-9]{3} ms \(missed cycles : [0-9]+\)\.$'
check "and told, each time in ros2_control's words" [ "$(grep -cE "$line" kneadd.err) $(grep -cvE "$line" kneadd.err)" = "$(grep -c . kneadd.err) 0" ]
check "30 stalls in $burst_ms ms: $lines lines, one a second at most" [ "$lines" -ge 2 -a "$lines" -le $((burst_ms / 1000 + 1)) ]
told=$(grep -oE '[0-9]+\)\.$' kneadd.err | awk '{ n += $1 } END { print n + 0 }')
check "which tell of $told of $(counter missed) missed cycles, each once" [ "$told" -le "$(counter missed)" -a $((20 * told)) -ge $((19 * $(counter missed))) ]
check "no tick is in another's cycle: nothing is made up for" [ "$(number foreign ticks.txt)" = 0 ]
check "two cycles later it is on time, but for a tenth of them" [ $((10 * $(number lame ticks.txt))) -le "$(number stalls ticks.txt)" ]
check "neither kneadd nor the device breaks a rule" [ "$(number broken served.txt) $(number broken felt.txt)" = "0 0" ]
check "0 N after 20 ms without a force" [ "$(number zero_at felt.txt)" -le 20 ]
check "the device was pressed for most of it" [ "$(number pressed felt.txt)" -gt $((stalls * 2000)) ]
check "its steps are of 1 ms each: the log replays to the bit" knead replay stall.lcmlog --verify
exit $failed
