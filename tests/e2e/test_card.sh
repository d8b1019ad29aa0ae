#!/usr/bin/env bash
# kneadd --backend pty on a simulated board that is killed once under a hand: the messages of kneadd and knead ctl,
# and the same forces as a run without a board. e2e.circuit tests many kills, and e2e.circuit_rtl the real circuit.
source "$KN_SOURCE/tests/e2e/kneadd.sh" && source "$KN_SOURCE/tests/e2e/board.sh" || exit 70
circuit() { ctl --json status | python3 -c "import json, sys; c = json.load(sys.stdin)['circuit']; sys.exit(not ($1))"; }

board --uart --link "$PWD/board"
start_kneadd dough-small.yaml --backend "pty:$PWD/board" --control control
$ahead knead probe --path press --hold '2 s' --quiet --record press.lcmlog & hand=$!
check "the circuit is in step" await circuit 'c["state"] == "in_step" and c["ok"] > 100'
touching
check "a hand presses" kill -0 $hand
kill_board
check "after a kill the circuit is not in step, and the reason is reported" await circuit 'c["state"] != "in_step" and c["last_loss"] in ("timeout", "removed")'
board --uart --link "$PWD/board"
check "the restarted circuit is in step again" await circuit 'c["state"] == "in_step" and c["loads"] > 1'
check "the status text names the circuit" eval 'ctl status | grep -q circuit'
expect 'a circuit steps the object' 2 ctl set material.k1=30000
wait $hand
stop_kneadd
grep circuit kneadd.err
check "kneadd reports why the circuit was lost and that it is back" eval 'grep -q "circuit lost, .* so far: \(removed\|timeout\): " kneadd.err && grep -q "in step again" kneadd.err'
check "kneadd reports the circuit's ticks at the end" grep -q 'ticks on the circuit, .* different 0, ' kneadd.err
check "the forces equal those of a run without the circuit" verifies press.lcmlog
expect 'a circuit takes one step a tick' 2 timeout 20 kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --backend "pty:$PWD/board" \
    --set solver.dt='0.5 ms'
exit $failed
