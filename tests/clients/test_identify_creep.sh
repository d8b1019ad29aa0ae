#!/usr/bin/env bash
# knead identify creep: from the curves of knead creep back to its dough, the reported unknowns, and bad input.
# gate in release: many runs of programs that start slowly with the sanitizers
set -u
. "$KN_SOURCE/tests/clients/refuses.sh"

# curves LOAD[,LOAD]... NOISE: write LOADgf.csv as an instrument does, a reading every 0.3 s.
curves() {
    knead creep dough --load "$1" --csv all.csv >creep.txt || exit 1
    awk -F, -v share="$2" 'BEGIN { srand(7) }
        function normal(   s, i) { s = -6; for (i = 0; i < 12; i++) s += rand(); return s }
        NR > 1 { g = sprintf("%.0f", $1 / 0.00980665)
                 t[g, n[g]] = $2; x[g, n[g]++] = $3; if ($3 > most[g]) most[g] = $3 }
        END { for (g in n) { file = g "gf.csv"
            printf "# load: %s gf\n# height: 1 cm\n# area: 1 cm^2\n# release: 60 s\ntime [s],displacement [mm]\n", g > file
            for (i = 2; i < n[g]; i++) printf "%.3f,%.5f\n", t[g, i], 10 * (x[g, i] + share * most[g] * normal()) > file
            close(file) } }' all.csv
}
files="10gf.csv 30gf.csv 50gf.csv 70gf.csv 90gf.csv"

curves 10gf,30gf,50gf,70gf,90gf 0.01
knead identify creep $files --out dough.yaml --csv fit.csv --json >o.json 2>err || fail "five loads: $(cat err)"
python3 - <<'PY' && ok "five loads with 1 % noise give k1, c1, alpha and beta within 2 %, P1 within 5 %, and a bound of P0" || fail "five loads"
import json, sys
n = json.load(open("o.json"))["numbers"]
truth = {"k1": 46091.26, "c1": 245166.25, "alpha": 8002226.4, "beta": 8.31069e-4, "P1": 7845.32}
for name, value in truth.items():
    bound = 0.05 if name == "P1" else 0.02
    assert n[name]["known"] == "known" and abs(n[name]["value"] / value - 1) < bound, (name, n[name])
    assert n[name]["low"] < n[name]["value"] < n[name]["high"]
assert n["P0"]["known"] == "at_most" and 900 < n["P0"]["high"] < 1000 and n["P0"]["low"] is None and n["P0"]["words"]
PY
[ "$(wc -l <fit.csv)" -gt 2900 ] && head -1 fit.csv | grep -q '^curve,time_s,strain,fit_strain,stress_pa,readings$' &&
    ok "--csv writes the readings and the fit" || fail "--csv"

cp "$KN_SOURCE/core/scenes/dough-small.yaml" scene.yaml && sed -i 's/^material: .*/material: dough.yaml/' scene.yaml
knead check scene.yaml >check.txt 2>err && ok "a scene loads the material that --out wrote" || fail "scene: $(cat err)"
knead creep scene.yaml --load 50gf --json >back.json && python3 - <<'PY' && ok "the scene with the identified material creeps like the dough" || fail "the identified material creeps differently"
import json
assert abs(json.load(open("back.json"))["loads"][0]["height_m"] - 0.005266) < 5e-5
PY

odd=$'a, "b"\n\001\303.csv'
cp 50gf.csv "$odd"
knead identify creep "$odd" --no-models --csv odd-fit.csv --out odd-name.yaml >out 2>err || fail "odd name: $(cat err)"
python3 - <<'PY' && ok "commas, quotes and line ends in a file name are safe in the table and in the material" || fail "odd name: $(head -3 odd-fit.csv odd-name.yaml)"
import csv
rows = list(csv.reader(open("odd-fit.csv", newline="", encoding="latin-1")))
assert all(len(r) == 6 for r in rows) and rows[1][0].startswith('a, "b"'), rows[:2]
assert open("odd-name.yaml").readline().startswith('# Identified by knead identify creep from a, "b"???.csv: 1 curve')
PY
sed 's/^material: .*/material: odd-name.yaml/' scene.yaml >odd-scene.yaml
knead check odd-scene.yaml >check.txt 2>err && ok "a scene loads the material from the file with the odd name" || fail "odd name: $(cat err)"

knead identify creep 50gf.csv >one.txt 2>err || fail "one load: $(cat err)"
grep -q '^P0 *<= ' one.txt && grep -q '^P1 *>= ' one.txt && grep -q 'cannot be told from P0 and P1' one.txt &&
    grep -q 'not known separately' one.txt && ok "one load gives bounds of P0 and P1, and says which parameters are not known separately" || fail "one load"

# The same readings in the formats of other programs give the same numbers: shuffled, some missing, one far off.
python3 - <<'PY'
import random
random.seed(5)
lines = open("50gf.csv").read().split("\n")
rows = [l for l in lines[5:] if l]
random.shuffle(rows)
rows[3] = rows[3].split(",")[0] + ",nan"
rows[4] = rows[4].split(",")[0] + ","
t, x = rows[9].split(",")
rows[9] = "%s,%.5f" % (t, float(x) + 2)
head = "time;displacement\r\ns;mm\r\n"
open("odd.csv", "w", encoding="utf-8", newline="").write(
    "\ufeff# load: 50 gf\r\n# height: 10 mm\r\n# area: 100 mm^2\r\n# release: 1 min\r\n" + head +
    "".join(r.replace(",", ";").replace(".", ",") + "\r\n" for r in rows))
PY
knead identify creep odd.csv >odd.txt 2>err || fail "odd: $(cat err)"
grep -q 'odd.csv:[0-9]*:1: left out as an outlier, .* standard deviations' odd.txt && ok "the outlier is left out and its line is reported" || fail "outlier"
best() { awk -v n="$1" '$1 == n { print $2; exit }' "$2"; }
near() { awk -v a="$(best "$1" one.txt)" -v b="$(best "$1" odd.txt)" 'BEGIN { exit !(a > 0 && b / a < 1.01 && b / a > 0.99) }'; }
near k1 && near c1 && near alpha && near beta && ok "shuffled and missing readings, semicolons, decimal commas and CR LF give the same parameters within 1 %" ||
    fail "odd numbers"

knead identify creep 10gf.csv 50gf.csv --report page --png fit.png >page.txt 2>err || fail "--report: $(cat err)"
python3 - <<'PY' && ok "--report writes one page with all its pictures and links, and compares lattice and element at 4 % strain" || fail "page"
import os, re
page = open("page/index.html", encoding="utf-8").read()
for name in re.findall(r'(?:src|href)="([^"#:]+)"', page):
    assert os.path.getsize("page/" + name) > 100, name
assert len(re.findall("<img", page)) >= 6 and all(re.search(r'alt="[^"]{10}', i) for i in re.findall("<img[^>]*>", page))
back = re.search(r"with gas from element.*?10gf(.*?)</tr>", page, re.S).group(1)
strain, element, diagonals, gas, diagonals_e, gas_e = [float(x) for x in re.findall(r">\s*([0-9.]+)\s*<", back)]
assert 0.03 < strain < 0.05 and element < 2 and diagonals < 25 and gas < 12, (strain, element, diagonals, gas)
assert diagonals_e < 25 and gas_e < 12 and "lattices of this material strain differently" in page
PY
head -c 8 fit.png | grep -q PNG && ok "--png writes a PNG" || fail "--png"
(cd page && knead check scene.yaml >/dev/null) && ok "knead check accepts the scene of the report" || fail "scene of the page"
refuses 2 "knead identify creep: page: is not empty, expected a new folder" identify creep 50gf.csv --report page

knead identify creep 10gf.csv 50gf.csv --report cut >said 2>err &
report=$!
until ls -d cut.* >/dev/null 2>&1 || ! kill -0 $report 2>/dev/null; do sleep 0.02; done
kill -TERM $report
wait $report
[ $? = 143 ] && ! ls -d cut cut.* >/dev/null 2>&1 && ok "a report ended by SIGTERM leaves no files" || fail "ended report: $(ls -d cut*)"

cp 50gf.csv mine.csv
refuses 2 "knead identify creep: --csv ./mine.csv: this path is also an input, expected another path" identify creep mine.csv --csv ./mine.csv
refuses 2 "knead identify creep: --png mine.csv: this path is also an input, expected another path" identify creep mine.csv --png mine.csv
cmp -s 50gf.csv mine.csv && ok "an input file is never overwritten" || fail "readings were written over"
refuses 2 "knead identify creep: --out both and --csv both: expected two paths, neither inside the other" identify creep mine.csv --csv both --out both
refuses 2 "knead identify creep: mine.csv and ./mine.csv are one file, whose readings would count twice; expected it once" identify creep mine.csv ./mine.csv
sed '1a # load: 30 gf' 50gf.csv >said.csv
refuses 2 "said.csv:2:9: load of 30 gf here, but of 50 gf in line 1, expected one value" identify creep said.csv
sed 's/^time.*/time [s],displacement [mm],displacement [mm]/; s/^[0-9].*/&,0/' 50gf.csv >twice.csv
refuses 2 "twice.csv:5:28: a second column of displacement, 'displacement', expected one: remove the other" identify creep twice.csv
sed 's/^time.*/time [s],displacement [mm],height [mm]/; s/^[0-9].*/&,5/' 50gf.csv >spare.csv
knead identify creep spare.csv --no-models >spare.txt 2>err && grep -q 'the column of displacement is used, not that of height' spare.txt &&
    ok "if two columns give the same quantity, a message names the one used" || fail "spare column: $(cat err)"

sed 's/^# release.*//' 50gf.csv | awk -F, 'NR < 6 || $1 <= 60' >held.csv
knead identify creep held.csv >held.txt 2>err && grep -q 'never taken off' held.txt &&
    ok "a load that is never released is reported" || fail "never released: $(cat err)"

sed 's/^# release.*//' 50gf.csv >unsaid.csv
knead identify creep unsaid.csv --no-models --report unsaid --out unsaid.yaml >unsaid.txt 2>err
[ $? = 1 ] && grep -Eq '^knead identify creep: --out unsaid.yaml: not written, no scene accepts it: material.alpha is [0-9.e+]* Pa\*s, out of range, expected a number from 1e-06 to 1e\+15 Pa\*s$' err &&
    [ "$(wc -l <err)" = 1 ] && [ ! -e unsaid.yaml ] && grep -q '^note: no scene accepts this material' unsaid.txt && [ -s unsaid/index.html ] &&
    [ ! -e unsaid/material.yaml ] && ! grep -q 'Simulated creep' unsaid/index.html && ok "a material outside the range of a scene is not written, and its report says so" ||
    fail "a material outside the range of a scene is not refused: $(cat err)"
refuses 2 "knead identify creep: --density '40 g/cm^3': expected a density like '1.2 g/cm^3', 1 to 30000 kg/m^3" identify creep 50gf.csv --density '40 g/cm^3'

mkdir late && cd late && curves 10gf,50gf,70gf 0.001
awk -F, 'NR > 5 { $1 += 0.15 } { print }' OFS=, 70gf.csv >late70.csv
knead identify creep 10gf.csv 50gf.csv late70.csv --no-models >late.txt 2>err && grep -q 'note: late70.*--late' late.txt &&
    knead identify creep 10gf.csv 50gf.csv late70.csv --no-models --late | grep -q 'late70 .*applied 0.1[0-9]* s late' &&
    ok "a late load is suspected without --late and found with --late" || fail "late: $(cat late.txt)"
{ # a recording that was started 12 s too soon
    sed 5q 70gf.csv && for i in $(seq 0 39); do echo "$(awk "BEGIN { print 0.3 * $i }"),0"; done
    awk -F, 'NR > 5 { $1 += 12; print }' OFS=, 70gf.csv
} >early70.csv
knead identify creep 10gf.csv 50gf.csv early70.csv --late --no-models --csv early.csv >early.txt 2>err
grep -q 'early70 .*applied 1[12].* s late, held' early.txt && awk -F, '
    $1 == "early70" && $2 < 0 { bad = 1 }
    $1 == "early70" && $2 < 59 && $5 < 1000 { bad = 1 }
    $1 == "early70" && $2 > 61 && $5 != 0 { bad = 1 }
    $1 == "early70" && ($3 - $4) ^ 2 > 1e-4 { bad = 1 }
    END { exit bad }' early.csv && grep -Eq '^early70 +k1 [+-][0-9.]* %' early.txt &&
    ok "the delay found with --late is applied to times, stresses and the two-stage fit" || fail "early: $(cat err early.txt)"
cd ..

refuses 2 "knead identify creep: expected a file of readings, CSV; --help lists its columns" identify creep
: >empty.csv
refuses 2 "knead identify creep: empty.csv: is empty, expected a table" identify creep empty.csv
printf 'time,displacement\n0,1\n1,2\n' >unitless.csv
refuses 2 "unitless.csv:1:1: time has no unit, expected one, e.g. 'time [s]', or --units 'time=s'" \
    identify creep unitless.csv --load 50gf --height 1cm --area 1cm^2
printf '# load: 50 gf\n# height: 1 cm\n# area: 1 cm^2\ntime (s),displacement (mm)\n' >zero.csv
for i in $(seq 1 30); do echo "$i,0"; done >>zero.csv
refuses 2 "zero.csv:5:1: displacement is 0 in all readings, expected one that changes" identify creep zero.csv
sed 's/^1,.*/1,11/; s/,0$/,12/' zero.csv >beyond.csv
refuses 2 "beyond.csv:5:3: strain of 1.1, more than the whole height, expected less than 1; is the height right?" \
    identify creep beyond.csv
refuses 2 "knead identify creep: --load '0': expected a weight or force like 50gf or '0.5 N'" identify creep 50gf.csv --load 0
refuses 2 "knead identify creep: --height '5 s': expected a length like '1 cm'" identify creep 50gf.csv --height '5 s'
refuses 2 "knead identify creep: --bogus: unknown option; --help lists them" identify creep 50gf.csv --bogus
refuses 2 "knead identify creep: 50gf.csv: exists and was not written by knead identify, expected another name" \
    identify creep 10gf.csv --out 50gf.csv
[ "$(head -1 50gf.csv)" = "# load: 50 gf" ] && ok "the refused --out leaves the readings unchanged" || fail "50gf.csv was changed"
exit $failed
