#!/usr/bin/env bash
# A simulated device in a hand on a real bus: calm near kneadd, refused its forces 20 ms away, calm there with the local
# model. tests/clients/test_closed_loop_hand.c covers what else it feels, clients.cli the options of such a hand.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

number() { sed -n "s/^  $1 *\([0-9.-]*\).*/\1/p" "$2"; } # a number of a line of the table
holds() { awk "BEGIN { exit !($1) }"; }
# feel NAME OPTION...: exit 0 when it was calm
feel() { knead probe --hold '1 s' "${@:2}" >"$1.txt" 2>"$1.err" || { cat "$1.txt" "$1.err"; return 1; }; }

start_kneadd dough-small.yaml --set device=touch --local-model
check "a firm hand presses dough through a device, and it is calm" feel firm --hand firm
cat firm.txt
check "it felt the press" holds "$(number peak firm.txt) > 0.5"
check "with a tool that is coupled" grep -q 'tool finger$' firm.txt
knead probe --hand light --path sine --delay '20 ms' --quiet >refused.txt 2>refused.err
check "forces that are 20 ms old are refused unless they are asked for" [ $? = 3 ]
cat refused.err
check "by one line that says why and what to do" grep -q 'a round trip above 5 ms: .*--local' refused.err
check "before the tool touches anything" sh -c '! grep -v engage refused.err | grep -q "taken to 0 N"'
check "with the local model, a fifth of all lost, it is calm there" feel local --hand light --local --delay '20 ms' --loss 20%
check "and every tick that came has one" holds "$(number 'local model' local.txt) > 1500"
check "the hand gets no more back than it gave" holds "$(number 'energy given' local.txt) < 1"
stop_kneadd
exit $failed
