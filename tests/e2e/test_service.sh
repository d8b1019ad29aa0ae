#!/usr/bin/env bash
# kneadd.service: systemd finds no error and little exposure. Run as there, by a user without a capability, kneadd has
# its real-time priority and locked memory. It reports that it serves, and every second that it ticks.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
command -v systemd-analyze >/dev/null || { echo "skipped: no systemd-analyze here (package systemd)" && exit 77; }
sed "s|^ExecStart=[^ ]*|ExecStart=$KN_BUILD/bin/kneadd|; s|^ExecReload=[^ ]*|ExecReload=$KN_BUILD/bin/knead|; /^User=\|^Group=/d" "$KN_BUILD/server/kneadd.service" >kneadd.service
systemd-analyze verify "$PWD/kneadd.service" >verified 2>&1
check "systemd accepts every line of the unit$(sed 's/^/: /' verified)" [ ! -s verified ]
systemd-analyze security --offline=true --no-pager --threshold=20 "$KN_BUILD/server/kneadd.service" >exposure 2>&1
status=$?
check "$(tail -1 exposure | tr -dc '[:print:]')" [ $status = 0 ]

# With the board's drop-in, appended to the unit as systemd does. By default no device is opened.
check "the unit allows no device node by default" [ "$(grep -c '^DeviceAllow\|^PrivateDevices=no' kneadd.service)" = 0 ]
mkdir board
cat kneadd.service "$KN_SOURCE/server/kneadd-board.conf" >board/kneadd.service
systemd-analyze verify "$PWD/board/kneadd.service" >verified 2>&1
check "systemd accepts every line of the unit with a board$(sed 's/^/: /' verified)" [ ! -s verified ]
cat "$KN_BUILD/server/kneadd.service" "$KN_SOURCE/server/kneadd-board.conf" >board/kneadd.service
systemd-analyze security --offline=true --no-pager --threshold=20 "$PWD/board/kneadd.service" >exposure 2>&1
status=$?
check "with a board: $(tail -1 exposure | tr -dc '[:print:]')" [ $status = 0 ]
check "the unit with a board allows one serial line only" grep -q 'DeviceAllow=.*ttyUSB0' "$KN_SOURCE/server/kneadd-board.conf"

[ "$KN_REALTIME" != off ] && command -v setpriv >/dev/null || { echo "no user to become here: the rest is left out" && exit $failed; }
cat >listen.py <<'END' # receives systemd's notifications
import os, socket, sys, time
s = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
s.bind("notify")
os.chmod("notify", 0o777)
while True:
    print(time.monotonic(), s.recv(4096).decode().replace("\n", " "), flush=True)
END
heard() { grep -c "$1" notified; }
chmod 777 .
/usr/bin/python3 listen.py >notified &
until [ "$(stat -c %a notify 2>/dev/null)" = 777 ]; do pause 0.02; done
for scene in dough-small jelly; do cp "$KN_SOURCE/core/scenes/$scene.yaml" . && chmod 644 $scene.yaml; done
cp "$KN_BUILD/bin/kneadd" "$KN_BUILD/bin/knead" . # other users may not see the build folder
limits="prlimit --rtprio=80 --memlock=unlimited" mode=require
if ! $limits true 2>/dev/null; then
    echo "this root may not raise limits (no CAP_SYS_RESOURCE): what they grant is left out"
    limits= mode=off
fi
# Another user has already taken every guessable name of a claim.
setpriv --reuid 1234 --clear-groups mkdir -m 777 /tmp/kneadd-000000
setpriv --reuid 1234 --clear-groups /usr/bin/python3 -c \
    'import socket, time; s = socket.socket(socket.AF_UNIX, 2); s.bind("\0kneadd 239.255.76.67:7667"); time.sleep(600)' &
NOTIFY_SOCKET=$PWD/notify $limits setpriv --reuid 65534 --regid 65534 --clear-groups \
    --no-new-privs --bounding-set=-all --inh-caps=-all --ambient-caps=-all \
    ./kneadd dough-small.yaml --control "$PWD/control" --realtime $mode >kneadd.log 2>kneadd.err &
server=$!
await eval '[ "$(heard READY=1)" -gt 0 ]'
check "kneadd notifies systemd when it serves" [ "$(heard 'READY=1 STATUS=serving dough-small.yaml')" = 1 ]
[ $mode = off ] || check "kneadd has real-time scheduling and locked memory: $(cat kneadd.err)" grep -q 'SCHED_FIFO, memory locked' kneadd.log
check "kneadd has no capability" [ "$(sed -n 's/^CapEff:\s*//p' /proc/$server/status)" = 0000000000000000 ]
expect "^kneadd: another kneadd serves udpm://239.255.76.67:7667[?]ttl=0: expected --lcm-url with another port$" 3 \
    setpriv --reuid 65534 --regid 65534 --clear-groups ./kneadd dough-small.yaml --realtime off
check "the lock file is in a directory closed to others" \
    [ "$(find /tmp/kneadd-?????? -maxdepth 0 -uid 65534 -perm 0700 | wc -l)$(ls -A /tmp/kneadd-000000)" = 1 ]
alive() { # alive N: wait for N more watchdog messages
    local since
    since=$(heard WATCHDOG=1)
    await eval '[ "$(heard WATCHDOG=1)" -ge $((since + '"$1"')) ]'
}
check "kneadd keeps notifying the watchdog" alive 2
kill -STOP $server
pause 0.2
before=$(heard WATCHDOG=1)
pause 2.5
check "a stopped server does not notify the watchdog" [ "$(heard WATCHDOG=1)" -le $((before + 1)) ]
kill -CONT $server
check "a continued server notifies the watchdog again" alive 2
for thread in servo kneadd; do # stop each thread alone, while the thread that feeds the watchdog goes on
    freeze $server $thread 4.2 2>froze & frozen=$!
    pause 1.6 # the main thread is missed only after half a second of records
    before=$(heard WATCHDOG=1)
    pause 2.4
    during=$(($(heard WATCHDOG=1) - before))
    wait $frozen
    [ $? = 77 ] && echo "no thread can be stopped here: $(cat froze)" && continue
    check "a server whose thread $thread is stuck does not notify: $during times in 2 s" [ $during = 0 ]
    check "after the thread $thread continues, the server notifies again" alive 1
done
./knead ctl --control control --json status >status.json
check "root may send commands" grep -q '^{"ok":true,' status.json
setpriv --reuid 1234 --regid 65534 --clear-groups ./knead ctl --control control reset >group 2>&1
check "the group may send commands: $(cat group)" grep -q '^reset: tick' group
setpriv --reuid 1234 --regid 1234 --clear-groups ./knead ctl --control control reset >other 2>&1
refused=$?
check "no other user may send commands: $(cat other)" [ $refused = 3 ]
./knead ctl --control control load >loaded 2>&1
check "systemd is notified of a load and of its end: $(cat loaded)" \
    [ "$(heard 'RELOADING=1 MONOTONIC_USEC=[0-9]')" = 1 -a "$(heard 'READY=1 STATUS=serving dough-small.yaml')" = 2 ]
[ $mode = off ] || check "kneadd has real-time scheduling again after the load" [ "$(grep -c 'SCHED_FIFO, memory locked' kneadd.log)" = 2 ]
setpriv --reuid 1234 --regid 1234 --groups 65534 ./knead ctl --control control stop >stop 2>&1
check "a user with the group as a supplementary group may stop kneadd: $(cat stop)" grep -q '^stop: done' stop
check "kneadd ended with 0" ended $server
check "kneadd notified systemd of the stop" [ "$(heard STOPPING=1)" = 1 ]
find /tmp/kneadd-?????? -maxdepth 0 \( -uid 65534 -o -uid 1234 \) -exec rm -r {} +

# stdout and stderr are full, and no process reads them.
mkfifo full
exec 7<>full
NOTIFY_SOCKET=$PWD/notify ./kneadd dough-small.yaml --control control --realtime "$KN_REALTIME" >full 2>&1 &
server=$!
await eval './knead ctl --control control status >/dev/null 2>&1'
python3 -c 'import os
fd = os.open("full", os.O_WRONLY | os.O_NONBLOCK)
for size in 1024, 1:
    try:
        while True: os.write(fd, b"x" * size)
    except BlockingIOError: pass'
kill -STOP $server
pause 0.05
kill -CONT $server # overruns to be reported
for _ in 1 2 3; do timeout 5 ./knead ctl --control control reset >/dev/null; done
timeout 5 ./knead ctl --control control estop >stopped 2>&1
check "with full output pipes an emergency stop is answered at once: $(cat stopped)" grep -q '^estop: tick' stopped
check "with full output pipes kneadd keeps notifying the watchdog" alive 2
timeout 20 ./knead ctl --control control load >loaded 2>&1
await eval 'timeout 5 ./knead ctl --control control status >again 2>/dev/null'
check "with full output pipes a scene is loaded: $(cat loaded)" grep -q '^scene  *dough-small.yaml' again
kill -TERM $server
patience=4 check "with full output pipes kneadd ends on SIGTERM" await eval '! kill -0 $server 2>/dev/null'
kill -KILL $server 2>/dev/null
wait $server
ended=$?
check "kneadd exits with 3, since nobody read its summary" [ $ended = 3 ]
exec 7>&-
exit $failed
