#!/usr/bin/env bash
# kneadd, its time stolen, takes a lower point of quality. It says so in the force, in an event and on stderr, and comes
# back when it is told; the log replays over it to the bit. Refused points end with 2 and one line.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
[ "$KN_REALTIME" != off ] && chrt -f 90 true 2>/dev/null || { echo "skipped: no SCHED_FIFO here" && exit 77; }
verifies() { knead replay "$1" --verify >"$1.said" 2>"$1.err" || { cat "$1.said" "$1.err"; return 1; }; }
expect '--quality fast: the scene has no quality points' 2 kneadd "$KN_SOURCE/core/scenes/jelly.yaml" --quality fast
expect 'quick: expected fast, balanced, accurate or own' 2 kneadd "$KN_SOURCE/core/scenes/jelly.yaml" --quality quick

# a finger presses and goes on slowly; meanwhile the servo's time is stolen for 0.8 s
printf '%s\n' time_s,x_m,y_m,z_m 0,0,0,0.06 0.8,0,0,0.045 1,0,0,0.041 6,0,0,0.038 6.5,0,0,0.06 >path.csv
affordable='{iterations: 10, iterations_max: 12, passes: 1}' # far below the budget; only the thief exceeds it
pressed() { awk -v f="$(number last_n before.txt)" 'BEGIN { exit !(f > 0.3) }'; }
start_logger slow.lcmlog
start_kneadd dough.yaml --quality accurate --set quality.accurate="$affordable" --control control
$ahead knead probe --path path.csv --quiet >/dev/null 2>hand.err &
hand=$!
for _ in $(seq 150); do
    pause 0.1
    logcheck slow.lcmlog >before.txt 2>/dev/null && pressed && break
done
steal "$server"
stole=$?
[ $stole = 0 ] || exit $stole
pause 1
knead ctl --control control quality best >refused 2>&1
refused=$?
knead ctl --control control quality accurate >took
wait $hand
stop_kneadd
stop_logger
logcheck slow.lcmlog | tee slow.txt
check "a hand pressed when the time was stolen" pressed
check "kneadd took a lower point" [ "$(number stepped slow.txt)" -ge 1 ]
check "through zero force" [ "$(number lowest_gain slow.txt)" = 0.000000 ]
check "every force since then, and no other, says so" [ "$(number reduced slow.txt)" -gt 500 -a "$(number mistaken slow.txt)" = 0 ]
check "a point that there is none of was refused" [ "$refused $(grep -c "expected fast, balanced, accurate or own" refused)" = "2 1" ]
check "it came back once, when it was told" [ "$(number commanded slow.txt)" = 1 ]
check "stderr has the way down" \
    grep -q "^kneadd: quality accurate -> .* consecutive ticks took more than 0.8 ms" kneadd.err
check "and the way back" [ "$(grep -c "^kneadd: quality .* -> accurate, as commanded" kneadd.err)" = 1 ]
grep '^kneadd:' kneadd.err
check "the log replays over it to the bit" verifies slow.lcmlog
check "kneadd ended with 0" [ "$status" = 0 ]
exit $failed
