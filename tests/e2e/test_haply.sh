#!/usr/bin/env bash
# knead hand haply with a simulated Inverse Service after Haply's documentation, an arm and a person. The loop is
# closed with a served dough over LCM. A trouble begins while the person presses, and ends once it has been reported.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

# rows AWK-CONDITION: count rows of haply.csv; ms x y z fx fy fz said wrong greeted; new: this force came just now
rows() {
    awk -F, 'NR > 1 && NF == 10 { new = $8 != said; ms = $1; x = $2; y = $3; z = $4; fx = $5; fy = $6; fz = $7; said = $8; wrong = $9
             greeted = $10; f = sqrt(fx * fx + fy * fy + fz * fz); if ('"$1"') n++ } END { print n + 0 }' haply.csv
}
last() { tail -n 2 haply.csv | head -n 1 | cut -d, -f"$1"; }
pushed() { holds "$(last 7) > 0.5"; } # at this moment
trouble() { # trouble NAME [WORDS]: wait until WORDS are reported, and the arm has been down for 100 ms without a force
    check "the arm is pushed back before the fault" await pushed
    bid "$1" 1
    local since=$(($(last 1) + 100))
    [ $# = 1 ] || check "$1: the hand reports $2" await grep -q "$2" hand.err
    held_down() { [ "$(rows "ms > $since && z < -0.02")" -ge 100 ]; }
    check "$1: the arm is held down" await held_down
    check "$1: the arm gives no force" [ "$(rows "ms > $since && f > 0")" = 0 ]
    bid "$1" 0
}
start_kneadd dough-small.yaml
expect 'the Inverse Service does not answer' 3 knead hand haply
start_device haply.csv haply 10001 200
await [ -s haply.csv ]
hear finger 200 >hear.csv & hear=$!
knead hand haply --quiet --force-limit '3 N' >hand.txt 2>hand.err & hand=$!
trouble malformed 'no JSON at byte'
trouble mute 'has not answered for 1 s'
trouble cold
trouble hangup 'haply lost: the Inverse Service at localhost:10001 hung up'
trouble gone 'no longer has arm 049D'
since=$(last 1)
pushed_again() { [ "$(rows "ms > $since && fz > 0.5")" -gt 50 ]; }
check "after all faults the arm is pushed back again" await pushed_again
check "the arm was found again after each loss" [ "$(told 'haply is back')" = 3 ]
kill -INT $hand
check "the hand ends with 0" ended $hand
kill $hear
wait $hear 2>/dev/null
stop_device
check "the force never exceeds the limit" [ "$(rows 'f > 3.0001')" = 0 ]
check "the dough stops the arm: it does not go as deep as in air" [ "$(rows 'fz > 1 && z < -0.034')" = 0 ]
check "in free air the arm gets no force" [ "$(rows 'new && z > -0.01 && f > 0.01')" = 0 ]
check "most messages are answered, apart from damaged ones: $(last 8) of $(rows 1)" [ "$(last 8)" -gt $(($(rows 1) / 2)) ]
check "no message of another kind is sent" [ "$(last 9)" = 0 ]
check "each fault is reported in one line" [ "$(told 'no JSON at byte') $(told 'haply lost')" = "1 3" ]
check "an arm that is found gets the commands for axes and preset" [ "$(last 10)" -ge 4 ]
check "the grip turns the tool and presses its button" \
    [ "$(awk -F, '$1 == "pose" && $11 > 0.707 && $14 > 0.707 && $15 == 2' hear.csv | wc -l)" -gt 100 ]
check "the tool never belonged to another client" grep -q 'forces for other clients 0' hand.txt
stop_kneadd

start_kneadd dough-small.yaml # restarted, since its dough has no dent
start_device haply.csv haply 10001 200
await [ -s haply.csv ]
knead hand haply --quiet >hand.txt 2>hand.err & hand=$!
check "the arm is pushed back before kneadd is killed" await pushed
since=$(last 1)
kill -KILL "$server"
wait "$server" 2>/dev/null
check "the hand reports the missing force" await grep -q 'no force from kneadd for' hand.err
pause 1
kill -INT $hand
wait $hand
stop_device
check "the force faded, in steps, and never came back" fades haply.csv 7 "$since"
gone=$(awk -F, -v since="$since" '$1 > since && $7 == 0 { print $1; exit }' haply.csv)
check "no force to the side remains" [ "$(rows "ms > $gone && f != 0")" = 0 ]
check "the arm still gets commands of zero force" [ "$(rows "ms > $gone + 100 && new")" -gt 50 ]
exit $failed
