#!/usr/bin/env bash
# knead ctl: a reset restores the new object, also under a hand. An emergency stop ends the hand's force until a
# recover, also across a load. status reports the state. The log of all this replays. Wrong requests give one line and
# do no harm.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
lines() { python3 -c '
import socket, sys
s = socket.socket(socket.AF_UNIX); s.connect("control")
s.sendall(sys.argv[1].encode()); s.shutdown(socket.SHUT_WR)
while got := s.recv(65536): sys.stdout.write(got.decode())' "$1"; }
end() { stop_kneadd; stop_logger; } # ends the log too
press() { $ahead knead probe --path path.csv --quiet "$@" >/dev/null 2>hand.err & hand=$!; }

expect 'knead ctl: control: No such file or directory: is kneadd running' 3 ctl status
expect '--control 0*: expected a path of 1 to 107 bytes' 2 \
    kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --control "$(printf '%0108d' 0)"
touch file
expect '--control file: exists and is not a socket' 3 \
    kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --control file

# A finger presses, holds while the dough under it is reset, lifts and presses again. Then an emergency stop and a
# recover.
printf '%s\n' time_s,x_m,y_m,z_m 0,0,0,0.06 0.8,0,0,0.045 1,0,0,0.041 4,0,0,0.041 4.5,0,0,0.06 \
    5.5,0,0,0.06 6.3,0,0,0.045 6.5,0,0,0.041 7,0,0,0.041 7.5,0,0,0.06 >path.csv
start_logger reset.lcmlog
start_kneadd dough-small.yaml --control control
$ahead knead probe --path poke --quiet >/dev/null
ctl reset >reset.out # over the dent, without a hand
press
pressing
lines '{"command":"reset"}
{"command":"reset"}
{"command":"reset"}
' >answers
wait $hand
told=$?
end
check "the finger finished its press: $(cat hand.err)" [ $told = 0 ]
logcheck reset.lcmlog | tee reset.txt
check "a reset is answered with its tick: $(cat reset.out)" grep -qE '^reset: tick [0-9]+$' reset.out
check "three resets in one write get three answers" [ "$(grep -c '^{"ok":true,"tick":[0-9]*}$' answers)" = 3 ]
check "the log has four resets" [ "$(number resets reset.txt)" = 4 ]
check "after each reset the state is that of the untouched object" [ "$(number as_new reset.txt)" = 4 ]
check "the force on the finger fades by at most 2.4 N/ms" holds "$(number steepest_n reset.txt) <= 2.4"
check "the force is zero within 20 ms" holds "$(number faded_n reset.txt) <= 0"
check "after lifting, the finger feels the new dough" holds "$(number again_n reset.txt) >= 0.3"
check "the log replays over the resets to the bit" verifies reset.lcmlog
check "each reset is logged once with its user" \
    [ "$(grep -c '^kneadd: control: uid [0-9]* pid [0-9]*: {"command":"reset"}: tick [0-9]*$' kneadd.err)" = 4 ]
check "kneadd prints nothing else" [ "$(grep -vc -e '^kneadd: control' -e '^Overrun' kneadd.err)" = 0 ]
check "the control socket is removed" [ ! -e control ]

# An emergency stop under a finger, another hand that comes, a recover.
start_logger stop.lcmlog
start_kneadd dough-small.yaml --control control
press --tries 1
pressing
ctl estop >estop.out
sleep 0.1
field '["mode"], "after"' >mode
field '["probes"]' >probes
wait $hand 2>/dev/null
knead probe --path poke --tries 1 --quiet >/dev/null 2>second.err
field '["mode"], "later"' >>mode
ctl recover >recover.out
$ahead knead probe --path poke --quiet >/dev/null 2>third.err
status=$?
check "after a recover a hand presses: $(cat third.err)" [ $status = 0 ]
pause 0.2 # the session ends
field '["mode"], "recovered"' >>mode
ctl --json status >stopped.json
end
check "an emergency stop is shown as a mode: $(tr '\n' ' ' <mode)" \
    [ "$(grep -c '^ESTOP \(after\|later\)$' mode)" = 2 ]
check "a recover ends the mode of the emergency stop" grep -q '^IDLE recovered$' mode
check "the status shows the fault and the remedy" grep -q "'fault': 'emergency stop'.*'way_back': \"\?'\?send recover" probes
check "a hand gets no force during the emergency stop" grep -q 'taken to 0 N\|latched' second.err
check "the log replays over stop and recover to the bit" verifies stop.lcmlog
logcheck stop.lcmlog >stop.txt
check "the emergency stop is counted by name, and its fade as slew-limited ticks: $(tail -1 stop.txt)" \
    [ "$(number estops stop.txt)" -ge 1 -a "$(number slews stop.txt)" -ge 10 ]
check "the status has the same counts" python3 -c '
import json
f = json.load(open("stopped.json"))["force"]
assert f["trips"]["estop"] >= 1 and f["slew_limited"] >= 10 and f["faults"] == sum(f["trips"].values()), f'

# An emergency stop stays in force when a scene is loaded. So does a stop that is ordered during the load.
served() { grep -c '^kneadd: serving' kneadd.log; }
mode() { field '["mode"]'; }
start_kneadd dough-small.yaml --control control
ctl estop >/dev/null
ctl load >load.out
held=$(mode)
knead probe --path poke --tries 1 --quiet >/dev/null 2>held.err
ctl --json status >held.json
check "an emergency stop stays in force after a load: $held, $(cat load.out)" [ "$held $(served)" = "ESTOP 2" ]
check "no hand gets a force" python3 -c '
import json
s = json.load(open("held.json"))
assert s["force"]["force_max_n"] == 0 and all(p["fault"] == "emergency stop" for p in s["probes"]), s'
check "the start reports the emergency stop" [ "$(grep -c '^kneadd: an emergency stop is in force: .* until knead ctl recover$' kneadd.log)" = 1 ]
ctl recover >/dev/null
ctl load >load.out
check "a recover ends the emergency stop: $(mode)" [ "$(mode) $(served)" = "IDLE 3" ]
for starts in 4 ${KN_NIGHT:+5 6}; do
    lines '{"command":"load"}
{"command":"estop"}
' >answers
    await eval '[ "$(served)" = $starts ]'
    check "an emergency stop sent during a load is answered and stays in force after it: $(tail -1 answers)" \
        [ "$(grep -c '^{"ok":true' answers) $(mode)" = "2 ESTOP" ]
    ctl recover >/dev/null
done
stop_kneadd >/dev/null

# Wrong requests while the server runs.
start_kneadd dough-small.yaml --control control
expect 'no command: expected status, reset' 2 ctl
expect "command 'restet': expected one of status, reset," 2 ctl restet
expect 'reset: expected nothing else' 2 ctl reset now
expect 'quality: expected "name", a string' 2 ctl quality
expect "quality 'best': expected fast, balanced, accurate or own" 2 ctl quality best
expect 'another server answers there' 3 \
    kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --control control \
    --lcm-url udpm://239.255.76.67:7669?ttl=0 --mesh-url udpm://239.255.76.67:7670?ttl=0
lines 'reset
{"command":"reset","when":"now"}
{"command":7}
[]
'"{\"command\":\"reset\",\"x\":$(printf '%1900s' | tr ' ' '[')$(printf '%1900s' | tr ' ' ']')}
" >answers
check "each invalid line gets one error" [ "$(grep -c '^{"ok":false,"error":' answers)" = 5 ]
ctl --json status >status.json
check "server/README.md lists every name of the status under its group" python3 - "$KN_SOURCE/server/README.md" <<'END'
import json, re, sys
rows = [line for line in open(sys.argv[1]) if line.startswith("| `")]
status = json.load(open("status.json"))
groups = {"": {k: 0 for k, v in status.items() if not isinstance(v, dict) and k not in ("ok", "probes")},
          "probes[]": {**status["probes"][0], **status["probes"][0].pop("packets")}}
groups.update({k: v for k, v in status.items() if isinstance(v, dict)})
for group, names in groups.items():
    told = set()
    for row in rows:
        first, rest = row.split("|")[1], row.split("|")[2]
        head = first.strip(" `").split(".")[0].split("`")[0]
        if group and head != group or not group and "." in first: continue
        told |= set(re.findall(r"[a-z_0-9]+", " ".join(re.findall(r"`([^`]*)`", first if group != "probes[]" else row))))
    missing = set(names) - told
    assert not missing, (group, missing)
for bits in ("degraded", "current_errors"): assert status[bits] == [] or all(isinstance(b, str) for b in status[bits])
END
check "the status text shows the mode: $(ctl status | tr -s ' \n' ' ' | cut -c1-60)" grep -q "^mode  *IDLE$" <(ctl status)
expect 'stop: done' 0 sh -c 'knead ctl --control control stop >&2'
check "knead ctl stop ends kneadd like SIGTERM" ended $server

# A server whose output reader leaves, as head does, goes on.
rm -f first
(env --default-signal=PIPE kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --realtime "$KN_REALTIME" --control control 2>err
    echo $? >code) | head -1 >first &
await [ -s first ]
ctl load >loaded 2>&1
await eval 'ctl status >again 2>/dev/null'
check "a load works although the reader of stdout has gone: $(cat loaded)" grep -q '^scene  *dough-small.yaml' again
ctl stop >/dev/null 2>&1
wait $!
check "at the end kneadd reports the incomplete output: $(tail -1 err)" \
    grep -q 'standard output could not be written completely' err
check "kneadd exits with 3" [ "$(cat code)" = 3 ]

# An emergency stop works however many requests came before on its connection, and whatever they wait for.
start_kneadd dough-small.yaml --control control
python3 -c '
import json, socket, time
s = socket.socket(socket.AF_UNIX); s.connect("control"); f = s.makefile()
refused = 0
while not refused:
    s.sendall(b"{\"command\":\"status\"}\n"); refused = "commands a second" in f.readline()
s.sendall(b"{\"command\":\"estop\"}\n"); print(f.readline(), end="")
s = socket.socket(socket.AF_UNIX); s.connect("control"); f = s.makefile()
s.sendall(b"{\"command\":\"recover\"}\n"); f.readline()
s.sendall(b"{\"command\":\"set\",\"values\":[\"material.c1=5 kPa*s\"]}\n{\"command\":\"estop\"}\n")
print(json.loads(f.readline())["tick"] > json.loads(f.readline())["tick"])
s.sendall(b"{\"command\":\"status\"}"); s.shutdown(socket.SHUT_WR); print(json.loads(f.readline())["mode"])' >answers 2>&1
check "an emergency stop is answered despite a hundred queries before it: $(head -1 answers)" grep -q '^{"ok":true,"tick":[0-9]*}$' answers
check "an emergency stop is executed before a slow command sent ahead of it" grep -qx True answers
check "a query without a newline is answered at the end of the connection" grep -qx ESTOP answers
stop_kneadd >/dev/null

# A server that is ordered to stop stops, whatever other orders it got.
start_kneadd dough-small.yaml --control control
(lines '{"command":"stop"}
'"$(for _ in $(seq 99); do echo '{"command":"undo"}'; done)"'
' >/dev/null 2>&1 &)
patience=6 check "kneadd stops although 99 commands follow the stop" await eval '! kill -0 $server 2>/dev/null'
kill -KILL $server 2>/dev/null
wait $server

exit $failed
