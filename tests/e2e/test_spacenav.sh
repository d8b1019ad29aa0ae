#!/usr/bin/env bash
# knead hand spacenav: the real libspnav with a spacenavd without a puck, moving a tool onto a served dough over LCM.
# The puck's next move waits for the tool, since a hand that did not run for 20 ms begins a new session.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

# Columns of a pose in hear.csv: t s n x y z vx vy vz qw qx qy qz b.
poses() { # poses AWK-CONDITION: print the number of poses
    awk -F, '$1 == "pose" { t = $2; s = $3; n = $4; x = $5; y = $6; z = $7; vx = $8; vy = $9; vz = $10
             qw = $11; qx = $12; qy = $13; qz = $14; b = $15; if ('"$1"') c++ } END { print c + 0 }' hear.csv
}
comes() { # comes SENTENCE AWK-CONDITION [N]: wait for 100 poses, or N
    enough() { [ "$(poses "$1")" -ge "$2" ]; }
    check "$1" await enough "$2" "${3:-100}"
}
newest() { awk -F, '$1 == "pose" { last = $'"$1"' } END { print last }' hear.csv; } # newest COLUMN
lines() { [ "$(grep -cE "$2" hand.err)" = "$1" ]; }
felt() { [ "$(awk -F, '$1 == "force" && $7 > 0.5' hear.csv | wc -l)" -gt 30 ]; }
start_spacenavd() {
    rm -f spnav.sock
    start_device spacenavd.out spacenavd "$SPNAV_SOCKET" 200 "$@"
    await [ -S spnav.sock ]
    hear finger 200 >hear.csv & hear=$!
}
stop_spacenavd() {
    check "the hand ends with 0" ended $hand
    kill $hear
    wait $hear 2>/dev/null
    stop_device
}
export SPNAV_SOCKET=$PWD/spnav.sock

start_kneadd dough-small.yaml
expect 'spacenavd does not answer' 3 knead hand spacenav
start_spacenavd
knead hand spacenav --quiet >hand.txt 2>hand.err & hand=$!
comes "poses come" 1
for way in '350 0 0 0 0 0:to the right:vx > 0.03:5' '0 0 350 0 0 0:forward:vy > 0.03:6'; do
    IFS=: read -r push where there column <<<"$way"
    bid push "$push"
    comes "pushed, the tool moves $where" "$there" 300
    bid push "${push/350/-350}"
    at_home() { holds "$(newest "$column") < 0.003"; }
    check "pushed back, the tool returns" await at_home
done
bid push 0 0 0 0 350 0
comes "twisted to the left, the tool turns left about the vertical" 'qz > 0.2 && qx * qx + qy * qy < 1e-6'
bid push 0 0 0 0 0 0
for button in 0 2; do bid button $button 1; done
comes "the buttons of the puck are in the pose" 'b == 5'
for button in 0 2; do bid button $button 0; done
bid push 0 -200 0 0 0 0
check "with the tool pushed down the dough pushes back" await felt
bid push 0 350 0 0 0 0
comes "pulled up, the tool moves up" 'vz > 0.03' 500
bid noise
check "unknown events are reported once" await lines 1 'spacenav: (an event of unknown|an unknown button)'
since=$(newest 2)
bid push 0 -100 0 0 0 0
comes "pushed down again, the tool moves down" "t > $since && vz < -0.01"
bid pull
stands() { holds "($(newest 10)) ^ 2 < 1e-6"; }
check "after the puck is unplugged the tool stops" await stands
since=$(newest 2)
comes "poses are still sent without the puck" "t > $since" 300
check "the tool stays where it stopped" [ "$(poses "t > $since && vz * vz > 1e-6")" = 0 ]
check "the tool never went below half of the dough" [ "$(poses 'z < 0.0299')" = 0 ]
again() { # again N WORDS: check that the loss is reported once, and then the return for the Nth time, in a new session
    check "the loss is reported in one line: $2" await lines 1 "spacenav lost: spacenavd: $2"
    [ "$1" = 2 ] || bid back
    check "the puck is found again" await lines "$1" 'spacenav is back'
    comes "the puck sends poses in a new session" "t > $since && s != $session"
}
session=$(newest 3)
bid away
again 1 "hung up"
since=$(newest 2) session=$(newest 3)
bid half
again 2 "an incomplete event"
kill -INT $hand
stop_spacenavd
check "more than 300 poses are sent per second" awk -F, '$1 == "pose" { if (!n++) from = $2; to = $2 } END { exit !(n > 300 * (to - from)) }' hear.csv
check "unknown events are reported once, and each loss is reported" eval 'lines 1 "spacenav: (an event of unknown|an unknown button)" && lines 2 "spacenav lost: "'
check "the tool never moves faster than its speed limit" [ "$(poses 'vx * vx + vy * vy + vz * vz > 3 * 0.0501 ^ 2')" = 0 ]

start_spacenavd old
script -qec "exec knead hand spacenav --seconds 4 --speed '2 cm/s' --basis -YXZ 2>hand.err" hand.txt >/dev/null & hand=$!
comes "poses come" 1
bid push 350 0 0 0 0 0
comes "a spacenavd of the old protocol works with another speed and another basis" 'vy > 0.019 && vy < 0.0201'
stop_spacenavd
check "a terminal shows where the tool is" grep -qE ' mm  +[-0-9.]+ +[-0-9.]+ +[-0-9.]+ N ' hand.txt
stop_kneadd
exit $failed
