#!/usr/bin/env bash
# Poses that kneadd accepts and refuses, over the bus, counted to the datagram: stale, replayed, jumping and
# non-finite poses, a second publisher, a session that starts anew after a silence, and a session after another one
# has left.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
start_kneadd dough-small.yaml
second() { # second PORT OPTION...: a second server reports in one line whose the bus is, and the remedy
    expect "^kneadd: another kneadd serves udpm://239.255.76.67:$1[?]ttl=0: expected $2 with another port$" 3 \
        kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --realtime off "${@:3}"
}
second 7667 --lcm-url
second 7668 --mesh-url --lcm-url 'udpm://239.255.76.67:7777?ttl=0'
second 7667 --mesh-url --lcm-url 'udpm://239.255.76.67:7777?ttl=0' --mesh-url 'udpm://239.255.76.67:7667?ttl=0'
sent=$(send plate <<EOF
poses 100 session=7 seq=1
poses 10 session=7 seq=91
poses 5 session=7 seq=100 step=0
poses 20 session=8 seq=1000
poses 6 session=7 seq=101 x=nan
poses 7 session=7 seq=101 vz=inf
poses 8 session=7 seq=101 x=0.5
poses 9 session=7 seq=101 z=1.5
poses 11 session=7 seq=101 vz=-6
poses 12 session=7 seq=101 utime=1
poses 13 session=0 seq=101
poses 50 session=7 seq=101
sleep 1300
poses 40 session=7 seq=1 leave
poses 16 session=7 seq=41
sleep 200
poses 30 session=8 seq=1
EOF
)
nobody=$(send thumb <<<"poses 14 session=1 seq=1")
stop_kneadd
check "valid poses are accepted, including a restarted session and the next owner" \
    [ "$(counter accepted)" = 220 ]
check "late and repeated poses are stale, and so are those of an ended session" [ "$(counter stale)" = 31 ]
check "a second publisher is refused" [ "$(counter session)" = 20 ]
check "NaN and infinity are refused" [ "$(counter nonfinite)" = 13 ]
check "jumps by distance and by velocity are rejected" [ "$(counter jump)" = 19 ]
check "a pose outside the workspace is rejected" [ "$(counter workspace)" = 9 ]
check "a clock that runs backwards is refused" [ "$(counter clock)" = 12 ]
check "session 0 is refused" [ "$(counter session_zero)" = 13 ]
check "a probe the scene does not have is refused" [ "$(counter probe)" = "$nobody" ]
check "every datagram is in one counter" \
    [ "$(counter datagrams)" = $((sent + nobody + $(counter published))) ]
check "the kernel dropped no datagram" [ "$(counter 'dropped by the kernel')" = 0 ]

# poses that come too seldom, and a utime that counts from 0, are told once; a device that states its rate is not
start_kneadd dough-small.yaml
send plate <<<"poses 500 session=9 seq=1 rate=200" >/dev/null
check "poses that come too seldom are told with their distance" \
    [ "$(grep -c '^kneadd: plate: poses every [45][.0-9]* ms, but the force is held for 3 ms and fades: state device.rate' kneadd.err)" = 1 ]
check "a utime that counts from 0 is told" grep -q '^kneadd: plate: utime of the poses is .*, expected microseconds since 1970' kneadd.err
stop_kneadd
start_kneadd dough-small.yaml --set device.rate=200Hz
send plate <<<"poses 500 session=9 seq=1 rate=200" >/dev/null
check "a device that states its rate is not told" [ "$(grep -c 'poses every' kneadd.err)" = 0 ]
stop_kneadd
exit $failed
