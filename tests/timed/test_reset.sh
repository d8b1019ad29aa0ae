#!/usr/bin/env bash
# A reset every 12 ms under a hand in the air costs no ticks in comparison with as many requests that change nothing.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
hold() { # hold COMMAND LOG: sets lost, the ticks that were late or missed
    start_logger "$2"
    start_kneadd dough-small.yaml --control control
    $ahead send plate >/dev/null <<<"poses 4000 session=7 seq=1" &
    hand=$!
    python3 -c '
import socket, sys, time
s = socket.socket(socket.AF_UNIX); s.connect("control")
for _ in range(250):
    s.sendall(sys.argv[1].encode()); time.sleep(0.012); s.recv(65536)' "{\"command\":\"$1\"}
"
    wait $hand
    stop_kneadd
    stop_logger
    lost=$(($(counter missed) + $(counter overruns)))
}
hold status quiet.lcmlog && quiet=$lost
hold reset often.lcmlog && often=$lost
logcheck often.lcmlog | tee often.txt
check "$(number resets often.txt) resets under a hand, each of the untouched object" \
    [ "$(number resets often.txt)" -ge 200 -a "$(number as_new often.txt)" = "$(number resets often.txt)" ]
check "cost no ticks: $often late or missed, $quiet without" [ $often -le $((quiet + 40)) ]
check "that log replays to the bit, too" knead replay often.lcmlog --verify
exit $failed
