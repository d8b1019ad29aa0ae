#!/usr/bin/env bash
# What was recorded is what is replayed: a press by knead probe, recorded by itself and by lcm-logger, gives back its own
# forces to the bit; its poses, played by lcm-logplayer into another kneadd, give nearly the same.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
peak() { sed -n 's/.*peak contact force \([0-9.]*\) N.*/\1/p' "$1"; }
within() { awk -v a="$1" -v b="$2" -v r="$3" 'BEGIN { exit !(a > 0 && b > 0 && a / b < 1 + r && b / a < 1 + r) }'; }
verifies() { knead replay "$1" --verify >"$1.said" 2>"$1.err" || { cat "$1.said" "$1.err"; return 1; }; }

start_logger bus.lcmlog # first, so that it hears the server's start
start_kneadd dough-small.yaml
press --hold '500 ms' --record press.lcmlog
sleep 1.2 # the session ends
press --hold '500 ms' --record second.lcmlog
sleep 0.2
stop_kneadd
stop_logger

check "the hand's own recording verifies" verifies press.lcmlog
check "so does lcm-logger's, from the server's start to its stop, over two sessions" verifies bus.lcmlog
check "and says how much that is" grep -Eq '^verified [0-9]{4,} forces, 1 probe$' bus.lcmlog.said
knead replay second.lcmlog >/dev/null 2>why
check "a recording of dough that was already kneaded is refused" [ $? = 2 ]
check "in plain words" grep -q 'had been kneaded before this log begins' why

knead replay "$KN_SOURCE/core/scenes/dough-small.yaml" press.lcmlog --csv a.csv --hash >a && knead replay press.lcmlog --csv b.csv --hash >b
check "two replays have one hash" cmp -s a b
runs=${KN_RUNS:-5}
hashes=$(for ((i = 0; i < runs; i++)); do knead replay press.lcmlog --hash | grep '^hash'; done | sort | uniq -c)
check "so have $runs:$hashes" [ "$(wc -l <<<"$hashes") $(grep -oE '^ *[0-9]+' <<<"$hashes" | tr -d ' ')" = "1 $runs" ]
check "and, but for the time they took, one table" cmp -s <(cut -d, -f1-17 a.csv) <(cut -d, -f1-17 b.csv)
check "of as many rows as forces" [ $(($(wc -l <a.csv) - 1)) = "$(sed -n 's/verified \([0-9]*\) forces.*/\1/p' press.lcmlog.said)" ]

# a stall of the machine may spoil a run: late by more than 20 ms, the server lets go
for pause in 2 10 0; do
    start_logger played.lcmlog
    start_kneadd dough-small.yaml
    lcm-logplayer -e 'KNEAD_POSE.*' press.lcmlog >/dev/null 2>&1
    sleep 0.2
    stop_kneadd
    stop_logger
    verifies played.lcmlog || failed=1
    within "$(peak played.lcmlog.said)" "$(peak press.lcmlog.said)" 0.05 && break
    echo "peaks $(peak played.lcmlog.said) and $(peak press.lcmlog.said) N"
    [ $pause = 0 ] || rm played.lcmlog
    sleep $pause
done
check "its poses alone, played into another kneadd, press as hard within 5 %" \
    within "$(peak played.lcmlog.said)" "$(peak press.lcmlog.said)" 0.05
exit $failed
