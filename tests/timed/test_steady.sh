#!/usr/bin/env bash
# steady, the judge of the tests that keep a millisecond's time: a fault fails under any load; a test that fails while
# the machine stands still is skipped and says why.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh" # check

program() { cat >"$1" && chmod +x "$1"; }
# is CODE OPTION... COMMAND: steady ends with CODE; its output is in out
is() {
    steady "${@:2}" >out 2>&1
    [ $? = "$1" ] || { cat out; return 1; }
}
said() { grep -qE "$1" out || { cat out; return 1; }; }
ended() { ! grep -qs '^State:.[^ZX]' "/proc/$1/status"; } # a zombie has ended

program fails <<'SH'
#!/bin/sh
echo "the reason"
exit ${1:-1}
SH
program stands <<'SH' # stops its world for 30 ms: itself and its witnesses
#!/bin/sh
setsid --wait sh -c "kill -STOP -$$ $PPID; sleep 0.03; kill -CONT -$$ $PPID"
exit $1
SH
program hangs <<'SH'
#!/bin/sh
sleep 60 &
echo $! >left
wait
SH

check "what passes passes" is 0 true
check "what is wrong fails" is 1 ./fails
check "it is seen why" said '^the reason$'
check "and that the machine ran" said '^steady: exit 1 after .* s; 0 standstills of 10 ms or more, the longest'
for code in 2 3 77; do check "exit $code is passed on" is $code ./fails $code; done
check "so is a crash" is 139 sh -c 'kill -SEGV $$'
check "and a program that is not there" is 127 ./nothing
check "what hangs is ended, and fails" is 1 --timeout 0.5 ./hangs
check "with all that it started" ended "$(cat left)"
check "what fails while its world stands still is skipped" is 77 ./stands 1
check "and says why" said '^skipped: the machine stood still while it failed: [1-9] standstills of 10 ms or more, the longest [3-9]'
check "what passes then passes" is 0 ./stands 0
check "what crashes then has crashed" is 3 ./stands 3
for wrong in "" "--timeout soon true" "--timeout 1" "--attempts 2 true"; do
    check "'steady $wrong' is refused" is 2 $wrong
    check "in one line" [ "$(wc -l <out)" = 1 ]
done

if [ "$KN_REALTIME" != off ] && chrt -f 99 true 2>/dev/null; then
    # ahead of everything, on one of our processors, for longer than the kernel allows
    program spins <<'SH'
#!/bin/sh
timeout 1.5 taskset -c "$(taskset -cp $$ | sed 's/.*[ ,-]//')" chrt -f 99 sh -c 'while :; do :; done'
exec ./fails
SH
    check "a test's own load is no standstill" is 1 ./spins
else
    echo "no SCHED_FIFO here: a load ahead of the witnesses is not tested"
fi

rm left
steady ./hangs >/dev/null 2>&1 &
judge=$!
until [ -s left ]; do sleep 0.05; done
kill -TERM $judge
wait $judge
check "who ends it ends the test" [ $? = 143 ]
check "and what that started" ended "$(cat left)"
exit $failed
