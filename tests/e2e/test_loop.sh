#!/usr/bin/env bash
# A simulated device in a hand, closed round kneadd over LCM: calm with the coupling of its class and no delay but the bus's,
# unstable with 20 ms more where the lattice is a wall, and the passivity controller has work then.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

number() { sed -n "s/^  $1 *\([0-9.-]*\).*/\1/p" "$2"; } # of a line of the table
holds() { awk "BEGIN { exit !($1) }"; }
# feel NAME OPTION...: exit 0 when it was calm; a machine that stands still shakes any hand, or spoils its tries
feel() {
    local pause
    for pause in 2 0; do
        knead probe --hold '2 s' "${@:2}" >"$1.txt" 2>"$1.err" && return
        sleep $pause
    done
    cat "$1.txt" "$1.err"
    return 1
}

start_kneadd dough-small.yaml --set device=touch
check "a firm hand presses dough through a device, and it is calm" feel firm --hand firm
cat firm.txt
check "it felt the press" holds "$(number peak firm.txt) > 0.5"
check "with a tool that is coupled" grep -q 'tool finger$' firm.txt
check "a light swing through its skin is calm" feel swing --hand light --path sine
check "left alone with 1 N on it, it is calm, too" feel none --hand none --path sine
knead probe --hand light --path sine --delay '20 ms' --quiet >refused.txt 2>refused.err
check "forces that old are refused unless they are asked for" [ $? = 3 ]
cat refused.err
check "by one line that says why and what to do" grep -q 'a round trip above 5 ms: .*--local' refused.err
check "before the tool touches anything" sh -c '! grep -v engage refused.err | grep -q "taken to 0 N"'
knead probe --hold '2 s' --hand light --delay '20 ms' --held >late.txt 2>late.err
late=$?
cat late.txt late.err
check "20 ms away the same coupling is not calm: it buzzes or drives the hand, or kneadd stops it" \
    [ $late = 1 -o $late = 3 ]
[ $late = 1 ] || check "which it says" grep -q 'kneadd latched' late.err
if [ $late = 1 ]; then
    check "and the controller had work" holds "$(sed -n 's/.*damped for \([0-9]*\) ms/\1/p' late.txt) > 100"
fi
stop_kneadd

start_kneadd jelly.yaml --set device='{profile: touch, force_scale: 0.25}'
check "a light hand on soft jelly is calm" feel jelly --hand light
check "also 5 ms and a fifth of the messages away" feel far --hand light --delay '5 ms' --loss 20% --held
check "also with one axis" feel one --hand light --axes 1 --path sine
stop_kneadd

start_kneadd dough.yaml --set device='{profile: touch, force_scale: 0.25}'
check "the paper's press is played on a device of 3.3 N" knead probe --hold '1 s' >press.txt
cat press.txt
check "the object gives what it gave" holds "$(number peak press.txt) > 11"
check "and the hand a quarter of it, below the limit" \
    holds "$(number "hand's share" press.txt) > 2.8 && $(number "hand's share" press.txt) < 3.3"
check "which did not act" [ "$(grep -c 'limit$' press.txt)" = 0 ]
stop_kneadd

knead probe --hand tight 2>tight.err
check "a hand that nobody has is refused" [ $? = 2 ]
check "with those there are" grep -q '^knead probe: --hand tight: expected none, light, normal or firm$' tight.err
for option in "--device touch" "--axes 1" "--delay 5ms" "--loss 0.1" --local --held; do
    knead probe $option 2>alone.err
    check "$option is nothing without a hand" grep -q "^knead probe: ${option% *} without a hand on a device" alone.err
done
knead probe --hand light --local --held 2>both.err
check "forces are held, or not rendered at all" grep -q '^knead probe: --held with --local, .*, expected one of them$' both.err
knead probe --hand light --loss 2 2>loss.err
check "more than all cannot be lost" grep -q '^knead probe: --loss 2: expected a share below 1, like 20%$' loss.err
knead probe --hand light --delay 1.5ms 2>delay.err
check "a delay is whole milliseconds" grep -q '^knead probe: --delay 1.5ms: expected whole milliseconds, at most 255$' delay.err
exit $failed
