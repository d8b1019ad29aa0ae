#!/usr/bin/env bash
# kneadd on the circuit itself, under Verilator, in real time: an object small enough for it under a hand that presses.
# The board is killed and started again meanwhile (2 times; KN_KILLS=N). Then a press of an object with gas in its cells is
# replayed from a log on the circuit, in its own time, with the same bits.
# night: a circuit under Verilator in real time
source "$KN_SOURCE/tests/e2e/kneadd.sh" && source "$KN_SOURCE/tests/e2e/board.sh" || exit 70
kills=${KN_KILLS:-2}
RANDOM=${KN_SEED:-1}
small=(--set 'object.size=[2 cm, 1 cm, 1 cm]' --set solver.kind=fixed --set solver.passes=1 --set solver.iterations=3)

board --engine rtl --uart --link "$PWD/board"
start_kneadd dough-small.yaml "${small[@]}" --backend "pty:$PWD/board"
$ahead knead probe --path press --depth '3 mm' --hold "$((2 + kills * 2)) s" --quiet & probe=$!
for ((kill = 1; kill <= kills; kill++)); do
    pause "1.$((100 + RANDOM % 900))"
    kill_board
    pause "0.$((100 + RANDOM % 400))"
    board --engine rtl --uart --link "$PWD/board"
done
check "the hand finished its press" wait $probe
stop_kneadd
grep 'circuit' kneadd.err
on=$(sed -n 's/^kneadd: \([0-9]*\) ticks on the circuit.*/\1/p' kneadd.err)
alone=$(sed -n 's/.*, \([0-9]*\) by the twin alone.*/\1/p' kneadd.err)
# their number depends on the machine's other load: a tick takes half a millisecond of a processor
check "at least 1000 ticks ran on the circuit: $on, on the twin alone $alone" [ "$on" -ge 1000 ]
check "the circuit was lost at least once per kill" [ "$(grep -oE 'lost [0-9]+ times' kneadd.err | tail -1 | grep -oE '[0-9]+')" -ge "$kills" ]
check "the circuit's results always equalled the twin's" grep -q 'different 0,' kneadd.err
check "the circuit's state equals the twin's at the end" grep -q "its state equals the twin's" kneadd.err
kill_board

pressed "$KN_SOURCE/core/scenes/dough-small.yaml" press.lcmlog 2 'object.size=[2 cm, 1 cm, 1 cm]' solver.kind=fixed solver.passes=1 \
    solver.iterations=3 object.pressure=cells
knead replay press.lcmlog --hash >twin.txt
board --engine rtl --uart --link "$PWD/board"
knead replay press.lcmlog --backend "pty:$PWD/board" --hash >circuit.txt
check "every tick of a replay runs on the circuit: $(grep circuit circuit.txt)" grep -qE '^circuit: ([0-9]+) of \1 ticks' circuit.txt
check "the hash of forces and state equals the twin's: $(hash_of twin.txt)" grep -qx "hash $(hash_of twin.txt)" circuit.txt
kill_board
exit $failed
