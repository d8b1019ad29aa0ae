#!/usr/bin/env bash
# A virtual hand on a served dough: it presses, pokes, swings and follows a file. Its record replays to the bit. It
# survives a killed server with its own watchdog, and lost poses by lifting.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

number() { sed -n "s/^  $1 *\([0-9.-]*\).*/\1/p" "$2"; } # print the number of a line of the table
# play NAME OPTION...: write a probe's table to NAME.txt and its messages to NAME.err
play() { $ahead knead probe "${@:2}" >"$1.txt" 2>"$1.err" || { cat "$1.err"; return 1; }; }

# A record can be verified only from an untouched object on. The hand waits for the scene, so it is there from the
# first tick.
$ahead knead probe --hold '0.5 s' --record press.lcmlog --csv press.csv >press.txt 2>press.err & hand=$!
start_kneadd dough-small.yaml --control control
check "a press is played and recorded" ended $hand
cat press.txt press.err
check "the table names the path, the scene and the tool" grep -q '^press of dough-small.yaml, tool plate$' press.txt
check "the force relaxes while the plate is held" \
    holds "$(number peak press.txt) > $(number 'end of hold' press.txt) && $(number 'end of hold' press.txt) > 0"
dent=$(number 'residual depth' press.txt)
check "dough keeps a dent of 1 to 10 mm" holds "$dent > 1 && $dent < 10"
check "every force echoes a pose" holds "$(number 'echoes matched' press.txt) == $(number 'forces received' press.txt)"
check "the CSV has a row for each force" holds "$(wc -l <press.csv) - 1 == $(number 'echoes matched' press.txt)"
check "the recording replays to its own forces" knead replay press.lcmlog --verify

if [ -n "${KN_NIGHT:-}" ]; then
    check "a press into an existing dent is played" play again --hold '0.2 s'
    check "a press into its own dent leaves less than half of the residual depth" holds "$(number 'residual depth' again.txt) < 0.5 * $dent"
fi
printf '%s\n' time_s,x_m,y_m,z_m 0,0.015,0,0.06 0.5,0.015,0,0.045 1,0.015,0,0.042 2,0.01,0,0.06 >path.csv
for path in poke sine path.csv; do
    check "$path is played" play $path --path $path --hold '0.5 s'
    check "$path touches the object" holds "$(number contact $path.txt) > 0"
done
expect 'has no probe `spoon`; it has: plate finger' 2 knead probe --probe spoon
expect 'expected at most 27.0 mm' 2 knead probe --depth '29 mm'
expect 'is 3.14 m/s fast, expected at most 1.2 m/s, which is 382 Hz at this depth' 2 knead probe --path sine --frequency '1000 Hz'

$ahead knead probe --path path.csv --drop-at '0.9 s,60 ms' >drop.txt 2>drop.err
cat drop.err
check "60 ms without a pose latch a fault, and the hand says why" \
    grep -q 'path, 0\.9[0-9]* s, .*: kneadd latched a fault: pose silence; remedy: ' drop.err
check "lifting clears it" grep -q 'tool lifted, fault cleared; trying again' drop.err
check "the path is played again after the fault" grep -q '^  try [23]: ' drop.txt

# A killed server cannot ramp any force down.
printf '%s\n' time_s,x_m,y_m,z_m 0,-0.015,0,0.06 0.5,-0.015,0,0.038 1.5,-0.015,0,0.028 60,-0.015,0,0.028 >hold.csv
$ahead knead probe --path hold.csv --motors motors.csv --tries 2 >killed.txt 2>killed.err & hand=$!
touching
kill -KILL "$server"
wait "$server" $hand 2>/dev/null
died=$?
cat killed.err
check "without a server the hand ends with exit 3" [ $died = 3 ]
check "the hand's own watchdog takes the force to 0 N" grep -q 'N taken to 0 N: own watchdog: no force for ' killed.err
check "the motors get a force and then none" awk -F, 'NR > 1 { f = $7 * $7 + $8 * $8 + $9 * $9; some += f > 0 } END { exit !(some && f == 0) }' motors.csv
check "the hand reports that kneadd has ended" grep -q 'no force for 3 s: kneadd has ended' killed.err

cp press.lcmlog kept.lcmlog
knead probe --lcm-url 'udpm://239.255.76.67:7700?ttl=0' --record kept.lcmlog 2>nobody.err
check "on a bus without a server the hand does not move" grep -q 'no KNEAD_SCENE for 4 s: is kneadd running' nobody.err
check "an older recording stays unchanged" cmp press.lcmlog kept.lcmlog

start_kneadd dough-small.yaml --set device=touch --local-model
$ahead knead probe --hand light --local --delay '20 ms' --loss 5% --hold '0.2 s' >felt.txt 2>felt.err
calm=$?
check "a hand on a simulated device presses; whether it is calm ($calm) is judged by timed.loop" [ $calm -le 1 ]
cat felt.txt felt.err
check "the table names the device and its link" grep -q '^  device          touch in a hand: light, 20 ms of delay, 5 % lost$' felt.txt
check "the force comes from the local model" holds "$(number 'local model' felt.txt) > 500 && $(number peak felt.txt) > 0.5"
stop_kneadd
exit $failed
