#!/usr/bin/env bash
# 1e5 malformed datagrams while a hand sends its 1 kHz: the daemon lives, every datagram is in one counter, the hand
# is heard.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
start_kneadd dough-small.yaml
memory() { awk '/VmRSS/ { print $2 }' "/proc/$server/status"; }
send plate >valid <<<"poses 8000 session=7 seq=1" &
hand=$! # outlasts the flood of 4 s: a probe that nobody owns would take the next good datagram
sleep 0.5 # the hand owns its probe before the flood comes
before=$(memory)
flood=$(send plate <<<"flood 100000 seed=1 rate=25000")
after=$(memory)
wait $hand
stop_kneadd
valid=$(cat valid)
drops=$(counter 'dropped by the kernel')
echo "sent $valid valid, $flood malformed; memory $before -> $after kB"
check "kneadd lived and ended well" [ "$status" = 0 ]
check "all were sent" [ "$flood" = 100000 -a "$valid" = 8000 ]
check "received = sent - kernel drops" [ "$(counter datagrams)" = $((valid + flood + $(counter published) - drops)) ]
check "at least 99 % of the valid stream is accepted" [ "$(counter accepted)" -ge 7920 ]
check "nothing else is accepted" [ "$(counter accepted)" -le "$valid" ]
check "memory did not grow by a MB" [ $((after - before)) -lt 1024 ]
exit $failed
