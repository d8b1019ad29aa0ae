#!/usr/bin/env bash
# The threads of a running kneadd as the kernel sees them: their priorities, their core, and no page faults of the
# servo.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
KN_REALTIME=auto # also where netns expects a refusal, since the message of a refusal is tested too
start_kneadd dough-small.yaml
cat kneadd.log
thread() { grep -l "^$1\$" "/proc/$server/task/"*/comm | head -1 | xargs -r dirname; }
# Fields of proc(5) stat, counted after the name: 8 minor faults, 10 major faults, 37 processor, 38 real-time
# priority, 39 policy (1 FIFO).
field() { sed 's/.*) //' "$(thread "$1")/stat" | cut -d' ' -f"$2"; }

if grep -q '; SCHED_FIFO' kneadd.log; then
    for pair in servo:80 sentinel:79 kneadd:70; do
        name=${pair%:*}
        check "$name has FIFO ${pair#*:}" [ "$(field "$name" 39) $(field "$name" 38)" = "1 ${pair#*:}" ]
    done
else
    check "the missing real-time setting is reported" grep -q 'not real time: no SCHED_FIFO (.*: .*)' kneadd.log
fi
check "the mesh thread has no real-time priority" [ "$(field mesh 39)" = 0 ]
check "the sentinel runs on the servo's core" [ "$(field sentinel 37)" = "$(field servo 37)" ]

if grep -q ', memory locked' kneadd.log; then
    send plate <<<"poses 300 session=7 seq=1" >/dev/null
    before="$(field servo 8) $(field servo 10)"
    send plate <<<"poses 3000 session=7 seq=301" >/dev/null
    check "3000 ticks of a session cause no page fault" [ "$(field servo 8) $(field servo 10)" = "$before" ]
fi
stop_kneadd

# two threads step: the helper's priority and core, a press that replays with one, and settings that belong to the start
start_kneadd dough.yaml --threads 2 --control "$PWD/control"
if [ "$(nproc)" = 1 ]; then
    check "a single core is told" grep -q '^kneadd: one thread steps the object, not two: only one processor$' kneadd.log
else
    check "two threads step the object, or a second processor that brings nothing is told" grep -qE \
        '^kneadd: (two threads step the object|one thread steps the object, not two: a strike took .* with one)$' kneadd.log
    if grep -q '^kneadd: two threads' kneadd.log; then
        check "the helper runs on another core" [ "$(field helper 37)" != "$(field servo 37)" ]
        ! grep -q '; SCHED_FIFO' kneadd.log || check "the helper has FIFO 60" [ "$(field helper 39) $(field helper 38)" = "1 60" ]
    fi
fi
$ahead knead probe --path poke --record two.lcmlog --quiet >/dev/null 2>probe.err
check "a press with two threads replays with one to the bit" verifies two.lcmlog
expect 'another solver.threads' 2 knead ctl --control "$PWD/control" set solver.threads=1
stop_kneadd
start_kneadd dough-small.yaml --threads 2
check "a small object has one thread" grep -q '^kneadd: one thread steps the object, not two: .*too small' kneadd.log
stop_kneadd

expect '--realtime sometimes: expected auto, require or off' 2 kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --realtime sometimes
if ! grep -q '; SCHED_FIFO' kneadd.log; then
    expect 'not real time: ' 3 kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --realtime require
fi
exit $failed
