#!/usr/bin/env bash
# What every other LCM program is built on, beside kneadd: a subscriber of the stock liblcm and kneadd hear one and the
# same stream of malformed datagrams. What became of the one is told, the other must not mind.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
start_kneadd dough-small.yaml
send plate >valid <<<"poses 1000000 session=7 seq=1" &
hand=$!
sleep 0.5
before=$(memory)
total=0
stream() { # stream NAME LINE: what became of a subscriber of its own goes to NAME
    stock >"$1" 2>"$1.err" &
    local user=$! sent
    await grep -qs ready "$1"
    sent=$(send plate <<<"$2")
    total=$((total + sent))
    sleep 0.3
    kill -TERM $user 2>/dev/null
    wait $user
    check "the stream reaches it: $(tail -1 "$1")" \
        [ "$(grep -oE '[0-9]+ datagrams' "$1" | grep -oE '[0-9]+')" -gt 0 ]
    check "and it decoded some of it, or died of it" eval "[ -s $1.err ] || grep -q ' died of ' $1"
}
stream mix "stock 50000 seed=1 rate=25000"
stream again "stock 50000 seed=2 rate=25000"
stream arrays "leak 10000 rate=5000"
after=$(memory)
kill -TERM $hand
wait $hand
stop_kneadd
valid=$(cat valid)
drops=$(counter 'dropped by the kernel')
# what others published on the bus is in kneadd's count: liblcm tries the bus with a few messages of its own
received=$(($(counter datagrams) - $(counter published) + drops))
echo "beside them: the stock liblcm $(tail -1 mix | cut -d' ' -f3-)"
echo "again:       the stock liblcm $(tail -1 again | cut -d' ' -f3-)"
echo "leak only:   the stock liblcm $(tail -1 arrays | cut -d' ' -f3-)"
echo "kneadd:      alive, $total malformed of $received counted, $(counter accepted) of $valid poses accepted," \
    "memory +$((after - before)) kB"
check "it counted all of it" [ "$received" -ge $((valid + total)) -a "$received" -lt $((valid + total + 100)) ]
check "at least 99 % of the valid stream is accepted" [ "$(counter accepted)" -ge $((valid * 99 / 100)) ]
check "nothing else is accepted" [ "$(counter accepted)" -le "$valid" ]
check "memory did not grow by a MB" [ $((after - before)) -lt 1024 ]
exit $failed
