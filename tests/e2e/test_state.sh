#!/usr/bin/env bash
# A kneaded object can be saved, restored and undone by knead ctl. An emergency stop outlives the process. The log of
# all this replays to the bit with the snapshots. A refused restore names its reason.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
dent() { # dent DEPTH: press in a session of its own
    printf '%s\n' time_s,x_m,y_m,z_m 0,0,0,0.06 0.8,0,0,0.045 1,0,0,"$1" 1.5,0,0,"$1" 2,0,0,0.06 >path.csv
    $ahead knead probe --probe finger --path path.csv --quiet >/dev/null || { echo "FAIL a finger presses" && failed=1; }
}
state() { sed -n 's/.*"state":"\([0-9a-f]*\)".*/\1/p' <<<"$1"; }
generation() { sed -n 's/.*"generation":\([0-9]*\).*/\1/p' <<<"$1"; }
mkdir kept
expect '^--state-dir kept: Read-only file system, expected a directory that can be written to$' 2 unshare -m bash -c \
    "mount -t tmpfs -o ro none kept && exec kneadd $KN_SOURCE/core/scenes/dough-small.yaml --state-dir kept"
start_logger state.lcmlog
start_kneadd dough-small.yaml --control control --state-dir kept
dent 0.042
first=$(ctl --json snapshot)
dent 0.039
second=$(ctl --json snapshot)
restored=$(state "$(ctl --json restore "$(generation "$first")")")
pause 0.3
newest=$(ctl restore "$(generation "$second")")
dent 0.041
undone=$(ctl undo)
again=$(ctl undo)
pause 0.3
stop_kneadd
stop_logger
knead replay state.lcmlog --snapshot kept --verify >said 2>err
check "the requested snapshots are kept as read-only files: $(find kept -name '*.knead' ! -perm -200 | wc -l)" [ "$(find kept -name '*.knead' ! -perm -200 | wc -l)" = 2 ]
check "the finger felt the dough" grep -qE "peak contact force ([1-9]|0\.[1-9])" said
check "two dents are two different states: $first $second" [ -n "$(state "$first")" -a "$(state "$first")" != "$(state "$second")" ]
check "the first state was restored" [ "$restored" = "$(state "$first")" ]
check "the newest state was restored: $newest" grep -q '^restore: snapshot 2, tick' <<<"$newest"
check "the third press was undone: $undone" grep -q '^undo: tick' <<<"$undone"
check "the restore was undone after the press: $again" grep -q '^undo: tick' <<<"$again"
check "with the snapshots the log replays over presses, restores and undos: $(tail -1 said)" [ -s said -a ! -s err ]
expect 'snapshot' 2 knead replay state.lcmlog --verify
# A log that begins after a press, and undoes that press.
mkdir late
start_kneadd dough-small.yaml --control control --state-dir late
dent 0.042
start_logger late.lcmlog
sleep 1.5 # time for a checkpoint in the log, so that the snapshot belongs to its run
ctl snapshot >/dev/null
ctl undo >/dev/null
dent 0.041
stop_kneadd
stop_logger
knead replay late.lcmlog --snapshot late --verify >out 2>&1
late=$?
check "an undo of a change before the log is not counted as a replay error: $(grep undo out)" \
    [ $late = 1 -a "$(grep -c 'an undo to a state before this log begins' out)" -ge 1 ]
# An emergency stop survives a kill and a restart, also in the log of that run. A recover ends the stop for good.
mkdir held
start_kneadd dough-small.yaml --control control --state-dir held
ctl estop >said
kill -KILL $server
wait $server 2>/dev/null
start_logger held.lcmlog
start_kneadd dough-small.yaml --control control --state-dir held
held=$(field '["mode"]')
told=$(grep '^kneadd: an emergency stop is in force' kneadd.log)
knead probe --path poke --tries 1 --quiet >/dev/null 2>held.err
felt=$(field '["force"]["force_max_n"]')
freed=$(ctl recover)
dent 0.041
stop_kneadd >/dev/null
stop_logger
knead replay held.lcmlog --verify >out 2>err
check "an emergency stop stays in force after a kill: $held, $told" [ "$held" = ESTOP -a "$(wc -l <<<"$told")" = 1 -a -n "$told" ]
check "a hand gets no force: $felt N, $(head -1 held.err)" [ "$felt" = 0.0 ]
check "after a recover the hand feels the dough: $freed" grep -qE 'peak contact force ([1-9]|0\.[1-9])' out
check "the log of that start replays: $(cat err)" [ -s out -a ! -s err ]
start_kneadd dough-small.yaml --control control --state-dir held
free=$(field '["mode"]')
check "the next start has no emergency stop: $free" [ "$free" = IDLE -a ! -e held/estop ]
stop_kneadd

start_kneadd jelly.yaml --control control --state-dir kept
expect 'restore: ' 2 ctl restore
expect 'undo: nothing to undo' 2 ctl undo
expect 'restore: expected "generation", a whole number' 2 ctl restore first
expect 'restore: generation 0: expected 1 or more' 2 ctl restore 0
stop_kneadd
start_kneadd dough-small.yaml --control control
expect 'expected kneadd --state-dir DIR' 2 ctl snapshot
expect 'expected kneadd --state-dir DIR' 2 ctl restore
stop_kneadd
exit $failed
