#!/usr/bin/env bash
# A kneadd with a key on a bus that anybody may send on: of KN_FORGED (100000) messages that no holder of the key sends
# now (no tag, a wrong one, another's, another tool's, a bit flipped, of an hour ago, of the future, recorded and sent
# again) none is accepted, neither for the tool that somebody holds nor for the one that nobody does.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
count=${KN_FORGED:-100000}
head -c 32 /dev/urandom | od -An -tx1 | tr -d ' \n' >key
chmod 600 key
start_kneadd dough-small.yaml --key key
send plate key >valid <<<"poses 100000000 session=7 seq=1" &
hand=$!
sleep 0.5
# what was recorded on each of the two: of the tool that was held, and let go of, a second before
send plate key >plate <<EOT &
poses 4000 session=9 seq=1 rate=100000
forge $((count / 2)) seed=1 rate=12500
EOT
held=$!
send finger key >finger <<EOT
poses 500 session=9 seq=1
sleep 1300
forge $((count - count / 2)) seed=2 rate=12500
EOT
wait $held
sleep 0.2
kill -TERM $hand
wait $hand
stop_kneadd
valid=$(($(cat valid) + 500)) forged=$(($(cat plate) + $(cat finger) - 500))
refused=$(($(counter mac) + $(counter replayed) + $(counter session) + $(counter stale) + $(counter type)))
echo "$forged forged or replayed: $(counter mac) without the key's tag, $(counter replayed) not of now," \
    "$(counter session) of another session, $(counter stale) old;" \
    "$(($(counter accepted) - valid)) more accepted than the hands' $valid"
check "all were sent" [ "$forged" = $((count + 4000)) ]
drops=$(counter 'dropped by the kernel')
# a good pose of a hand may have been among the dropped; else all that a hand counted are accepted, and nothing else is
accepted=$(counter accepted)
check "every datagram came or was dropped: $drops" \
    [ $(($(counter datagrams) + drops)) = $((valid + forged + $(counter published) + $(counter hello))) ]
check "none is accepted, and each pose of the hands' is: $accepted of $valid" \
    [ "$accepted" -le "$valid" -a "$accepted" -ge $((valid - drops)) ]
check "all others are refused for what they are" \
    [ $((accepted + refused + $(counter channel) + $(counter hello))) = "$(counter datagrams)" -a "$refused" -le "$forged" -a "$refused" -ge $((forged - drops)) ]
exit $failed
