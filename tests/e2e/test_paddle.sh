#!/usr/bin/env bash
# knead hand paddle with a simulated paddle behind a pty. The loop is closed with a served dough over LCM. The paddle
# presses and is pushed back. The pair survives garbage, wrong bits, a pulled cable and a killed kneadd. The paddle
# gives no force once either end is silent.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

# column AWK-CONDITION FILE: count the rows that satisfy it; $1 ms $2 z $3 asked $4 given $5 enabled $6 tripped
column() {
    awk -F, "NR > 1 && ($1) { n++ } END { print n + 0 }" "$2"
}
count() { grep -oE "$1 [0-9]+" hand.txt | grep -oE '[0-9]+$'; }
start_hand() { # start_hand OPTION...
    knead hand paddle --tty tty --quiet "$@" >hand.txt 2>hand.err & hand=$!
}
stop_hand() { kill -INT $hand; wait $hand; hand_status=$?; cat hand.txt hand.err; }

start_kneadd dough-small.yaml --set device=unknown
paddle tty 150 deaf=2000:50 garbage=3000 flip=4500 hangup=6000:800 >paddle.csv 2>paddle.err & paddle=$!
await [ -e tty ]
start_hand --force-limit '2.5 N'
pushed_again() { [ "$(column '$1 > 8500 && $4 > 0.5' paddle.csv)" -gt 100 ]; }
await pushed_again
kill -STOP $hand # the computer stands still, so the paddle's own watchdog must act
sleep 0.5
kill -CONT $hand
sleep 1
stop_hand
kill $paddle
wait $paddle 2>/dev/null
check "the hand ends with 0" [ $hand_status = 0 ]
check "the paddle is pushed back" [ "$(column '$4 > 0.5' paddle.csv)" -gt 100 ]
check "the force points up, apart from a little damping" \
    [ "$(($(column '$4 < 0' paddle.csv) * 10))" -lt "$(column '$4 > 0.5' paddle.csv)" ]
check "the force never exceeds the paddle's limit" [ "$(column '$3 > 2.5001' paddle.csv)" = 0 ]
check "the dough stops the paddle: it does not go as deep as in air" \
    [ "$(column '$4 > 1 && $2 < -0.034' paddle.csv)" = 0 ]
check "pressing does not buzz: the force changes by less than 3 % in a millisecond" \
    awk -F, 'NR > 1 { if (f > 0.5 && $4 > 0.5) { n += $4; d += $4 > f ? $4 - f : f - $4 } f = $4 } END { exit !(n > 0 && d < 0.03 * n) }' paddle.csv
check "in free air the paddle gets no force" [ "$(column '$2 > -0.01 && $4 > 0.01' paddle.csv)" = 0 ]
check "garbage and wrong bits are reported" [ "$(told 'bytes that are not part of a frame')" -ge 1 ]
check "errors are reported in at most ten lines" [ "$(told 'bytes that are not part of a frame')" -le 10 ]
check "bad frames are counted" [ "$(count bad)" -gt 100 ]
check "the paddle received whole frames, apart from those cut by a cable or an opening" \
    [ "$(tail -n 2 paddle.csv | head -n 1 | cut -d, -f8)" -le 3 ]
check "an unplugged cable is reported in one line" [ "$(told 'paddle lost: tty')" = 1 ]
check "a paddle that has switched its motor off is reported in one line" [ "$(told 'paddle lost: it has switched its motor off')" = 1 ]
check "its return is reported in one line, as that of the cable" [ "$(told 'paddle is back')" = 2 ]
check "the paddle is pushed back again afterwards" pushed_again
check "a program that stood still reports it" [ "$(told 'this program did not run for')" -ge 1 ]
check "the paddle's watchdog trips while the program stands still" [ "$(column '$6' paddle.csv)" -gt 300 ]
check "the paddle gives no force while its watchdog is tripped" [ "$(column '$6 && $4 != 0' paddle.csv)" = 0 ]

stop_kneadd
start_kneadd dough-small.yaml # restarted, since its dough has no dent
# kneadd dies during a press. By its own clock the paddle has no force 20 ms after the last one, plus a little for the
# way.
rm -f tty
paddle tty 40 >paddle.csv 2>>paddle.err & paddle=$!
await [ -e tty ]
start_hand
pushed() { tail -n 2 paddle.csv | awk -F, 'NR == 1 && $4 + 0 > 0.3 { ok = 1 } END { exit !ok }'; }
check "the paddle was pushed back when kneadd was killed" await pushed
since=$(tail -n 2 paddle.csv | head -n 1 | cut -d, -f1)
kill -KILL "$server"
wait "$server" 2>/dev/null
await grep -q 'is kneadd running' hand.err
stop_hand
kill $paddle
wait $paddle 2>/dev/null
awk -F, -v since="$since" 'NR > 1 && $1 >= since && !zero { if ($4 > most) most = $4; if ($4 > 0.95 * most) held = $1; if ($4 == 0) zero = $1 }
    END { print "     kneadd killed: motor at 0 N " zero - held " ms after it had its whole force, by the firmware'"'"'s clock" }' paddle.csv
check "the force faded, in steps, and never came back" fades paddle.csv 4 "$since"
check "the hand reports the missing force" [ "$(told 'no force from kneadd for')" -ge 1 ]
check "the hand reports once that nobody answers" [ "$(told 'is kneadd running')" = 1 ]
check "the motor was switched off" [ "$(tail -n 2 paddle.csv | head -n 1 | cut -d, -f5)" = 0 ]

start_kneadd dough-small.yaml
expect 'nothere: No such file or directory; knead devices lists the serial lines$' 3 knead hand paddle --tty nothere
expect '/dev/null: no serial line; ' 3 knead hand paddle --tty /dev/null
stop_kneadd
exit $failed
