#!/usr/bin/env bash
# kneadd --state-dir under a hand that presses for ten seconds (KN_SECONDS=600 for ten minutes), in real time. Its
# memory does not grow, no number becomes invalid, and its counters add up.
# night: server.soak has the same counters in virtual time
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
seconds=${KN_SECONDS:-10}
mkdir state
start_kneadd dough-small.yaml --state-dir state --control control
kneader finger &
hand=$!
for ((tenth = 1; tenth <= 10; tenth++)); do
    sleep "$(awk "BEGIN { print $seconds / 10 }")"
    [ $tenth = 2 ] && early=$(memory) # it has pressed once, and saved
    echo "$((tenth * seconds / 10)) s: $(memory) kB, $(ctl --json status |
        grep -oE '"(tick|missed_cycles|missed_explained|num_overruns|received|accepted|solver_capped|snapshot_errors)":[0-9]+' | tr '\n' ' ')"
done
late=$(memory)
kill $hand
stop_kneadd
check "the memory of kneadd grows by less than 1 MB: $early to $late kB" [ $((late - early)) -lt 1000 ]
counted=0
for number in $(grep -oP 'datagrams: \K.*(?=;)' kneadd.log | grep -oE '[0-9]+'); do ((counted += number)); done
check "every datagram is in one counter" [ "$(grep -oP '[0-9]+(?= datagrams:)' kneadd.log)" = $counted ]
check "every ms is a tick or a missed tick: $(counter ticks) + $(counter missed) in $seconds s" \
    [ $(($(counter ticks) + $(counter missed))) -ge $((1000 * seconds)) ]
check "no energy was created and no save failed" \
    grep -q 'energy created in 0 of them' kneadd.log
check "no snapshot failed" grep -qE 'snapshots saved, .*; 0 saves failed' kneadd.log
exit $failed
