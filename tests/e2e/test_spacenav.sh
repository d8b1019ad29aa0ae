#!/usr/bin/env bash
# knead hand spacenav: the real libspnav on a spacenavd that has no puck, steering a tool onto a served dough over LCM.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

poses() { # poses AWK-CONDITION: of hear.csv; t s n x y z vx vy vz qw qx qy qz b
    awk -F, '$1 == "pose" { t = $2; s = $3; n = $4; x = $5; y = $6; z = $7; vx = $8; vy = $9; vz = $10
             qw = $11; qx = $12; qy = $13; qz = $14; b = $15; if (!first) first = s; if ('"$1"') c++ } END { print c + 0 }' hear.csv
}
export SPNAV_SOCKET=$PWD/spnav.sock

start_kneadd dough-small.yaml
expect 'spacenavd does not answer' 3 knead hand spacenav

# to the right, forward, a turn to the left, two buttons; then down into the dough, and up again
spacenavd "$SPNAV_SOCKET" 30 at=1500:350,0,0,0,0,0 at=1900:-350,0,0,0,0,0 at=2300:0,0,0,0,0,0 \
    at=2400:0,0,350,0,0,0 at=2800:0,0,-350,0,0,0 at=3200:0,0,0,0,0,0 \
    at=3300:0,0,0,0,350,0 at=3900:0,0,0,0,-350,0 at=4500:0,0,0,0,0,0 button=4600:0:1 button=4700:2:1 button=4900:0:0 button=5000:2:0 \
    at=5100:0,-200,0,0,0,0 at=8000:0,350,0,0,0,0 at=9200:0,0,0,0,0,0 noise=9300 \
    at=9700:0,-100,0,0,0,0 pull=10000 hangup=11000:500 half=12500 &
daemon=$!
await [ -S spnav.sock ]
hear finger 40 >hear.csv & hear=$!
knead hand spacenav --quiet --seconds 14 >hand.txt 2>hand.err
check "it ends well" [ $? = 0 ]
kill $hear
wait $hear 2>/dev/null
cat hand.txt hand.err
check "pushed to the right, the tool goes to the right" [ "$(poses 'vx > 0.03')" -gt 100 ]
check "pushed away, forward" [ "$(poses 'vy > 0.03')" -gt 100 ]
check "pulled up, up" [ "$(poses 'vz > 0.03')" -gt 100 ]
check "twisted to the left, to the left about the vertical" [ "$(poses 'qz > 0.2 && qx * qx + qy * qy < 1e-6')" -gt 100 ]
check "its buttons are the pose's" [ "$(poses 'b == 5')" -gt 50 ]
check "poses, hundreds a second" awk -F, '$1 == "pose" { if (!n++) from = $2; to = $2 } END { exit !(n > 300 * (to - from)) }' hear.csv
check "the dough answers" [ "$(awk -F, '$1 == "force" && $7 > 0.5' hear.csv | wc -l)" -gt 30 ]
check "the tool stays above half of it" [ "$(poses 'z < 0.0299')" = 0 ]
check "noise is told once" [ "$(grep -cE 'spacenav: (an event of no|a button of)' hand.err)" = 1 ]
check "and moves nothing by more than its speed" [ "$(poses 'vx * vx + vy * vy + vz * vz > 3 * 0.0501 ^ 2')" = 0 ]
check "a puck that is pulled out stops the tool" [ "$(poses 's == first && n > 10500 && vz * vz > 1e-6')" = 0 ]
check "a spacenavd that is gone is one line" [ "$(told 'spacenav lost: spacenavd: hung up')" = 1 ]
check "half an event is another" [ "$(told 'spacenav lost: spacenavd: half an event')" = 1 ]
check "it was found again each time" [ "$(told 'spacenav is back')" = 2 ]
check "in a new session each" [ "$(awk -F, '$1 == "pose" { print $3 }' hear.csv | sort -u | wc -l)" -ge 3 ]
kill $daemon
wait $daemon 2>/dev/null
rm spnav.sock

spacenavd "$SPNAV_SOCKET" 20 old at=1500:350,0,0,0,0,0 &
await [ -S spnav.sock ]
hear finger 40 >hear.csv & hear=$!
knead hand spacenav --quiet --seconds 3 --speed '2 cm/s' --basis -YXZ >hand.txt 2>hand.err
kill $hear
wait $hear 2>/dev/null
check "a spacenavd of the old protocol will do, at another speed, behind another basis" \
    [ "$(poses 'vy > 0.019 && vy < 0.0201')" -gt 100 ]
stop_kneadd
exit $failed
