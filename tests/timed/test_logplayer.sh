#!/usr/bin/env bash
# A recorded press is played by stock lcm-logplayer into a running kneadd. Its poses come late, doubled or not at all.
# The contact force is still the recorded one within the cost of late poses: 5 % of the peak, 10 % of the variation.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70

# peak and total variation of the contact force in a replay's CSV
peak() { awk -F, 'NR > 1 && $9 > m { m = $9 } END { print m + 0 }' "$1"; }
variation() { awk -F, 'NR > 1 { d = $9 - last; v += d < 0 ? -d : d; last = $9 } END { print v + 0 }' "$1"; }
within() { awk -v a="$1" -v b="$2" -v share="$3" 'BEGIN { d = a - b; exit !(a > 1 && (d < 0 ? -d : d) <= share * a) }'; }

play() { # into a fresh kneadd; played.csv holds its answer
    start_logger played.lcmlog
    start_kneadd dough-small.yaml
    $ahead lcm-logplayer -e 'KNEAD_POSE.*' hand.lcmlog >/dev/null 2>&1
    stop_logger
    stop_kneadd
    knead replay played.lcmlog --verify --csv played.csv >/dev/null
}
alike() {
    echo "peak $(peak hand.csv) N by hand, $(peak played.csv) N played; variation $(variation hand.csv) N, $(variation played.csv) N"
    within "$(peak hand.csv)" "$(peak played.csv)" 0.05 && within "$(variation hand.csv)" "$(variation played.csv)" 0.10
}
pressed "$KN_SOURCE/core/scenes/dough-small.yaml" hand.lcmlog
knead replay hand.lcmlog --csv hand.csv >/dev/null # the force that the hand felt
check "what is played is a log that verifies" play
check "the force is the hand's: peak within 5 %, variation within 10 %" alike # a bound for poses up to 3 ms late
exit $failed
