#!/usr/bin/env bash
# tests/tactile/test_link.c with real processes. kneadd is killed (kill -9) and frozen at random instants of a press (4
# times; KN_KILLS=N for more) under two devices. By its own clock the device that renders forces gives 0 N 20 ms after
# the last force, the one that renders the local model 300 ms after it.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
kills=${KN_KILLS:-4}
RANDOM=1
presser near 1e6 x=-0.015 >near.txt & near=$!
presser far 1e6 x=0.015 local >far.txt & far=$!
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
wait $near $far
cat near.txt far.txt
check "no rule is broken, with forces or the local model" [ "$(number broken near.txt) $(number broken far.txt)" = "0 0" ]
check "$running of $kills were killed while they served" [ $running = $kills ]
check "each silenced the device that renders forces" [ "$(number outages near.txt)" -ge "$kills" ]
check "there was something to take away in a third of them" [ "$(number felt near.txt)" -ge $((kills / 3)) ]
check "in a fifth with the local model, which a next kneadd may reach in time" [ "$(number felt far.txt)" -ge $(((kills + 4) / 5)) ]
exit $failed
