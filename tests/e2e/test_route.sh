#!/usr/bin/env bash
# Nothing leaves the machine. Without a loopback route kneadd refuses before it joins the group. With the narrowest
# route it runs beside stock LCM tools, and no multicast or IGMP datagram leaves by the network card.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
ip route del 224.0.0.0/4 dev lo
if ! ip link add card type veth peer name cable 2>why && ! ip tuntap add card mode tap 2>why; then
    echo "skipped: no network card to be had in a namespace here: $(cat why)"
    exit 77
fi
ip addr add 10.9.0.1/24 dev card && ip link set card up
ip link set cable up 2>/dev/null
ip route add default via 10.9.0.2 dev card || exit 3
sniff_start() {
    rm -f sniffed # otherwise the loop reads the output of the run before
    sniff card >sniffed &
    sniffer=$!
    await grep -qs ready sniffed && return
    echo "skipped: this user may not listen to a network card" && exit 77
}
sniff_stop() { # set left to the number of datagrams that left
    sleep 0.2
    kill -TERM $sniffer
    wait $sniffer
    left=$(tail -1 sniffed)
}

sniff_start
expect 'ip route add 239.255.76.67/32 dev lo' 3 \
    kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --realtime "$KN_REALTIME"
sniff_stop
check "with a route over the network card kneadd refuses to start, and no packet leaves" [ "$left" = 0 ]

ip route add 239.255.76.67/32 dev lo
sniff_start
start_kneadd dough-small.yaml
start_logger bus.lcmlog
send plate <<<"poses 500 session=7 seq=1" >/dev/null
stop_logger
stop_kneadd
sniff_stop
check "with the suggested route kneadd serves" [ "$(counter accepted)" = 500 ]
check "with the suggested route no packet leaves by the network card" [ "$left" = 0 ]

ip route del 239.255.76.67/32 dev lo # last, since IGMP repeats itself for seconds
sniff_start
timeout 1 lcm-logger -q -f stock.lcmlog >/dev/null 2>&1
sniff_stop
check "plain LCM without the route leaks its join, so this test can see a leak" [ "$left" -gt 0 ]
exit $failed
