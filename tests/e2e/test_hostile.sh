#!/usr/bin/env bash
# Every client of ours on a bus with a hostile sender of KN_HOSTILE (40000) invalid datagrams: hand, web, view, probe,
# touch, with a key and without one. All survive, and none grows. With a key no datagram is accepted. Replayed
# messages include yesterday's, of another scene and another device and signed with the same key, and messages of a
# second ago.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
count=${KN_HOSTILE:-40000}
head -c 32 /dev/urandom | od -An -tx1 | tr -d ' \n' >key && chmod 600 key
hostile() { python3 "$KN_SOURCE/tests/e2e/hostile.py" "$@"; }
rss() { awk '/^VmRSS/ { print $2 }' "/proc/$1/status" 2>/dev/null || echo 0; }
lives() { kill -0 "$1" 2>/dev/null; }
round() { # round NAME KEY [replay]
    local name=$1 pid client before=() after=()
    export KNEAD_KEY=$2
    start_kneadd dough-small.yaml --touch --control control --set device=unknown ${2:+--key $2}
    rm -f tty
    paddle tty 300 >paddle.csv 2>/dev/null & local paddle=$!
    await [ -e tty ]
    knead hand paddle --tty tty --quiet --force-limit '2 N' >hand.txt 2>hand.err & hand=$!
    knead touch --json >touch.txt 2>touch.err & touch=$!
    await [ -s touch.txt ] # it shows the tool that it hears first: the hand's
    knead web --port 0 --probe plate >web.txt 2>web.err & web=$!
    knead probe --probe plate --path press --depth '2 mm' --hold $((count / 20000 + 4)) --tries 1 --quiet >probe.txt 2>probe.err & probe=$!
    await grep -q http web.txt
    for client in $hand $touch $web $probe; do before+=($(rss $client)); done
    hostile record today 1 >/dev/null
    hostile send recorded${3:+,today} $count 1 $3 >sent &
    pid=$!
    views=0 right=0
    while lives $pid; do
        knead view --png view.png --size 320x200 >view.txt 2>&1 && views=$((views + 1)) && grep -q 'dough-small.yaml live' view.txt && right=$((right + 1))
    done
    wait $pid
    for client in $hand $touch $web $probe; do after+=($(rss $client)); done
    echo "     $name: $(cat sent) datagrams; memory of hand, touch, web, probe: ${before[*]} -> ${after[*]} kB; $right of $views pictures right"
    check "$name: all messages were sent" [ "$(cat sent)" = "$count" ]
    for client in hand touch web; do check "$name: $client still runs" lives ${!client}; done
    wait $probe
    check "$name: knead probe ended by itself" [ $? -le 3 ]
    for i in 0 1 2; do check "$name: the memory of each client grew by less than 4 MB" [ $((after[i] - before[i])) -lt 4096 -a ${after[i]} -gt 0 ]; done
    check "$name: pictures were drawn" [ "$views" -gt 0 ]
    kill -TERM $hand $touch $web
    wait $hand
    check "$name: the hand ends with 0" [ $? = 0 ]
    poses=$(grep -oE '[0-9]+ poses' hand.txt) accepted=$(field '["probes"][1]["packets"]["accepted"]')
    wait $touch $web
    kill $paddle
    wait $paddle 2>/dev/null
    check "$name: the force never exceeds the limit" [ "$(awk -F, 'NR > 1 && $4 > 2.0001' paddle.csv | wc -l)" = 0 ]
    stop_kneadd
}
# Yesterday's messages.
export KNEAD_KEY=key
start_kneadd jelly.yaml --touch --key key --set device=omega --set device.scale=3
hostile record recorded 4 & recorder=$!
knead probe --path poke --quiet --tries 1 >/dev/null 2>&1
wait $recorder
stop_kneadd
round "with a key" key replay
check "with a key only the hand's own poses were accepted: $accepted of its $poses" [ "$accepted" -le $((${poses% *} + 3)) -a "$accepted" -gt 0 ]
check "with a key every picture shows the real server" [ "$right" = "$views" ]
check "with a key no client sees another device" grep -q 'as device unknown, its zero at 0, 0, 65 mm' hand.txt
check "with a key no client sees another tool" [ "$(grep -c '"probe":"finger"' touch.txt)" = "$(wc -l <touch.txt)" ]
round "without a key" ""
exit $failed
