#!/usr/bin/env bash
# kneadd killed in the middle of a press by knead probe and started again at once, as systemd does (twice; KN_KILLS=N for more): the
# probe's own watchdog takes the force to 0 N within 20 ms of the last message, no steeper than a transition may be, the dent is restored
# to the bit, and the probe's next press meets the dented surface. Then the same, a fifth as often, with a hand on a device that renders
# the local model, which may go on for 100 ms and has leaked away by 300. KN_PICTURE=FILE.png draws the traces, by gnuplot.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
kills=${KN_KILLS:-2}
RANDOM=${KN_SEED:-1}
touches() { knead ctl --control control --json status 2>/dev/null | grep -q '"in_contact":true'; }
# play NAME FROM_MS SERVED... -- OPTION...: one kill, FROM_MS to FROM_MS + 2000 after the touch; a line of NAME.txt. Where the machine
# stood still, too, so that the probe tripped more often, once more
play() {
    local tries=$((kills > 10 ? 6 : 2)) # ctest's run ends after 600 s
    until play_once $((tries > 1)) "$@"; do
        tries=$((tries - 1))
        sleep 5
    done
}
play_once() {
    local again=$1 name=$2 from=$3 served=() ms played
    shift 3
    while [ "$1" != -- ]; do served+=("$1") && shift; done
    rm -rf state && mkdir state
    knead probe --speed '5 mm/s' --hold '1 s' --quiet --record press.lcmlog --motors motors.csv "${@:2}" 2>probe.err &
    hand=$!
    pause 0.3
    start_kneadd dough-small.yaml --state-dir state --control control "${served[@]}"
    until touches || ! kill -0 $hand 2>/dev/null; do pause 0.02; done
    ms=$((from + RANDOM % 2000))
    pause "$(printf '%d.%03d' $((ms / 1000)) $((ms % 1000)))"
    kill -KILL $server
    wait $server 2>/dev/null
    start_kneadd dough-small.yaml --state-dir state --control control "${served[@]}"
    wait $hand
    played=$?
    stop_kneadd >/dev/null
    dent press.lcmlog >dent.txt 2>&1
    [ $again = 1 ] && [ "$played $(grep -c ' taken to 0 N: ' probe.err)" != "0 1" ] && cat probe.err && return 1
    echo "$name $kill played $played $(awk -f "$KN_SOURCE/tests/timed/kill_press.awk" -v deadline=$deadline -v shifted="$name.$kill.dat" motors.csv)" \
        "$(cat dent.txt)" | tee -a $name.txt
    [ $played = 0 ] || cat probe.err
    return 0
}
column() { # column NAME OF: a number per line of the table OF.txt
    awk -v name="$1" '{ for (i = 1; i < NF; i++) if ($i == name) print $(i + 1) }' "$2.txt"
}
most() { column "$@" | sort -g | tail -1; }
least() { column "$@" | sort -g | head -1; }
all() { # all OF COUNT NAME CONDITION: on $1
    [ "$(column "$3" "$1" | awk "$4" | wc -l)" = "$2" ]
}
# checks OF COUNT ZERO_MS STEEPEST
checks() {
    check "$1: the probe played its path to the end $2 times" all "$1" "$2" played '$1 == 0'
    check "$1: it gave a force when the server died: $(least force_n $1) N at least" all "$1" "$2" force_n '$1 > 0'
    check "$1: 0 N in its first tick that is $3 ms after the last message, or before: $(most zero_ms $1) ms at most" \
        all "$1" "$2" late '$1 == 0'
    check "$1: and none until its next try" all "$1" "$2" after_n '$1 == 0'
    check "$1: never more than $4 N a ms on the way: $(most slope $1)" all "$1" "$2" slope "\$1 <= $4"
    check "$1: what was restored is what had been there, to the bit" all "$1" "$2" same '$1 == 1'
    check "$1: nine in ten went on from at most 1 s before: $(most lost_ms $1) ms at most" \
        [ $((10 * $(column lost_ms $1 | awk '$1 <= 1000' | wc -l))) -ge $((9 * $2)) ]
}
deadline=20
for ((kill = 1; kill <= kills; kill++)); do
    play forces 700 -- # it presses for 2 s; the first snapshot is there after half of one
done
few=$(((kills + 4) / 5)) deadline=300
for ((kill = 1; kill <= few; kill++)); do
    play local 1200 --set device=touch --local-model -- --hand firm --local --probe finger
done
checks forces $kills 20 2.353 # device bench: 40 N fade in 17 ms
checks local $few 300 0.5     # device touch: 3.3 N would in 17, which is less than 0.5 N/ms
# of the dent that was restored, what the dough does not give back in the 4 s until the next touch
awk '{ for (i = 1; i < NF; i++) v[$i] = $(i + 1); print v["restored_mm"], v["fresh_mm"] - v["next_mm"] }' forces.txt >dents.txt
shares=$(awk '$1 > 0.2 { print $2 / $1 }' dents.txt | sort -g)
check "the next press touches where the dent is: $(head -1 <<<"$shares") to $(tail -1 <<<"$shares") of its depth below the fresh surface" \
    awk '$1 > 0.2 { n++ } $1 > 0.2 && ($2 < 0.8 * $1 || $2 > 1.05 * $1) { bad++ } END { exit n == 0 || bad > 0 }' dents.txt
hardest=$(awk '$4 == 0 && $6 > most { most = $6; n = $2 } END { print n ? n : 1 }' forces.txt)
[ -z "${KN_PICTURE:-}" ] || gnuplot <<GNUPLOT
wide = 1400; high = 480
load "$KN_SOURCE/clients/knead/plot.gp"
set output "$KN_PICTURE"
set multiplot layout 1,3 title "kneadd killed in a press by knead probe and started again: what the device gave"
set ylabel "N"
set title "$kills presses, forces rendered"; set xlabel "ms since the last message"; set xrange [-30:60]
plot for [i=1:$kills] sprintf("forces.%d.dat", i) with lines lc rgb "#803465a4" notitle
set title "$few, the local model rendered"; set xrange [-100:400]
plot for [i=1:$few] sprintf("local.%d.dat", i) with lines lc rgb "#80a43434" notitle
set title "the hardest press: kill, lift, a new session, the next press"; set xlabel "s since the last message"; set autoscale x
plot "forces.$hardest.dat" using (1e-3*\$1):2 with lines lc rgb "#3465a4" notitle
GNUPLOT
exit $failed
