#!/usr/bin/env bash
# Malformed datagrams, as fast as the bus takes them and at 25 kHz, while a hand sends its poses at 1 kHz. The daemon
# survives, every datagram is in one counter, and the hand is heard. KN_DATAGRAMS=1000000: number of each kind (here
# 100000). A stopped daemon gets more datagrams than its socket holds, and reports the number dropped by the kernel.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
count=${KN_DATAGRAMS:-100000}
now_ms() { date +%s%3N; }
of_all() { # of_all REASON...: print the sum of these counters
    local sum=0 name
    for name; do sum=$((sum + $(counter "$name"))); done
    echo $sum
}
flood() { # flood NAME RATE
    start_kneadd dough-small.yaml
    send plate >valid <<<"poses 100000000 session=7 seq=1" &
    local hand=$! from
    sleep 0.5 # the hand owns its probe before the flood comes
    before=$(memory)
    from=$(now_ms)
    flood=$(send plate <<<"flood $count seed=1 rate=$2")
    took=$(($(now_ms) - from))
    after=$(memory)
    sleep 0.2
    kill -TERM $hand # the hand must outlast the flood: a free probe would accept the next valid datagram
    wait $hand
    stop_kneadd
    valid=$(cat valid)
    drops=$(counter 'dropped by the kernel')
    datagrams=$(counter datagrams) accepted=$(counter accepted)
    local reasons missed explained
    reasons=$(grep -oE '[0-9]+ datagrams: [^;]*' kneadd.log | grep -oE '[0-9]+ [a-z_]+' |
        awk 'NR > 1 { sum += $1 } END { print sum }')
    missed=$(counter missed) explained=$(counter 'explained by the machine')
    echo "$1: $flood malformed in $took ms, $((flood / (took > 0 ? took : 1))) k/s; $drops dropped by the kernel;" \
        "$accepted of $valid poses accepted; memory $before -> $after kB;" \
        "$missed ticks missed, $explained by the machine"
    check "$1: all datagrams were sent" [ "$flood" = "$count" ]
    check "$1: received = sent - kernel drops" [ "$datagrams" = $((valid + flood + $(counter published) - drops)) ]
    check "$1: each datagram is in one counter" [ "$reasons" = "$datagrams" ]
    check "$1: no pose of the hand that arrived is rejected" [ "$(of_all stale clock jump rate)" = 0 ]
    check "$1: only the hand's poses are accepted" [ "$accepted" -le "$valid" ]
    check "$1: the memory grew by less than 1 MB" [ $((after - before)) -lt 1024 ]
}
flood fast 0
check "fast: the hand is heard, apart from datagrams that the kernel dropped" \
    [ "$accepted" -ge $((valid - drops)) -a "$accepted" -gt 0 ]
flood paced 25000
check "paced: at least 99 % of the hand's poses are accepted" [ "$accepted" -ge $((valid * 99 / 100)) ]

start_kneadd dough-small.yaml
kill -STOP $server
sent=$(send plate <<<"flood 60000 seed=2 rate=0")
kill -CONT $server
sleep 0.5
stop_kneadd
drops=$(counter 'dropped by the kernel')
check "stopped: $sent were sent, $drops dropped by the kernel" [ "$sent" = 60000 -a "$drops" -gt 0 ]
check "stopped: received + dropped = sent" [ $(($(counter datagrams) + drops)) = $((sent + $(counter published))) ]
check "stopped: the datagrams in the socket's buffer were received" [ $(($(counter datagrams) - $(counter published))) -gt 500 ]
exit $failed
