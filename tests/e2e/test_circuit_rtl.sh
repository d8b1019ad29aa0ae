#!/usr/bin/env bash
# A press of an object with gas in its cells is replayed from a log on the circuit itself, under Verilator, in its own
# time, with the same bits. e2e.pci serves a hand on it.
# night: a circuit under Verilator
source "$KN_SOURCE/tests/e2e/kneadd.sh" && source "$KN_SOURCE/tests/e2e/board.sh" || exit 70
pressed "$KN_SOURCE/core/scenes/dough-small.yaml" press.lcmlog 2 'object.size=[2 cm, 1 cm, 1 cm]' solver.kind=fixed solver.passes=1 \
    solver.iterations=3 object.pressure=cells
knead replay press.lcmlog --hash >twin.txt
board --engine rtl --uart --link "$PWD/board"
knead replay press.lcmlog --backend "pty:$PWD/board" --hash >circuit.txt
check "every tick of a replay runs on the circuit: $(grep circuit circuit.txt)" grep -qE '^circuit: ([0-9]+) of \1 ticks' circuit.txt
check "the hash of forces and state equals the twin's: $(hash_of twin.txt)" grep -qx "hash $(hash_of twin.txt)" circuit.txt
kill_board
exit $failed
