#!/usr/bin/env bash
# knead zwidth: the text is the same every time. A delay costs as much as the delayed bound states. A light hand on
# jelly allows more than a device alone on a wall. Files are written. A coupling that is too stiff gives an exit code.
# A wrong option gives one line.
# gate in release: arithmetic, ten times slower with the sanitizers
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"

knead zwidth --quick --csv z.csv --png z.png >one || fail "exit $?: $(tail -n 3 one)"
knead zwidth --quick >two || fail "exit $?"
cmp one two || fail "two runs give different text"
[ "$(grep -c ' calm$' one)" = 5 ] || fail "$(cat one)"
[ "$(wc -l <z.csv)" = 6 ] || fail "rows: $(wc -l <z.csv)"
png z.png || fail "no PNG"

# columns: 1 round trip, 3 largest at the class's b_vc, 4 at none, 7 Colgate, 8 delayed, 9 default
awk -F, 'NR > 1 && !($3 > 0.6 * $8 && $3 < $8 && $9 < $3) { bad = 1 } END { exit bad }' z.csv || fail "the largest stiffness is outside its bounds: $(cat z.csv)"
awk -F, '{ k[$1] = $3 } END { r = k[0] / k[1]; exit !(r > 2.5 && r < 3.5) }' z.csv || fail "a period of delay does not divide the stiffness by 2.5 to 3.5: $(cat z.csv)"

# Without damping in the coupling, only the device's own friction stabilises it, as Colgate found.
knead zwidth --quick --device falcon --csv smooth.csv >/dev/null || fail "falcon: exit $?"
knead zwidth --quick --device falcon --set device.damping='2.5 N*s/m' --csv rough.csv >/dev/null || fail "rough falcon: exit $?"
paste -d, smooth.csv rough.csv | awk -F, '$1 == 0 && !($15 > 5 * $4 && $18 == 5 * $7) { bad = 1 } END { exit bad }' ||
    fail "five times the friction does not give five times the stiffness: $(paste -d, smooth.csv rough.csv)"

knead zwidth --quick --hand light --material jelly --csv jelly.csv >/dev/null || fail "jelly: exit $?"
paste -d, z.csv jelly.csv | awk -F, 'NR > 1 && !($14 > $3) { bad = 1 } END { exit bad }' || fail "jelly allows less stiffness than a wall"

knead zwidth --quick --set device.encoder='1 mm' --set device.coupling_damping='6 N*s/m' --set device.coupling='5000 N/m' >loud
[ $? = 1 ] && grep -q ' buzzes$' loud || fail "a coarse encoder under a stiff coupling is calm: $(cat loud)"

knead zwidth --help | grep -q -- '--device CLASS' || fail "--help"
refuses 2 "knead zwidth: --hand tight: expected none, light, normal or firm" zwidth --hand tight
refuses 2 "knead zwidth: --material cheese: expected wall, dough, clay, jelly or stiff-jelly" zwidth --material cheese
refuses 2 "knead zwidth: dough: without a hand the device only sinks in, expected --hand light, normal or firm" zwidth --material dough
refuses 2 "knead zwidth: --set material.k1=1 Pa: expected a key of the device, device.KEY=VALUE" zwidth --set 'material.k1=1 Pa'
refuses 2 "knead zwidth: device.profile: 'mouse' is unknown, expected touch|bench|falcon|omega|unknown" zwidth --device mouse
refuses 2 "nope.yaml:1:1: No such file or directory, expected a scene file" zwidth --scene nope.yaml --hand light
refuses 2 "knead zwidth: table: expected options only; --help lists them" zwidth table
refuses 2 "knead zwidth: --slow: unknown option; --help lists them" zwidth --slow
mkdir folder
refuses 3 "knead zwidth: folder: Is a directory, expected a file that can be written" zwidth --csv folder
exit $failed
