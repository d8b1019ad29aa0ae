#!/usr/bin/env bash
# kneadd killed and frozen at random instants of a press (10 times; KN_KILLS=N for more), under two devices, which log what their motors
# give by their own clock: the one that renders forces gives 0 N 20 ms after the last one, the one that renders the local model goes on
# with it for 100 ms and has leaked away by 300.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
kills=${KN_KILLS:-10}
RANDOM=1
presser near 1e6 x=-0.015 >near.csv & near=$!
presser far 1e6 x=0.015 local >far.csv & far=$!
running=0
for ((kill = 0; kill < kills; kill++)); do
    start_kneadd "$KN_SOURCE/tests/e2e/two_fingers.yaml" --local-model
    sleep "$((RANDOM % 2 + 1)).$((300 + RANDOM % 700))" # a new session begins 1.2 s after the kill, and presses 0.4 s later
    kill -0 $server && running=$((running + 1))
    if [ $((kill % 2)) = 1 ]; then
        kill -STOP $server
        sleep 0.4
    fi
    kill -KILL $server
    wait $server 2>/dev/null
done
sleep 0.5
kill $near $far
wait $near
check "the device that renders forces wrote down every tick" [ $? = 0 ]
wait $far
check "and so did the other one" [ $? = 0 ]
for device in near far; do
    local=$([ $device = far ] && echo 1 || echo 0)
    echo "$device:"
    awk -v clamp=3.3 -v guard=4 -v local=$local -f "$KN_SOURCE/tests/tactile/device.awk" $device.csv | tee $device.txt
    check "$device: never more than the clamp" [ "$(number over_clamp $device.txt)" = 0 ]
    check "$device: in contact never more than the guard lets through" [ "$(number over_guard $device.txt)" = 0 ]
    check "$device: no transition is steeper than 0.5 N per ms" [ "$(number over_slope $device.txt)" = 0 ]
    check "$device: 0 N in its first tick at its deadline or behind it, and on: after $(number zero_at $device.txt) ms" [ "$(number after_deadline $device.txt)" = 0 ]
done
check "$running of $kills were killed while they served" [ $running = $kills ]
check "each silenced the device that renders forces" [ "$(number outages near.txt)" -ge "$kills" ]
check "there was something to take away in a third of them" [ "$(number felt near.txt)" -ge $((kills / 3)) ]
check "also with the local model, which a next kneadd may reach in time" [ "$(number felt far.txt)" -ge $((kills / 5)) ]
exit $failed
