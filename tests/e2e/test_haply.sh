#!/usr/bin/env bash
# knead hand haply: an Inverse Service made from its documentation, with a simulated arm and a person behind it, closed
# round a served dough over LCM.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

rows() { # rows AWK-CONDITION: of haply.csv; ms x y z fx fy fz said wrong greeted; new: this force has just been said
    awk -F, 'NR > 1 { new = $8 != said; ms = $1; x = $2; y = $3; z = $4; fx = $5; fy = $6; fz = $7; said = $8; wrong = $9; greeted = $10
             f = sqrt(fx * fx + fy * fy + fz * fz); if ('"$1"') n++ } END { print n + 0 }' haply.csv
}
last() { tail -n 2 haply.csv | head -n 1 | cut -d, -f"$1"; }

start_kneadd dough-small.yaml
expect 'the Inverse Service does not answer' 3 knead hand haply

haply 10001 40 malformed=1500:250 hangup=2100:400 gone=3200:400 mute=4300:1200 cold=6300:500 >haply.csv 2>haply.err &
service=$!
await [ -s haply.csv ]
hear finger 40 >hear.csv & hear=$!
knead hand haply --quiet --force-limit '3 N' >hand.txt 2>hand.err & hand=$!
until [ "$(last 1 | tr -dc 0-9)0" -gt 105000 ] || ! kill -0 $hand $service; do pause 0.5; done
kill -INT $hand
check "it ends well" ended $hand
sleep 0.5
kill $service $hear
wait $service $hear 2>/dev/null
cat hand.txt hand.err haply.err
check "the hand is pushed back" [ "$(rows 'fz > 0.5')" -gt 100 ]
check "never with more than was allowed" [ "$(rows 'f > 3.0001')" = 0 ]
check "the dough holds it: pushed, it does not come as deep as in air" [ "$(rows 'fz > 1 && z < -0.034')" = 0 ]
check "in air it is left alone" [ "$(rows 'new && z > -0.01 && f > 0.01')" = 0 ]
check "a message, an answer, but for what was spoilt: $(last 8) of $(rows 1)" [ "$(last 8)" -gt $(($(rows 1) / 2)) ]
check "and no message of another kind" [ "$(last 9)" = 0 ]
check "answers that are no JSON are one line" [ "$(told 'no JSON at byte')" = 1 ]
check "and give no force" [ "$(rows 'new && ms > 1550 && ms < 1750 && f > 0')" = 0 ]
check "a service that says nothing gives none either" [ "$(rows 'new && ms > 4350 && ms < 5500 && f > 0')" = 0 ]
check "it is left after a second" [ "$(told 'has not answered for 1 s')" = 1 ]
check "one that hangs up is one line" [ "$(told 'haply lost: the Inverse Service at localhost:10001 hung up')" = 1 ]
check "an arm that is gone is one line" [ "$(told 'no longer has arm 049D')" = 1 ]
check "each is found again" [ "$(told 'haply is back')" = 3 ]
check "and greeted again: axes, preset" [ "$(last 10)" -ge 4 ]
check "an arm that is not calibrated gives no pose and gets no force" [ "$(rows 'new && ms > 6350 && ms < 6800 && f > 0')" = 0 ]
check "after all of it, it is pushed back again" [ "$(rows 'ms > 8500 && fz > 0.5')" -gt 50 ]
check "the grip turns the tool and presses its button" \
    [ "$(awk -F, '$1 == "pose" && $11 > 0.707 && $14 > 0.707 && $15 == 2' hear.csv | wc -l)" -gt 100 ]
check "no pose was refused by kneadd's owner of the tool" grep -q 'forces of others 0' hand.txt

stop_kneadd
start_kneadd dough-small.yaml # whose dough has no dent
# kneadd dies in mid-press
rm haply.csv
haply 10001 40 >haply.csv & service=$!
await [ -s haply.csv ]
knead hand haply --quiet >hand.txt 2>hand.err & hand=$!
pushed() { tail -n 2 haply.csv | awk -F, 'NR == 1 { exit !($7 + 0 > 0.3) }'; }
await pushed
kill -KILL "$server"
wait "$server" 2>/dev/null
await grep -q 'no force from kneadd for' hand.err
pause 1
kill -INT $hand
wait $hand
kill $service
wait $service 2>/dev/null
cat hand.txt hand.err
gone=$(awk -F, '$7 > 0 { last = $1 } END { print last + 0 }' haply.csv)
check "it pressed when kneadd was killed" [ "$(rows "ms > $gone - 60 && fz > 0.25")" -gt 3 ]
check "the force faded, and in steps, not at once" [ "$(rows "ms > $gone - 12 && ms <= $gone && fz > 0")" -ge 3 ]
check "and never came back" [ "$(rows "ms > $gone && f != 0")" = 0 ]
check "while it was still told that it is zero" [ "$(rows "ms > $gone + 100 && new")" -gt 50 ]
check "one line says so" [ "$(told 'no force from kneadd for')" -ge 1 ]
exit $failed
