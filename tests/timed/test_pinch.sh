#!/usr/bin/env bash
# Two fingers, each a hand of its own (two processes), lift a piece of dough, and their log replays to the bit.
# tests/clients/test_closed_loop_hand.c covers what they feel.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
finger() { knead probe --probe "$1" --path "$KN_SOURCE/clients/examples/$1.csv" --tries 1 --quiet 2>"$1.err"; }

# Both wait for the same KNEAD_SCENE, which comes every second, so they begin together.
start_logger pinch.lcmlog
start_kneadd pinch.yaml
finger thumb & thumb=$!
finger index & index=$!
wait $thumb && wait $index
played=$?
stop_kneadd
stop_logger
knead replay pinch.lcmlog --verify >said
cat thumb.err index.err
check "both fingers play their path to the end" [ $played = 0 ]
check "and what they felt is replayed to the bit" grep -Eq '^verified [0-9]{5,} forces, 2 probes$' said

knead view pinch.lcmlog --at 5.8 --azimuth 10 --elevation 12 --png lifted.png >/dev/null 2>view.err
check "it can be seen in the air: $(cat view.err)" [ -s lifted.png ]
exit $failed
