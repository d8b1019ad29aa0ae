#!/usr/bin/env bash
# knead creep: the paper's dough under its loads, an expression with the same parts, a lattice beside it, CSV and PNG.
# Each specimen that cannot be tested gives one line.
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"
# value ROW COLUMN: print an entry of the table on stdout.
value() { awk -v row="$1" -v column="$2" '$1 == row && $2 == "element" { print $column }' out; }

knead creep dough --load 10gf,30gf,50gf,70gf,90gf --csv creep.csv --png creep.png >out || fail "creep dough: exit $?"
# core.network has all five loads
[ "$(value 50 4) $(value 50 5) $(value 90 6) $(value 90 7) $(value 90 8)" = "26.33 0.5266 0.7464 0.0502 0.6962" ] || fail "creep dough: $(cat out)"
png creep.png || fail "no PNG"
[ "$(head -n 1 creep.csv)" = load_n,time_s,strain,height_m,stress_pa ] || fail "columns: $(head -n 1 creep.csv)"
[ "$(wc -l <creep.csv)" = $((1 + 5 * 602)) ] || fail "rows: $(wc -l <creep.csv)"

# The default is the paper's test. The scene's file, and the same parts as an expression, give the same result.
knead creep dough | grep -v '^specimen' >named
knead creep "$KN_SOURCE/core/scenes/dough-diagonals.yaml" --load 50gf --hold 60 --rest 70 | grep -v '^specimen' | cmp -s - named || fail "the scene file creeps differently from the material name"
knead creep '(s|d)-d' --param s1='470 gf/cm^3' --param d1='2500 gf s/cm^3' \
    --param d2='exp(8.16e4 gf s/cm^3, 0.0815 cm^2/gf, 9 gf/cm^2, 80 gf/cm^2)' | grep -v '^specimen' | cmp -s - named || fail "the expression creeps differently from the material name"
knead creep dough --set material.k1='940 gf/cm^3' >out && [ "$(value 50 7)" = 0.0285 ] || fail "--set: a spring twice as stiff recovers $(value 50 7)"
knead creep s --param s1='1 kPa' --load 0.05N --constant-area >out && [ "$(value 5.099 6)" = 0.5000 ] || fail "a spring: $(cat out)"

# At small strain a lattice of the same material creeps alike.
knead creep dough --lattice 2x2x2 --plate slide --load 2gf --hold 10 --rest 0 >out || fail "lattice: exit $?"
awk '$2 == "element" { e = $6 } $2 == "lattice" { l = $6 } END { exit !(l > 0.97 * e && l < 1.03 * e) }' out || fail "lattice: $(cat out)"

# Under a weight that does not shrink with the block, diagonals alone are squeezed flat. Gas keeps the volume.
knead creep dough --lattice 1x1x1 --load 50gf --rest 0 >out && grep -q "^ *50 lattice *flat after 4[.0-9]* s" out || fail "the lattice is not flat: $(cat out)"
knead creep dough --lattice 1x1x1 --load 50gf --rest 0 --table stick --set object.pressure=cells >out && grep -q "^ *50 lattice.*0[.]" out && ! grep -q flat out ||
    fail "a lattice with gas: $(cat out)"

# 6 cm^2 of area: 1 gf/cm^2
knead creep dough --lattice 3x2x1 --load 6gf --hold 1 --rest 0 >out || fail "a wide block: exit $?"
grep -q "3 x 2 x 1 cm" out && [ "$(value 6 4)" = 1.00 ] || fail "a wide block: $(cat out)"

refuses 2 "EXPR:1:1: unknown element 'dogh', expected s, d, a name like voigt, or (; or a material: clay, dough, dough-lattice, fibrotic-liver, jelly, liver, putty; or a scene" creep dogh
refuses 2 "knead creep: s1: s1 has no value, expected --param s1='46 kPa'" creep s
refuses 2 "knead creep: --param s1=5: '5' has no unit, expected something like s1='46 kPa'" creep s --param s1=5
refuses 2 "knead creep: --param d1=3Pa: '3Pa' has another dimension, expected something like d1='245 kPa*s'" creep d --param d1=3Pa
refuses 2 "knead creep: --param k=5kPa: expected PART=VALUE with a part of s1|d1" creep voigt --param k=5kPa
refuses 2 "knead creep: --param d1: d1 needs 0 <= p0 < p1, finite" creep d --param d1='exp(1 kPa*s, 1 1/Pa, 9 Pa, 8 Pa)'
refuses 2 "knead creep: --param s1: s1 needs a finite modulus above 0" creep s --param s1='0 Pa'
refuses 2 "knead creep: --param s1=1Pa: dough is not an expression, expected --set KEY=VALUE" creep dough --param s1=1Pa
refuses 2 "knead creep: --set x=1: s is an expression, expected --param, or a scene" creep s --set x=1
refuses 2 "knead creep: --load 50: expected at most 16 weights above 0 like 50gf or 10gf,30gf,0.5N" creep dough --load 50
refuses 2 "knead creep: --hold 0: expected a time like 60 or '1000 ms'" creep dough --hold 0
refuses 2 "knead creep: --strain: unknown option; --help lists them" creep dough --strain 10%
refuses 2 "knead creep: --lattice 3x3: expected cells along x, y, z like 4x4x4, at most 64 each" creep dough --lattice 3x3
refuses 2 "knead creep: --lattice: an edge cannot be (s-d)|s (zener), expected s|d, s-d, d or (s|d)-d, a force-dependent d only in series; without --lattice any element runs" \
    creep zener --param s1=1kPa --param d1='1 kPa*s' --param s2=1kPa --lattice 2x2x2
refuses 2 "knead creep: expected one specimen, a material like dough or an expression like '(s|d)-d'; see --help" creep
begun=yes refuses 3 "knead creep: folder: Is a directory, expected a file that can be written" creep dough --csv "$(mkdir folder && echo folder)"
mkdir bare && ln -s "$(command -v sh)" bare/sh
knead=$(command -v knead)
PATH=$PWD/bare "$knead" creep dough --png none.png >out 2>err
[ $? = 3 ] && [ "$(cat err)" = "knead creep: none.png: not drawn, gnuplot is not installed; --csv writes the numbers" ] || fail "no gnuplot: $(cat err)"
exit $failed
