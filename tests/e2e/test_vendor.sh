#!/usr/bin/env bash
# knead hand forcedimension and touch, with a test library that has the makers' functions over a simulated device
# (tests/tactile/vendor_library.c). The loop is closed with a served jelly. The device presses and is pushed back. It
# is unplugged, knead hand stands still, kneadd and knead hand are killed, and knead hand ends, each in a press.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"
start_kneadd jelly.yaml
expect 'libdhd.so.3: cannot open shared object file: .*: install the Force Dimension SDK, with' 3 knead hand forcedimension
expect 'libHD.so: cannot open shared object file: .*: install OpenHaptics, with' 3 knead hand touch --no-watchdog
mkdir libraries
cp "$KN_BUILD"/tests/tools/libvendor.so libraries/libHD.so
ln -s libHD.so libraries/libdhd.so.3
export LD_LIBRARY_PATH=$PWD/libraries KN_VENDOR_TTY=$PWD/tty
expect 'libdhd: no device found; see knead devices' 3 knead hand forcedimension
expect 'libHD: HD_COMM_ERROR .0x0302.; see knead devices' 3 knead hand touch --no-watchdog

ms() { tail -n 2 device.csv | head -n 1 | cut -d, -f1; }
pressed() { tail -n 2 device.csv | awk -F, -v since="$since" 'NR == 1 && $1 > since && $4 > 0.5 { ok = 1 } END { exit !ok }'; }
# stood: print how many ms force stood, by the device's clock, after the last command before the longest silence
stood() {
    awk -F, -v since="$since" 'function over() { if (forced && rows > longest) { longest = rows; ms = forced } rows = forced = 0 }
        NR > 1 && NF == 9 && $1 >= since { if ($7 != before) over(); before = $7; rows++; forced += $4 != 0 }
        END { over(); print (longest >= 100 ? ms : 99) }' device.csv
}
begin() { knead hand $kind --quiet $([ $kind = forcedimension ] || echo --no-watchdog) >hand.txt 2>hand.err & hand=$!; }
off() { # the last command came without enable, before the watchdog tripped
    awk -F, -v since="$since" 'NR > 1 && NF == 9 && $1 >= since { if ($5 && $6) late = 1; enabled = $5 } END { exit late || enabled }' device.csv
}
for kind in forcedimension touch; do
    paddle tty 100 hangup=1500:600 >device.csv & device=$!
    await [ -e tty ]
    hear finger 100 >hear.csv & hear=$!
    begin
    since=0
    check "$kind: the device is pushed back" await pressed
    check "$kind: the device's frame is turned to the scene's: 5 mm right, 1 cm forward, 90 degrees, a button" \
        awk -F, '$1 == "pose" && $5 == 0.005 && $6 == 0.01 && $11 > 0.707 && $14 > 0.707 && $15 == 2 { n++ } END { exit n < 100 }' hear.csv
    kill $hear
    wait $hear 2>/dev/null
    check "$kind: an unplugged device is reported" await grep -q "$kind lost: " hand.err
    check "$kind: a device that is back is reported" await grep -q "$kind is back" hand.err
    since=2500
    check "$kind: it is pushed back again" await pressed
    since=$(ms)
    kill -STOP $hand
    pause 0.4
    kill -CONT $hand
    check "$kind: while knead hand stands still, the device gives force for 20 ms at most" [ "$(stood)" -le 20 ]
    check "$kind: knead hand reports it" await grep -q 'this program did not run for' hand.err
    since=$(ms)
    check "$kind: then it is pushed back again" await pressed
    since=$(ms)
    kill -KILL $server
    wait $server 2>/dev/null
    check "$kind: a killed kneadd is reported" await grep -q 'no force from kneadd for' hand.err
    pause 0.1
    check "$kind: the force faded, in steps, and never came back" fades device.csv 4 "$since"
    start_kneadd jelly.yaml
    since=$(ms)
    check "$kind: a new kneadd pushes it back" await pressed
    since=$(ms)
    kill -KILL $hand
    pause 0.4
    check "$kind: knead hand is killed: the device gives force for 20 ms at most" [ "$(stood)" -le 20 ]
    wait $hand 2>/dev/null
    begin
    since=$(ms)
    check "$kind: a new knead hand pushes it back" await pressed
    since=$(ms)
    kill -INT $hand
    check "$kind: knead hand ends with 0" ended $hand
    pause 0.1
    check "$kind: the end switches the motor off before the device's watchdog does" off
    kill $device
    wait $device 2>/dev/null
    check "$kind: the force never exceeds the clamp" awk -F, 'NR > 1 && $4 > 3.3001 { bad = 1 } END { exit bad }' device.csv
done
# A device without a watchdog is refused.
paddle tty 60 unwatched=0 >device.csv & device=$!
await [ -e tty ]
kind=forcedimension
begin
wait $hand
check "a device without a watchdog is refused" [ $? = 3 ]
check "the reason is told" [ "$(told 'its watchdog has not acted in 100 ms of silence')" = 1 ]
check "its motors were on in the test, at 0 N" awk -F, '$5 == 1 { on = 1 } $4 != 0 && NR > 1 { forced = 1 } END { exit forced || !on }' device.csv
kill $device
wait $device 2>/dev/null
stop_kneadd
exit $failed
