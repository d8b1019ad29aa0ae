#!/usr/bin/env bash
# kneadd --backend shm:NAME?shadow=off under a hand that presses. The board is killed in the press: the force is held for
# at most 3 ticks and is zero within 20, and kneadd tells how old the object is that it takes up. Then it stands still
# until the board is back (lost=stop), or the processor computes it (lost=go-on). A log without a loss is replayed by
# the processor, to the bit.
# night: kills of a board in real time; server.circuit holds its rules
source "$KN_SOURCE/tests/e2e/kneadd.sh" && source "$KN_SOURCE/tests/e2e/board.sh" || exit 70
name=knead-offload-$$
in_step() { ctl --json status | grep -q '"state": *"in_step"'; }

for lost in stop go-on; do
    board --bar "$name"
    # an object under gravity begins settled and takes no ticks until a tool touches it
    start_kneadd dough-small.yaml --set 'gravity=1 m/s^2' --backend "shm:$name?shadow=off&lost=$lost&miss=20" --control control
    check "the circuit is in step before the press" await in_step
    $ahead knead probe --path poke --quiet --record calm.lcmlog
    if [ "$(field '["circuit"]["losses"]')" != 0 ]; then
        echo "skipped: the machine stood still, and the circuit was lost in the poke: no log to verify"
    else
        check "$lost: the processor replays a poke into the circuit's object, to the bit" verifies calm.lcmlog
    fi
    $ahead knead probe --path press --quiet --record press.lcmlog & hand=$!
    pressing
    pause 1.2 # stderr has a line a second
    before=$(grep -c 'went back by' kneadd.err)
    kill_board
    tells() { [ "$(grep -c 'went back by [0-9]* ms' kneadd.err)" -gt "$before" ]; }
    check "$lost: kneadd tells the loss and the object's age" await tells
    grep 'circuit lost' kneadd.err
    pause 0.3
    board --bar "$name"
    check "$lost: the new board gets in step" await in_step
    kill -INT $hand
    wait $hand
    logcheck press.lcmlog >log.txt
    check "$lost: the force of $(number held_n log.txt) N is zero $(number gone log.txt) ticks later" \
        holds "$(number back log.txt) >= 1 && $(number held_n log.txt) > 0.3 && $(number gone log.txt) <= 20"
    ctl reset >/dev/null
    check "$lost: after a reset the circuit is in step again" await in_step
    knead probe --path poke >poke.txt 2>&1
    check "$lost: a poke into the new object has a force: $(grep peak poke.txt)" grep -qE 'peak +[1-9]' poke.txt
    kill -INT $server
    check "$lost: kneadd stopped" wait $server
    grep 'on the circuit' kneadd.err
    check "$lost: no result was different" grep -q 'different 0,' kneadd.err
    expect 'the circuit was lost, and the object went back to its state of tick [0-9]+, which the log does not hold' 2 \
        knead replay press.lcmlog --verify
    kill_board
done
exit $failed
