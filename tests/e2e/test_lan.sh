#!/usr/bin/env bash
# kneadd on a network of two hosts: a hand on the other host is accepted by its address or by a key. Poses with
# neither are counted and move nothing. Recorded poses cannot be played again.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
ip route del 224.0.0.0/4 dev lo
unshare -n sleep 600 >/dev/null 2>&1 & # the other host, which tests/netns does not wait for
other=$!
trap 'kill $other' EXIT
sleep 0.3
if ! ip link add card type veth peer name card2 2>why || ! ip link set card2 netns $other 2>>why; then
    echo "skipped: no network of two hosts to be had here: $(cat why)"
    exit 77
fi
there() { nsenter -t $other -n "$@"; }
ip addr add 10.9.0.1/24 dev card && ip link set card up && ip route add 224.0.0.0/4 dev card
there ip link set lo up && there ip addr add 10.9.0.2/24 dev card2 && there ip addr add 10.9.0.3/24 dev card2
there ip link set card2 up && there ip route add 224.0.0.0/4 dev card2 src 10.9.0.2
sleep 0.5
openssl rand -hex 32 >key 2>/dev/null || head -c 32 /dev/urandom | od -An -tx1 | tr -d ' \n' >key
chmod 600 key
tr 0-9a-f 1-9a-f0 <key >wrong && chmod 600 wrong
export KNEAD_LAN=card2
poke() { there $ahead env "$@" knead probe --path poke --quiet; }
# refuses PATTERN OPTION...
refuses() { expect "$1" 2 kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" "${@:2}"; }
refuses '--lan: expected --key FILE or --peer ADDRESS as well' --lan card
refuses '--peer: expected --lan IFACE as well' --peer 10.9.0.2
refuses '--peer 10.9.0: expected an IPv4 address' --lan card --peer 10.9.0
refuses 'cord: no such network interface' --lan cord --peer 10.9.0.2
refuses 'expected ttl=1 or more' --lan card --peer 10.9.0.2 --lcm-url 'udpm://239.255.76.67:7667?ttl=0'
refuses 'expected ttl=0' --lcm-url 'udpm://239.255.76.67:7667?ttl=1'
cp key open && chmod 644 open
refuses 'open: others may read or write it, expected mode 0600' --key open

start_kneadd dough-small.yaml --lan card --peer 10.9.0.2
check "kneadd warns that an address is no authentication" grep -q 'this is no authentication' kneadd.log
check "a hand on the other host is pushed back" poke KNEAD_KEY=
there ip route change 224.0.0.0/4 dev card2 src 10.9.0.3
poke KNEAD_KEY= >out 2>&1
check "a hand from another address is not served" [ $? = 3 ]
stop_kneadd
check "the rejected poses are counted: $(counter peer)" [ "$(counter peer)" -gt 1000 ]

start_kneadd dough-small.yaml --lan card --key key
$ahead nsenter -t $other -n lcm-logger -q --lcm-url='udpm://239.255.76.67:7667?ttl=1' -f record.lcmlog >/dev/null 2>&1 &
logger=$!
sleep 0.5
check "a hand with the key is served from any address" poke KNEAD_KEY=key
stop_logger
poke KNEAD_KEY= >out 2>&1
check "a hand without the key is refused" [ $? = 3 ]
poke KNEAD_KEY=wrong >out 2>&1
check "a hand with another key is refused" [ $? = 3 ]
there lcm-logplayer -e 'KNEAD_POSE.*' --lcm-url='udpm://239.255.76.67:7667?ttl=1' record.lcmlog >/dev/null 2>&1
there env KNEAD_KEY=key KNEAD_LAN=card2 knead view --png view.png >view.out 2>&1
check "a viewer with the key draws a picture: $(tail -1 view.out)" [ -s view.png ]
there env KNEAD_KEY=wrong KNEAD_LAN=card2 knead view --png wrong.png >/dev/null 2>&1
check "a viewer with a wrong key draws no picture" [ ! -e wrong.png ]
stop_kneadd
check "the rejected messages are counted: $(counter mac) mac" [ "$(counter mac)" -gt 2000 ]
check "replayed recordings are rejected: $(counter replayed) replayed" [ "$(counter replayed)" -gt 1000 ]
check "the log of signed messages replays to the bit" knead replay record.lcmlog --verify

start_kneadd dough-small.yaml --lan card --peer 10.9.0.3
poke KNEAD_KEY=key >out 2>&1
check "a hand with a key refuses a server without one" [ $? = 3 ]
stop_kneadd
exit $failed
