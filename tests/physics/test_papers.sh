#!/usr/bin/env bash
# bench/papers --quick: every statement of the papers that a short run can confirm, its pictures and its tables.
# night: a minute of presses; the sentences of physics/ hold most of what it finds
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"

command -v gnuplot >/dev/null || { echo "skipped: gnuplot is not installed"; exit 77; }
"$KN_SOURCE"/bench/papers --quick --out papers >out 2>&1 || { fail "bench/papers: exit $?"; tail -n 5 out; }

# measure EXPERIMENT COLUMN: print an entry of experiments.csv.
measure() {
    awk -F, -v name="$1" -v column="$2" 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == column) c = i }
        $1 == name { print $c }' papers/experiments.csv
}
holds() { awk "BEGIN { exit !($1) }" || fail "$2: $1"; }

for face in x y; do
    a=$(measure block-1-a bulge_${face}_m)
    holds "$(measure block-1-b bulge_${face}_m) >= 3 * $a" "bulge $face of (b)"
    holds "$(measure block-1-c bulge_${face}_m) >= 2 * $a" "bulge $face of (c)"
done
for structure in b c; do
    holds "$(measure block-1-$structure dip_n) <= 0.01 * $(measure block-1-$structure peak_n)" "dip of ($structure)"
    holds "$(measure block-1-$structure least_cell) > 0" "cells of ($structure)"
done
holds "$(measure block-1-a dip_n) > 0.1 * $(measure block-1-a peak_n)" "dip without gas"
for object in disc tets; do
    elastic=$(measure $object-dough-viscoelastic left_share) dough=$(measure $object-dough left_share)
    holds "$elastic < 0.05 && $elastic < $dough" "what the viscoelastic $object keeps"
    holds "$dough < $(measure $object-dough-plastic left_share)" "what the plastic $object keeps"
done
holds "$(measure gravity-dough sag) <= 0.016 && $(measure gravity-linear sag) > 0.5" "sag"
holds "$(measure gravity-grid fallen_s) > 0 && $(measure gravity-grid fallen_s) <= 1" "fall of the grid"

for picture in creep force lattices materials-2d materials-3d profile-2d profile-3d structures-2d \
    structures-3d; do
    head -c 8 papers/$picture.png | od -An -c | grep -q 'P   N   G' || fail "no $picture.png"
done
grep -q '^| stress at release, gf/cm2 | 28 | - | 26.33' papers/RESULTS.md || fail "RESULTS.md: 28 beside 26.33"
bench_papers papers/scenes/block.yaml --set object.spacing='1 parsec' >out 2>&1 && fail "a bad scene went through"
grep -q 'spacing' out || fail "a bad scene: $(cat out)"
exit $failed
