#!/usr/bin/env bash
# steady, the judge of all tests that keep a millisecond's time: what is wrong fails, whatever load it is; what fails only while its
# world stands still is skipped, and says why.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh" # check

program() { cat >"$1" && chmod +x "$1"; }
# is CODE ATTEMPTS OPTION... COMMAND: of steady, whose words are in out; each attempt of the programs below is a line in attempts
is() {
    : >attempts
    steady --calm 0.1 "${@:3}" >out 2>&1
    [ "$? $(wc -l <attempts)" = "$1 $2" ] || { cat out; return 1; }
}
said() { grep -qE "$1" out || { cat out; return 1; }; }

ended() { ! grep -qs '^State:.[^ZX]' "/proc/$1/status"; } # a zombie has ended

program fails <<'SH'
#!/bin/sh
echo once >>attempts
echo "the reason of $(wc -l <attempts)"
exit ${1:-1}
SH
# stands LIST: fails, and in the attempts of LIST its world does not run for 30 ms: itself, its witnesses
program stands <<'SH'
#!/bin/sh
./fails >/dev/null
case $1 in *$(wc -l <attempts)*)
    setsid --wait sh -c "kill -STOP -$$ $PPID; sleep 0.03; kill -CONT -$$ $PPID" ;;
esac
exit 1
SH
program stands_often <<'SH'
#!/bin/sh
./fails >/dev/null
setsid --wait sh -c "for i in 1 2 3 4 5 6 7 8 9 10 11; do kill -STOP -$$ $PPID; sleep 0.02; kill -CONT -$$ $PPID; sleep 0.01; done"
exit 1
SH
program passes_second <<'SH'
#!/bin/sh
./fails && exit
[ $(wc -l <attempts) = 2 ]
SH
program hangs <<'SH'
#!/bin/sh
echo once >>attempts
sleep 60 &
echo $! >left
wait
SH

check "what passes is run once" is 0 0 true
check "what is wrong fails, after another chance" is 1 2 ./fails
check "each time it is seen why" eval 'said "^the reason of 1$" && said "^the reason of 2$"'
check "and that the machine ran" said '^steady: attempt 2 of 2: exit 1 after .* s; 0 standstills of 10 ms or more, the longest'
check "what passes the second time passes" is 0 2 ./passes_second
for code in 2 3 77; do check "exit $code is final" is $code 1 ./fails $code; done
check "so is a crash" is 139 0 sh -c 'kill -SEGV $$'
check "and a program that is not there" is 127 0 ./nothing
check "what hangs is ended, and fails" is 1 1 --timeout 0.5 ./hangs
check "with all that it started" ended "$(cat left)"

check "what fails only while its world stands still is skipped" is 77 2 ./stands 12
check "and says why" said '^skipped: the machine stood still in each of 2 failed attempts: [2-9] standstills of 10 ms or more, the longest [3-9]'
check "one failure without that is a failure" is 1 2 ./stands 2
check "also among more attempts" is 1 3 --attempts 3 ./stands 13
check "of which two are enough" is 1 2 --attempts 3 ./stands 3

check "a machine that stands still all the time gets no other attempt" is 77 1 ./stands_often

export KN_UNTIL=$(($(date +%s) + 1))
check "when the time for all is over, a standstill is no reason for another attempt" is 77 1 sh -c 'sleep 1.2; exec ./stands 12'
check "and no other test begins" is 77 0 ./fails
check "which it says" said '^skipped: no time was left, KN_UNTIL is over$'
export KN_UNTIL=$(($(date +%s) + 60))
check "before, all do" is 1 2 ./fails
export KN_UNTIL=soon
check "a time that is none is refused" is 2 0 ./fails
check "in one line" said '^steady: soon: expected KN_UNTIL: seconds since 1970$'
unset KN_UNTIL

if [ "$KN_REALTIME" != off ] && chrt -f 99 true 2>/dev/null; then
    # ahead of everything, on a processor of ours, for longer than the kernel allows
    program spins <<'SH'
#!/bin/sh
timeout 1.5 taskset -c "$(taskset -cp $$ | sed 's/.*[ ,-]//')" chrt -f 99 sh -c 'while :; do :; done'
exec ./fails
SH
    check "a test's own load is no standstill" is 1 2 ./spins
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
