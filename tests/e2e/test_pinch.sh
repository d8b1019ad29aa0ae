#!/usr/bin/env bash
# Two fingers, each a hand of its own (two processes), lift a piece of dough off the table, hold it in the air and put
# it down again.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
finger() { knead probe --probe "$1" --path "$KN_SOURCE/clients/examples/$1.csv" --tries 1 --quiet 2>"$1.err"; }

# Both wait for the same KNEAD_SCENE, which comes every 5 s: that is what lets them begin together. A stall of the
# machine may spoil a try: late by more than 20 ms, a finger lets go.
for pause in 5 15 0; do
    rm -f pinch.lcmlog; : >replay.err
    start_logger pinch.lcmlog
    start_kneadd pinch.yaml
    finger thumb & thumb=$!
    finger index & index=$!
    played=yes
    wait $thumb || played=no
    wait $index || played=no
    stop_kneadd
    stop_logger
    [ $played = yes ] && knead replay pinch.lcmlog --verify --csv pinch.csv >said 2>replay.err && break
    cat thumb.err index.err replay.err
    played=no
    sleep $pause
done
check "both fingers play their path to the end" [ $played = yes ]
check "and what they felt is replayed to the bit" grep -Eq '^verified [0-9]{5,} forces, 2 probes$' said

# mean NAME COLUMN: of pinch.csv, while that finger is at the top of its way
mean() {
    awk -F, -v name="$1" -v c="$2" '$3 == name && $6 > 0.0449 { n++; sum += $c }
        END { print(n > 500 ? sum / n : "none") }' pinch.csv
}
near() { awk -v a="$1" -v b="$2" -v part="$3" 'BEGIN { exit !(a > b * (1 - part) && a < b * (1 + part)) }'; }
weight=$(knead check "$KN_SOURCE/core/scenes/pinch.yaml" | awk '$NF == "kg" { print 9.81 * $(NF - 1) }')
thumb_x=$(mean thumb 7) index_x=$(mean index 7) thumb_z=$(mean thumb 9) index_z=$(mean index 9)
echo "in the air: thumb $thumb_x N along x, $thumb_z N along z; index $index_x N, $index_z N; weight $weight N"
carried=$(awk -v a="$thumb_z" -v b="$index_z" 'BEGIN { print -a - b }')
check "in the air the two carry the dough" near "$carried" "$weight" 0.03
check "the thumb half of it" near "${thumb_z#-}" "$(awk -v w="$weight" 'BEGIN { print w / 2 }')" 0.2
check "and they squeeze it equally" near "${thumb_x#-}" "$index_x" 0.05

knead view pinch.lcmlog --at 5.8 --azimuth 10 --elevation 12 --png lifted.png >/dev/null 2>view.err
check "it can be seen in the air" grep -qs . lifted.png view.err
exit $failed
