#!/usr/bin/env bash
# Stock LCM tools beside a kneadd. lcm-logger's log can be decoded by liblcm. lcm-logplayer plays the log's poses into
# a kneadd twice, and they work as well as a hand's.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
start_logger one.lcmlog # started first, so that it hears the scene message at the start
start_kneadd dough-small.yaml
send plate <<<"poses 3000 session=7 seq=1" >/dev/null
sleep 1.2 # a status after the last pose
stop_logger
stop_kneadd
logcheck one.lcmlog | tee one
poses=$(number poses one) forces=$(number forces one)
check "the logger heard the poses" [ "$poses" -ge 2970 ]
check "the logger heard a force for each millisecond of the session" [ "$forces" -ge 2900 ]
check "every force carries the echo of a pose" [ "$(number echoed one)" = "$forces" ]
check "the log has events, scenes and statuses" \
    [ "$(number events one)" -gt 3 -a "$(number scenes one)" -ge 1 -a "$(number statuses one)" -ge 6 ]
check "liblcm decodes everything" [ "$(number undecodable one)" = 0 ]
check "in the status, received = accepted + rejected" \
    [ "$(number received one)" = $(($(number accepted one) + $(number rejected one))) ]
check "in the status, last tick + 1 = executed + missed" \
    [ $(($(number ticks one) + 1)) = $(($(number hist one) + $(number missed one))) ]

start_kneadd dough-small.yaml
lcm-logplayer -e 'KNEAD_POSE.*' one.lcmlog >/dev/null 2>&1
sleep 1.3 # the silent session ends, and its number may be used again
lcm-logplayer -e 'KNEAD_POSE.*' one.lcmlog >/dev/null 2>&1
stop_kneadd
accepted=$(counter accepted)
check "a log played twice is accepted twice" \
    [ "$accepted" -ge $((poses * 2 * 99 / 100)) -a "$accepted" -le $((poses * 2)) ]
check "no pose of a replayed log is stale" [ "$(counter stale)" = 0 ]
exit $failed
