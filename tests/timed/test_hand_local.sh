#!/usr/bin/env bash
# knead hand with the local model on the simulated paddle and arm, behind a link of 20 ms, where forces are refused; and
# a force in kneadd's name that no physics makes. tests/tactile/test_link.c covers the numbers. This test has the
# protocols of real devices, a real bus and real clocks, and checks the lines that knead hand prints.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

far=udpm://239.255.76.67:7671?ttl=0
holds() { awk "BEGIN { exit !($1) }"; }
rows() { awk -F, "NR > 1 && ($1) { n++ } END { print n + 0 }" paddle.csv; } # $1 ms $2 z $3 asked $4 given $5 enabled
told() { grep -c -- "$1" hand.err; }
count() { grep -oE "$1 [0-9]+" hand.txt | grep -oE '[0-9]+$' | head -1; }
# hold SECONDS OPTION...: the paddle in a hand that presses every 4 s, for that time
hold() {
    paddle tty 100 >paddle.csv 2>paddle.err & paddle=$!
    sleep 0.3
    knead hand paddle --tty tty --quiet --seconds "$@" >hand.txt 2>hand.err
    check "it ends well: ${*:2}" [ $? = 0 ]
    kill $paddle
    wait $paddle 2>/dev/null
    cat hand.txt hand.err
}
calm() { # the force changes little from one ms to the next; $1: the column of the force given
    awk -F, -v c="$1" 'NR > 1 { if (f > 0.3 && $c > 0.3) { n += $c; d += $c > f ? $c - f : f - $c } f = $c }
        END { exit !(n > 0 && d < 0.03 * n) }' "$2"
}

start_kneadd dough-small.yaml --set device=unknown --local-model
link 'udpm://239.255.76.67:7667?ttl=0' "$far" 20 60 & link=$!
hold 6 --lcm-url "$far"
check "20 ms away a force is refused: one line" [ "$(told 'a round trip above 5 ms')" = 1 ]
check "that says what to do" [ "$(told '--local')" = 1 ]
check "and nothing is given, not even for a moment" [ "$(rows '$4 != 0')" = 0 ]
check "the motor stays off" [ "$(tail -n 2 paddle.csv | head -n 1 | cut -d, -f5)" = 0 ]
hold 8 --lcm-url "$far" --local
check "with the local model it is pushed back" [ "$(rows '$4 > 0.5')" -gt 100 ]
check "without a buzz" calm 4 paddle.csv
check "it is told how far kneadd is" holds "$(sed -n 's/.*round trip \([0-9.]*\) ms.*/\1/p' hand.txt) > 15"
kill $link
wait $link 2>/dev/null

haply 10001 30 >haply.csv 2>haply.err & service=$!
sleep 0.3
knead hand haply --quiet --seconds 9 --local >hand.txt 2>hand.err
check "an arm renders it, too" [ $? = 0 ]
kill $service
wait $service 2>/dev/null
cat hand.txt hand.err
check "it is pushed back" [ "$(awk -F, 'NR > 1 && $7 > 0.5' haply.csv | wc -l)" -gt 100 ]
check "without a buzz, on its own axes" calm 7 haply.csv
check "one message, one answer" [ "$(tail -n 2 haply.csv | head -n 1 | cut -d, -f8)" -lt 12000 ]
stop_kneadd

start_kneadd dough-small.yaml --set device=unknown
hold 5 --local
check "a kneadd that sends no contacts is told, and 0 N given" [ "$(told 'start kneadd with --local-model')" = 1 ]
check "whatever its forces are" [ "$(rows '$4 != 0')" = 0 ]

# a message in kneadd's name in the middle of a press: 60 N, more than the physics can give to any tool of this device
wild finger 60 20 & wild=$!
hold 8
wait $wild
check "a wild force was sent" [ $? = 0 ]
check "the guard trips on it" [ "$(told 'own impulse guard')" = 1 ]
check "what the motor is asked for never jumps" \
    awk -F, 'NR > 1 { d = $3 - f; if (on && $5 && d * d > 0.25) n++; f = $3; on = $5 } END { exit n > 0 }' paddle.csv
check "it fades, in steps, to 0 N and a motor that is off" \
    awk -F, 'NR > 1 { off += on && !$5 && pressed > 5; pressed += $4 > 0.2; on = $5 } END { exit !off }' paddle.csv
check "and a new session begins" [ "$(count tripped)" = 1 ]
stop_kneadd
exit $failed
