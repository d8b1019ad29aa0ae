#!/usr/bin/env bash
# The motors after the death of the program between kneadd and a device. knead hand is killed, stopped, or starved of
# its processor while a person is held off with 3 N. The device's own watchdog takes the force away. A device that
# shows no watchdog when it is opened is refused, and gives no force. The script prints how long the force lasted
# after the last command.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"
declare -A given=([paddle]=4 [haply]=7) heard=([paddle]=7 [haply]=8) # columns: force of the motor, commands
begin() { # begin DEVICE OF-THE-DEVICE OPTION...: start a simulated device, and knead hand on it
    rm -f tty
    if [ "$1" = paddle ]; then
        start_device device.csv paddle tty 60 $2
        await [ -e tty ]
    else
        start_device device.csv haply 10001 60
        [ -z "$2" ] || bid $2 1
        await [ -s device.csv ]
    fi
    knead hand "$1" $([ "$1" = haply ] || echo --tty tty) --quiet --force-limit '3 N' --origin '0,0,5 cm' "${@:3}" >hand.txt 2>hand.err &
    hand=$!
}
pressed() { tail -n 2 device.csv | awk -F, -v c="${given[$1]}" 'NR == 1 && $c + 0 > 2.9 { ok = 1 } END { exit !ok }'; }
# lasts DEVICE: print the ms, by the device's clock, with force after the last command before its longest silence
lasts() {
    awk -F, -v c="${given[$1]}" -v h="${heard[$1]}" 'function over() { if (forced && rows > longest) { longest = rows; ms = forced } rows = forced = 0 }
        NR > 1 && NF > h { if ($h != before) over(); before = $h; rows++; forced += $c != 0 }
        END { over(); print (longest >= 100 ? ms : "no silence of 100") }' device.csv
}
end() { # end HOW
    case $1 in
    killed) kill -KILL $hand ;;
    stopped) kill -STOP $hand ;;
    starved) # a process with a higher priority takes the only allowed processor
        taskset -a -cp 0 $hand && chrt -a -f -p 30 $hand && timeout 0.4 taskset -c 0 chrt -f 40 sh -c 'while :; do :; done'
        ;;
    esac >/dev/null
    pause 0.3
}
ways="killed stopped"
[ "$KN_REALTIME" = off ] || ! chrt -f 41 true 2>/dev/null || ways="$ways starved"
for kind in paddle haply; do
    for way in $ways; do
        start_kneadd dough-small.yaml --set device=unknown # restarted, since its dough has no dent
        begin $kind ""
        check "$kind: the device pushes back with 3 N" await pressed $kind
        end $way
        ms=$(lasts $kind)
        echo "     $kind, the hand $way: force for $ms ms after the last command, then 0 N by the device's own watchdog"
        check "$kind: 20 ms after the hand is $way, the device gives no force" [ "${ms//[a-z ]/9}" -le 20 ]
        kill -KILL $hand 2>/dev/null
        wait $hand 2>/dev/null
        stop_device >/dev/null
        stop_kneadd >/dev/null
    done
    start_kneadd dough-small.yaml --set device=unknown
    begin $kind $([ $kind = paddle ] && echo unwatched=0 || echo sticky)
    wait $hand
    check "$kind: a device without a watchdog is refused" [ $? = 3 ]
    check "the reason of the refusal is reported" [ "$(told 'has not acted in 100 ms of silence')" = 1 ]
    check "the refused device has given no force" [ "$(awk -F, -v c="${given[$kind]}" 'NR > 1 && $c != 0' device.csv | wc -l)" = 0 ]
    stop_device >/dev/null
    begin $kind $([ $kind = paddle ] && echo unwatched=0 || echo sticky) --no-watchdog
    check "with --no-watchdog the device gives force" await pressed $kind
    kill -INT $hand
    wait $hand
    stop_device >/dev/null
    stop_kneadd >/dev/null
done
exit $failed
