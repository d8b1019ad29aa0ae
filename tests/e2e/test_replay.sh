#!/usr/bin/env bash
# A replay equals the record. Two presses by knead probe, recorded by the probe and by lcm-logger, replay to their own
# forces to the bit. Several replays of one log agree.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
press() { $ahead knead probe --path press --hold '200 ms' --quiet --record "$1"; }

start_logger bus.lcmlog # started first, so that it hears the server's start
start_kneadd dough-small.yaml --control control
check "a hand presses" press press.lcmlog
check "a hand presses a second time" press second.lcmlog
export KNEAD_CONTROL=control
check "a hand presses a third time, with the control socket" press third.lcmlog
stop_kneadd
stop_logger

check "the hand's own recording verifies" verifies press.lcmlog
check "lcm-logger's recording of two sessions, from start to stop of the server, verifies" verifies bus.lcmlog
check "the replay reports the number of verified forces" grep -Eq '^verified [0-9]{4,} forces, 1 probe$' bus.lcmlog.said
expect 'was already deformed when this log begins' 2 knead replay second.lcmlog
check "a recording of the kneaded object holds this object, and verifies" verifies third.lcmlog
check "it continues from there" grep -q '^continued from the snapshot of tick [0-9]*$' third.lcmlog.said

knead replay "$KN_SOURCE/core/scenes/dough-small.yaml" press.lcmlog --csv a.csv --hash >a && knead replay press.lcmlog --csv b.csv --hash >b
check "two replays have the same hash" cmp -s a b
runs=${KN_RUNS:-5}
hashes=$(for ((i = 0; i < runs; i++)); do knead replay press.lcmlog --hash | grep '^hash'; done | sort | uniq -c)
check "$runs replays have the same hash:$hashes" [ "$(wc -l <<<"$hashes") $(grep -oE '^ *[0-9]+' <<<"$hashes" | tr -d ' ')" = "1 $runs" ]
check "two replays have the same table, except for the step times" cmp -s <(cut -d, -f1-17 a.csv) <(cut -d, -f1-17 b.csv)
check "the table has one row per verified force" [ $(($(wc -l <a.csv) - 1)) = "$(sed -n 's/verified \([0-9]*\) forces.*/\1/p' press.lcmlog.said)" ]
exit $failed
