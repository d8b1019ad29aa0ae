#!/usr/bin/env bash
# kneadd --backend pty: under a hand that presses. The board (a process behind a pseudo-terminal, or a piece of memory)
# is killed and started again meanwhile (twice; KN_KILLS=N). The force is the same to the bit as if nothing had
# happened. Then the log is replayed on the board in the board's own time, again with random kills (3 times;
# KN_REPLAY_KILLS=N).
# night: kills of a board in real time; server.circuit_device and server.circuit hold its rules
source "$KN_SOURCE/tests/e2e/kneadd.sh" && source "$KN_SOURCE/tests/e2e/board.sh" || exit 70
kills=${KN_KILLS:-2} replay_kills=${KN_REPLAY_KILLS:-3}
RANDOM=${KN_SEED:-1}
get_in_step() { # return once the circuit is in step, so that a kill is a loss; wait at most 20 s
    local tries
    for ((tries = 0; tries < 200; tries++)); do
        ctl --json status | grep -q '"state": *"in_step"' && return
        pause 0.1
    done
    echo "not in step in 20 s:" && tail -3 kneadd.err && ps -T -o tid,cls,rtprio,stat,wchan:20,time,comm -p $simdev,$server
}
number() { grep -oE "$1 -?[0-9]+" "$2" | grep -oE -- '-?[0-9]+$'; }

board --uart --link "$PWD/board"
start_kneadd dough-small.yaml --backend "pty:$PWD/board" --control control
$ahead knead probe --path press --hold "$((2 + kills * 2)) s" --quiet --record press.lcmlog & probe=$!
for ((kill = 1; kill <= kills; kill++)); do
    pause "1.$((100 + RANDOM % 900))"
    get_in_step
    kill_board
    pause "0.$((100 + RANDOM % 400))"
    ctl --json status >"killed.$kill.json"
    board --uart --link "$PWD/board"
done
check "the hand finished its press" wait $probe
ctl status >status.txt
ctl --json status >status.json
check "knead ctl status names the circuit" grep -q circuit status.txt
check "while the board is killed, the status has the loss, the degraded mode and a named error: $(grep -A 9 ^circuit status.txt | tr -s ' \n' ' ')" python3 - <<'END'
import glob, json
every = [json.load(open(name)) for name in glob.glob("killed.*.json") + ["status.json"]]
for s in every:
    c = s["circuit"]
    assert s["backend"] == "fpga" and c["fallbacks"] > 0, c
    assert ("no_fpga" in s["degraded"]) == (c["state"] != "in_step"), (s["degraded"], c)
    assert (sum(c["because"].values()) > 0) == (c["last_loss"] != "none"), c
killed, end = every[:-1], every[-1]["circuit"]
errors = [(s["current_errors"], s["last_errors"], s["circuit"]["state"]) for s in killed]
assert all("offload_fault" in current + last and state != "in_step" for current, last, state in errors), errors
assert end["timeouts"] + end["because"]["removed"] > 0, end
assert 0 < end["rtt_us"]["p50"] <= end["rtt_us"]["p99"] <= 1.2 * end["rtt_us"]["max"], end
END
expect 'a circuit steps the object' 2 ctl set material.k1=30000
get_in_step
kill -INT $server
check "kneadd stopped" wait $server
grep "on the circuit\|circuit's answers" kneadd.err
on=$(sed -n 's/^kneadd: \([0-9]*\) ticks on the circuit.*/\1/p' kneadd.err)
lost=$(number lost kneadd.err)
check "at least 2000 ticks ran on the circuit" [ "$on" -ge 2000 ]
check "the circuit was lost at least once per kill" [ "$lost" -ge "$kills" ] 
check "kneadd reports the reason of the loss: $(grep -m1 'circuit lost' kneadd.err)" grep -q 'circuit lost, .* so far: \(removed\|timeout\): ' kneadd.err
check "the circuit's results always equalled the twin's" grep -q 'different 0,' kneadd.err
check "the circuit's state equals the twin's at the end" grep -q "its state equals the twin's" kneadd.err
check "the forces equal those of a run without a circuit" verifies press.lcmlog
kill_board

knead replay press.lcmlog --hash >twin.txt
for way in "--uart --link $PWD/board" "--bar knead-test-$$"; do
    read -ra options <<<"$way"
    uri=pty:$PWD/board
    [ "${options[0]}" = --uart ] || uri=shm:knead-test-$$
    board "${options[@]}"
    knead replay press.lcmlog --backend "$uri" --hash >circuit.txt
    status=$?
    check "a replay by ${options[0]} runs on the circuit: $(grep circuit circuit.txt)" [ $status = 0 ]
    check "every tick of the replay runs on the circuit" grep -qE '^circuit: ([0-9]+) of \1 ticks' circuit.txt
    check "the hash of forces and state equals the twin's" [ "$(hash_of circuit.txt)" = "$(hash_of twin.txt)" ]
    kill_board
done
rm -f "/dev/shm/knead-test-$$"

# Start one replay after the other until the board has been killed often enough.
kill=0 replay= differ=0 runs=0 losses=0 back=0
end_replay() {
    wait "$replay"
    losses=$((losses + $(grep -oE 'lost [0-9]+' killed.txt | grep -oE '[0-9]+' || echo 0)))
    ! grep -q "its final state equals the twin's" killed.txt || back=$((back + 1))
    [ "$(hash_of killed.txt)" = "$(hash_of twin.txt)" ] || differ=$((differ + 1))
    runs=$((runs + 1))
}
board --uart --link "$PWD/board"
while [ $kill -lt "$replay_kills" ]; do
    [ -n "$replay" ] && kill -0 "$replay" 2>/dev/null || {
        [ -z "$replay" ] || end_replay
        knead replay press.lcmlog --backend "pty:$PWD/board" --hash >killed.txt & replay=$!
        pause 0.3
    }
    pause "0.$((100 + RANDOM % 300))"
    kill -0 "$replay" 2>/dev/null || continue # that replay would not have met the kill
    kill_board
    kill=$((kill + 1))
    board --uart --link "$PWD/board"
done
end_replay
grep circuit killed.txt
check "killing the circuit $kill times in $runs replays changes no bit" [ $differ = 0 ]
check "at least 80 % of the kills were noticed as losses: $losses" [ $((10 * losses)) -ge $((8 * kill)) ] # a kill may come before it is in step again
check "the circuit was in step at the end of at least half of the replays: $back" [ $((2 * back)) -ge $runs ]
kill_board
start_kneadd dough-small.yaml --backend fixed --set solver.passes=1 --set solver.iterations=3
kill -INT $server
wait $server
check "a solver that converges too slowly is reported: $(grep accurate kneadd.log)" grep -qE 'not accurate: 1 passes of 3 iterations leave [0-9.]+ % of the force' kneadd.log
expect "$PWD/nothing: No such file or directory" 3 knead replay press.lcmlog --backend "pty:$PWD/nothing"
expect 'fixed has no inertia: needs a bonded or a frictionless support$' 2 kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --set support=none --backend fixed
exit $failed
