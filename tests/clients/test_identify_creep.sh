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
json o.json 'all(n["known"] == "known" and abs(n["value"] / v - 1) < bound and n["low"] < n["value"] < n["high"] for n, v, bound in
        [(o["numbers"][k], *x) for k, x in {"k1": (46091.26, 0.02), "c1": (245166.25, 0.02), "alpha": (8002226.4, 0.02),
         "beta": (8.31069e-4, 0.02), "P1": (7845.32, 0.05)}.items()])' &&
    json o.json '[o["numbers"]["P0"][k] for k in ("known", "low")] == ["at_most", None] and 900 < o["numbers"]["P0"]["high"] < 1000' &&
    ok "five loads with 1 % noise give k1, c1, alpha and beta within 2 %, P1 within 5 %, and a bound of P0" || fail "five loads: $(cat o.json)"
[ "$(wc -l <fit.csv)" -gt 2900 ] && head -1 fit.csv | grep -q '^curve,time_s,strain,fit_strain,stress_pa,readings$' &&
    ok "--csv writes the readings and the fit" || fail "--csv"

cp "$KN_SOURCE/core/scenes/dough-small.yaml" scene.yaml && sed -i 's/^material: .*/material: dough.yaml/' scene.yaml
knead check scene.yaml >check.txt 2>err && ok "a scene loads the material that --out wrote" || fail "scene: $(cat err)"
knead creep scene.yaml --load 50gf --json >back.json && json back.json 'abs(o["loads"][0]["height_m"] - 0.005266) < 5e-5' &&
    ok "the scene with the identified material creeps like the dough" || fail "the identified material creeps differently"

odd=$'a, "b"\n\001\303.csv'
cp 50gf.csv "$odd"
knead identify creep "$odd" --no-models --csv odd-fit.csv --out odd-name.yaml >out 2>err || fail "odd name: $(cat err)"
python3 -c 'import csv
rows = list(csv.reader(open("odd-fit.csv", newline="", encoding="latin-1")))
assert all(len(r) == 6 for r in rows) and rows[1][0].startswith("a, \"b\""), rows[:2]' &&
    grep -q '^# Identified by knead identify creep from a, "b"???.csv: 1 curve' odd-name.yaml &&
    ok "commas, quotes and line ends in a file name are safe in the table and in the material" || fail "odd name: $(head -3 odd-fit.csv odd-name.yaml)"
sed 's/^material: .*/material: odd-name.yaml/' scene.yaml >odd-scene.yaml
knead check odd-scene.yaml >check.txt 2>err && ok "a scene loads the material from the file with the odd name" || fail "odd name: $(cat err)"

knead identify creep 50gf.csv >one.txt 2>err || fail "one load: $(cat err)"
grep -q '^P0 *<= ' one.txt && grep -q '^P1 *>= ' one.txt && grep -q 'cannot be told apart from P0 and P1' one.txt &&
    grep -q 'not known separately' one.txt && ok "one load gives bounds of P0 and P1, and says which parameters are not known separately" || fail "one load"

awk -F, 'NR == 100 { $2 += 2 } { print }' OFS=, 50gf.csv >outlier.csv
knead identify creep outlier.csv --no-models | grep -q 'outlier.csv:100:1: left out as an outlier, .* standard deviations' && ok "the outlier is left out and its line is reported" || fail "outlier"

knead identify creep 10gf.csv 50gf.csv --report page --png fit.png >page.txt 2>err || fail "--report: $(cat err)"
python3 - <<'PY' && ok "--report writes one page with all its pictures and links, and tells how lattices of the element's parameters creep" || fail "page"
import os, re
page = open("page/index.html", encoding="utf-8").read()
assert all(os.path.getsize("page/" + name) > 100 for name in re.findall(r'(?:src|href)="([^"#:]+)"', page))
assert len(re.findall('<img[^>]* alt="[^"]{10}', page)) == len(re.findall("<img", page)) >= 3
row = re.search(r"lattice of scene.yaml.*?10gf(.*?)</tr>", page, re.S).group(1)
strain, diagonals, gas = [float(x) for x in re.findall(r">\s*([0-9.]+)\s*<", row)]
assert 0.03 < strain < 0.05 and 2 < gas < 12 and 2 < diagonals < 25 and "No lattice was fitted" in page, (strain, diagonals, gas)
PY
png fit.png && ok "--png writes a PNG" || fail "--png"
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

sed 's/^# release.*//' 50gf.csv >unsaid.csv
knead identify creep unsaid.csv --no-models --report unsaid --out unsaid.yaml >unsaid.txt 2>err
[ $? = 1 ] && grep -Eq '^knead identify creep: --out unsaid.yaml: not written, no scene accepts it: material.alpha is [0-9.e+]* Pa\*s, out of range, expected a number from 1e-06 to 1e\+15 Pa\*s$' err &&
    [ "$(wc -l <err)" = 1 ] && [ ! -e unsaid.yaml ] && grep -q '^note: no scene accepts this material' unsaid.txt && [ -s unsaid/index.html ] &&
    [ ! -e unsaid/material.yaml ] && ! grep -q 'What a lattice does' unsaid/index.html && ok "a material outside the range of a scene is not written, and its report says so" ||
    fail "a material outside the range of a scene is not refused: $(cat err)"
refuses 2 "knead identify creep: --density 40 g/cm^3: expected a density like '1.2 g/cm^3', 1 to 30000 kg/m^3" identify creep 50gf.csv --density '40 g/cm^3'

mkdir late && cd late && curves 10gf,50gf,70gf 0.001
awk -F, 'NR > 5 { $1 += 0.15 } { print }' OFS=, 70gf.csv >late70.csv
knead identify creep 10gf.csv 50gf.csv late70.csv --no-models >late.txt 2>err && grep -q 'note: late70.*--late' late.txt &&
    knead identify creep 10gf.csv 50gf.csv late70.csv --no-models --late | grep -q 'late70 .*applied 0.1[0-9]* s late' &&
    ok "a late load is suspected without --late and found with --late" || fail "late: $(cat late.txt)"
cd ..

# --serve: the lattice repeats the curve, and --out is a scene.
knead creep dough --load 10gf --hold 10 --rest 0 --csv small.csv >/dev/null
knead identify creep small.csv --height 1cm --area 1cm^2 --no-models --serve b --out served.yaml --report served --json >served.json || fail "--serve: exit $?"
json served.json 'o["structure"] == "b" and o["lattice"][0]["left"] < 0.01 and o["lattice"][0]["left_before"] > 0.05' &&
    knead check served.yaml | grep -q "^pressure .*each closed" && knead check served.yaml | grep -q "^label *fitted to small.csv: cells of 5 mm, gas in the cells, diagonals of 8 %" &&
    grep -q 'The lattice of scene.yaml' served/index.html && (cd served && knead check scene.yaml >/dev/null) &&
    ok "with --serve the lattice repeats the curve within 1 %, and the scene is served, also by the page" || fail "--serve: $(cat served.json served.yaml)"
begun=yes refuses 2 "knead identify creep: small.csv: --serve: cells of 1 mm do not fit the specimen, expected a --spacing for 2 to 8 cells along each side" \
    identify creep small.csv --height 1cm --area 1cm^2 --serve b --spacing 1mm
knead creep dough --load 10gf,90gf --hold 3 --rest 3 --csv all.csv >/dev/null
awk 'NR == 1 || NR % 20 == 2' all.csv >large.csv
stiff() { knead identify creep large.csv --height 1cm --area 1cm^2 --no-models --serve a --out stiff.yaml "$@" >out 2>err; }
stiff
[ $? = 1 ] && [ ! -e stiff.yaml ] && grep -q "^knead identify creep: --out stiff.yaml: not written, a lattice with diagonals leaves up to" err &&
    stiff --anyway && grep -q ": too much" stiff.yaml && knead check stiff.yaml >/dev/null &&
    ok "the scene of a lattice that does not follow is not written, or with --anyway says so in its label" || fail "stiff: $(cat err)"
refuses 2 "knead identify creep: --serve d: expected a structure of the first paper: a, b or c" identify creep small.csv --serve d
refuses 2 "knead identify creep: expected a file of readings, CSV; --help lists its columns" identify creep
refuses 2 "knead identify creep: --load 0: expected a weight or force like 50gf or '0.5 N'" identify creep 50gf.csv --load 0
refuses 2 "knead identify creep: --height 5 s: expected a length like '1 cm'" identify creep 50gf.csv --height '5 s'
refuses 2 "knead identify creep: --bogus: unknown option; --help lists them" identify creep 50gf.csv --bogus
refuses 2 "knead identify creep: 50gf.csv: exists and was not written by knead identify, expected another name" \
    identify creep 10gf.csv --out 50gf.csv
[ "$(head -1 50gf.csv)" = "# load: 50 gf" ] && ok "the refused --out leaves the readings unchanged" || fail "50gf.csv was changed"
exit $failed
