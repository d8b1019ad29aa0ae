#!/usr/bin/env bash
# SIGTERM while a hand presses: the hand's force falls to zero at a bounded slope, then kneadd ends with 0.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
start_logger stop.lcmlog
start_kneadd dough-small.yaml
$ahead knead probe --path press --hold '20 s' --quiet >/dev/null 2>&1 &
hand=$!
# according to the log so far
pressed() { logcheck stop.lcmlog >so_far 2>/dev/null && [ "$(number peak_n so_far | cut -d. -f1)" -ge 5 ]; }
await pressed
stop_kneadd
kill $hand
sleep 0.2
stop_logger
logcheck stop.lcmlog | tee stopped
check "the hand was being pushed" holds "$(number peak_n stopped) >= 5"
check "the forces carry the flag of the stop for at most 100 ms" \
    [ "$(number stopping stopped)" -gt 0 -a "$(number stopping stopped)" -le 101 ]
check "the last force is zero" holds "$(number last_n stopped) <= 0"
# The gain takes 17 ms for the whole clamp, 40 N in profile bench.
check "the force fell by at most 2.4 N/ms" holds "$(number steepest_n stopped) <= 2.4"

# An object too large for this machine is served nevertheless, with a warning.
kneadd "$KN_SOURCE/core/scenes/dough.yaml" --set object.spacing='1 mm' --realtime off >large 2>&1 &
server=$!
await grep -q serving large
sleep 0.3
kill -TERM $server
check "a scene too slow for real time is served and ends with 0" ended $server
check "kneadd reports at the start that it is not real time" grep -q '^kneadd: not real time: a tick takes .* ms here' large
exit $failed
