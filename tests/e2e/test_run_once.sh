#!/usr/bin/env bash
# server/run on a machine that would route multicast out: it plays the press, and leaves no trace. The machine has a
# default route through one end of a veth pair, and no loopback route for LCM's group. The far end counts the packets
# that leave.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh" # defines check

ip route del 224.0.0.0/4 dev lo
ip link add out0 type veth peer name far0 || { echo "skipped: no veth devices in this kernel" && exit 77; }
for device in out0 far0; do # IPv6 would send packets of its own
    echo 1 >"/proc/sys/net/ipv6/conf/$device/disable_ipv6" || { echo "skipped: /proc/sys is read-only" && exit 77; }
    ip link set $device up
done
ip addr add 192.0.2.1/24 dev out0
ip route add default via 192.0.2.2
left() { awk '$1 == "far0:" { print $3 }' /proc/net/dev; } # packets that arrived at the far end
routes() { ip -4 route show table all; }
before=$(routes)

# Test the counter: joining a group on this machine sends IGMP.
joins() { ip addr add 239.255.76.67/32 dev out0 autojoin && sleep 1 && ip addr del 239.255.76.67/32 dev out0 && [ "$(left)" -gt 0 ]; }
check "without the route a join leaves the machine" joins
sent=
until [ "$(left)" = "$sent" ]; do # the reports are repeated, within a second each
    sent=$(left)
    pause 2.5
done

status=$(git -C "$KN_SOURCE" status --porcelain 2>/dev/null)
row() { grep -qE "^ +$1 +-?[0-9.]+ $2" "$log"; }
png() { head -c 8 "$KN_SOURCE/out/$1" | cmp -s - <(printf '\211PNG\r\n\032\n'); }
pressed() { # pressed LOG: check the messages and files of a run
    log=$1
    check "contact is in the table" row contact s
    check "the peak force is in the table" row peak N
    check "the force at the end of the hold is in the table" row 'end of hold' N
    check "the residual depth is in the table" row 'residual depth' mm
    check "press.png is a picture" png press.png
    check "dent.png is a picture" png dent.png
    check "press.csv has a row per ms" [ "$(wc -l <"$KN_SOURCE/out/press.csv")" -gt 5000 ]
    check "the source tree is unchanged" [ "$(git -C "$KN_SOURCE" status --porcelain 2>/dev/null)" = "$status" ]
}
if [ -n "${KN_NIGHT:-}" ]; then
    "$KN_SOURCE/server/run" --once </dev/null >press.log 2>&1
    check "with --once server/run plays the press and exits 0" [ $? = 0 ]
    pressed press.log
    check "the route is removed" [ "$(routes)" = "$before" ]
    check "no packet left the machine" [ "$(left)" = "$sent" ]
fi

# Runs until Ctrl-C, and leaves nothing behind.
scene=()
# the tick of the small scene stays short on a busy machine
[ -n "${KN_NIGHT:-}" ] || scene=("$KN_SOURCE/core/scenes/dough-small.yaml")
set -m # its own process group, as on a terminal; a background job would ignore Ctrl-C
"$KN_SOURCE/server/run" "${scene[@]}" </dev/null >up.log 2>&1 &
run=$!
set +m
await grep -q 'Ctrl-C ends it' up.log
check "without --once server/run keeps serving" grep -q 'serving an untouched' up.log
check "server/run names the route that it adds" grep -q '239.255.76.67/32 is routed to lo' up.log
pressed up.log
check "the multicast group is routed over lo" [ "$(ip -4 route get 239.255.76.67 | grep -c 'dev lo')" = 1 ]
kill -INT -- -$run
check "Ctrl-C ends server/run with exit 0" ended $run
check "server/run reports what it has ended: $(tail -n 1 up.log)" \
    [ "$(tail -n 1 up.log)" = "stopped: the page has ended; kneadd has ended, forces at zero; the route is gone" ]
check "server/run removes the route" [ "$(routes)" = "$before" ]
check "no packet left the machine" [ "$(left)" = "$sent" ]
[ $failed = 0 ] || tail -n 30 *.log
exit $failed
