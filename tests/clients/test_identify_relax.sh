#!/usr/bin/env bash
# knead identify relax: from the curve of knead relax back to its dough, the limits of a hold alone, the best model,
# and bad input.
# gate in release: many runs of programs that start slowly with the sanitizers
set -u
. "$KN_SOURCE/tests/clients/refuses.sh"

knead relax dough --strain 30% --ramp 2%/s --hold 300 --csv all.csv >relax.txt || exit 1

knead identify relax all.csv --out dough.yaml --csv fit.csv --json >o.json 2>err || fail "rise and hold: $(cat err)"
json o.json 'all(o["numbers"][k]["known"] == "known" and abs(o["numbers"][k]["value"] / v - 1) < 0.005 for k, v in
        {"k1": 46091.26, "c1": 245166.25, "alpha": 8002226.4, "beta": 8.31069e-4, "P0": 882.6}.items())' &&
    json o.json '[o["numbers"]["P1"][k] for k in ("known", "high")] == ["at_least", None] and 4000 < o["numbers"]["P1"]["low"] < 7845' &&
    ok "ramp and hold: all parameters but P1 within 0.5 %, and a lower bound of P1" || fail "rise and hold: $(cat o.json)"
[ "$(wc -l <fit.csv)" -gt 100 ] && head -1 fit.csv | grep -q '^curve,held_s,stress_pa,fit_pa,readings$' &&
    awk -F, 'NR > 1 && ($3 / $4 > 1.002 || $3 / $4 < 0.998) { exit 1 }' fit.csv && ok "--csv writes the readings and the fit" || fail "--csv"

python3 - <<'PY' && ok "the verdict names the range that the fit has not seen, and P0 is not known for a fit above P0" || fail "the verdict judges the element outside the fitted range"
import json
o = json.load(open("o.json"))
rows = {r["name"]: r for r in o["models"]}
thins = rows["(s|d)-d thinning"]
assert thins["fitted_error"] < 1e-6 and thins["aicc"] < min(r["aicc"] for r in o["models"]) + 1e-6, rows
assert rows["(s|d)-d thinning above P0"]["not_known"] == ["P0"] and thins["not_known"] == [], rows
assert "The fit shows neither" in o["verdict"] and "no model does both" not in o["verdict"] and o["scale"] == "rise", o
PY

cp "$KN_SOURCE/core/scenes/dough-small.yaml" scene.yaml && sed -i 's/^material: .*/material: dough.yaml/' scene.yaml
knead check scene.yaml >check.txt 2>err && ok "a scene loads the material that --out wrote" || fail "scene: $(cat err)"
said=($(grep '^element' relax.txt))
knead relax scene.yaml --strain 30% --ramp 2%/s --hold 300 --json >back.json &&
    json back.json "abs(o['runs'][0]['held_pa'] / ${said[2]} - 1) < 3e-3 and abs(o['runs'][0]['half_s'] / ${said[4]} - 1) < 5e-3" &&
    ok "the scene with the identified material relaxes like the dough" || fail "the identified material relaxes differently"

# The hold alone, with the strain as a note, without one, and as an option.
awk -F, 'BEGIN { print "# strain: 30 %\ntime [s],stress [Pa]" } NR > 1 && $2 > 0 { printf "%.6f,%.4f\n", $2, $4 }' all.csv >hold.csv
knead identify relax hold.csv --no-models >hold.txt 2>err || fail "hold: $(cat err)"
grep -q '^k1 *>= ' hold.txt && grep -q '^c1/k1 *5\.[23]' hold.txt && grep -q '^alpha/k1 *17[234]' hold.txt &&
    grep -q 'had flowed by the first reading' hold.txt && ok "a hold alone gives c1/k1, alpha/k1 and a lower bound of k1" || fail "hold: $(cat hold.txt)"
awk -F, 'BEGIN { print "time [s],modulus [Pa]" } NR > 1 && $2 > 0 { printf "%.6f,%.4f\n", $2, $4 / 0.3 }' all.csv >modulus.csv
knead identify relax modulus.csv --no-models >modulus.txt 2>err || fail "modulus: $(cat err)"
grep -q 'in units of the modulus' modulus.txt && ! grep -q '^k1 ' modulus.txt && ok "a modulus curve is reported in units of the modulus, without k1" || fail "modulus"
begun=yes refuses 2 "knead identify relax: --out m.yaml: no material without the held strain, expected it in the file or by --strain" identify relax modulus.csv --out m.yaml
knead identify relax modulus.csv --strain 30% --no-models --out m.yaml >with.txt 2>err && grep -q 'k1: .*>= .*nothing had flowed' m.yaml &&
    ok "a modulus curve with --strain gives a material, which states k1 as a bound" || fail "modulus with --strain: $(cat err)"

# A curve of a power law in three parts, like muscle's. No element fits, and the verdict says so.
awk 'BEGIN { print "# strain: 5 %\ntime [s],stress [Pa]"
    for (; i < 500; i++) { t = 0.014 * 10 ^ (i * 0.0097); printf "%.6g,%.6g\n", t, 2000 * t ^ -0.11 / (1 + (t / 250) ^ 0.55) } }' >muscle.csv
knead identify relax muscle.csv --cut 100 --json >muscle.json 2>err &&
    json muscle.json '"a yardstick wins" in o["verdict"] and any("runs of one sign" in n["words"] for n in o["notes"]) and o["models_cut_s"] == 100' &&
    ok "a muscle-like curve: a yardstick wins, and the output says so" || fail "muscle: $(cat err)"
if command -v gnuplot >/dev/null; then
    knead identify relax muscle.csv --png fit.png --report report >out 2>err || fail "--png, --report: $(cat err)"
    png fit.png && [ -s report/index.html ] && [ -s report/material.yaml ] && [ -s report/readings.csv ] &&
        grep -q 'fractional Maxwell' report/index.html && ok "--png, --report" || fail "--png, --report"
fi

refuses 2 "knead identify relax: expected a file of readings, CSV; --help lists its columns" identify relax
refuses 2 "knead identify relax: --noise loud: expected relative or constant" identify relax hold.csv --noise loud
refuses 2 "knead identify relax: --load: unknown option; --help lists them" identify relax hold.csv --load 5gf
refuses 2 "knead identify relax: --strain 150%: expected a share of the height like 10% or 0.1, up to 90 %" identify relax hold.csv --strain 150%
awk 'BEGIN { print "# strain: 10 %\ntime [s],stress [Pa]"; for (i = 1; i < 90; i++) printf "%d,%.1f\n", i, i < 30 ? 1000 : 500 }' >drop.csv
knead identify relax drop.csv --no-models --out drop.yaml >out 2>err
[ $? = 1 ] && grep -q 'not written, no scene accepts it: material.*expected a number' err && [ ! -e drop.yaml ] && grep -q '^beta' out && ok "a stress that drops suddenly is fitted, but gives no material" ||
    fail "drop: $(cat err)"
awk 'BEGIN { print "# strain: 10 %\ntime [s],stress [Pa]"; for (i = 1; i < 60; i++) printf "%d,%.1f\n", i, 1000 + i }' >rise.csv
knead identify relax rise.csv >out 2>err
[ $? = 2 ] && grep -q '^rise.csv:[0-9]*:1: the stress does not fall while the strain is held' err && ok "a stress that rises during the hold is refused" || fail "rise: $(cat err)"
knead identify relax hold.csv modulus.csv >out 2>err
[ $? = 2 ] && grep -q '^modulus.csv: \|^knead identify relax: hold.csv: has a strain' err && ok "a file with a strain and one without are refused together" || fail "mixed: $(cat err)"
knead identify relax modulus.csv all.csv >out 2>err
[ $? = 2 ] && grep -q 'all.csv: has a strain' err && ok "a file without a strain before a ramp with one is refused" || fail "mixed with a rise: $(cat err)"
sed '2s/.*/time [s],stress [Pa],displacement [furlong]/; 3,$s/$/,1/' hold.csv >furlong.csv
knead identify relax furlong.csv --height '1 cm' >out 2>err
[ $? = 2 ] && [ "$(cat err)" = "furlong.csv:2:22: displacement: the unit 'furlong' is unknown, expected a unit of displacement, e.g. m" ] &&
    ok "an unknown unit is refused with its place" || fail "furlong: $(cat err)"
sed 1d hold.csv >strainless.csv
begun=yes refuses 2 "knead identify relax: --out m.yaml: no material without the held strain, expected it in the file or by --strain" identify relax strainless.csv --out m.yaml
awk -F, 'BEGIN { print "# area: 1 cm^2\ntime [s],load [N]" } NR > 2 { printf "%s,%.7g\n", $1, $2 * 1e-4 }' hold.csv >load.csv
knead identify relax load.csv --constant-area --no-models >out 2>err && sed '1i # section: constant' load.csv >section.csv &&
    knead identify relax section.csv --no-models >out 2>err && ok "--constant-area and the note '# section: constant' replace the strain of a load" || fail "load: $(cat err)"
printf 'mine\n' >mine.yaml
knead identify relax hold.csv --no-models --out mine.yaml >out 2>err
[ $? = 2 ] && [ "$(cat mine.yaml)" = mine ] && ok "--out does not overwrite a file of another program" || fail "overwritten: $(cat err)"
mkdir full && : >full/mine && printf 'mine\n' >early.csv
refuses 2 "knead identify relax: full: is not empty, expected a new folder" identify relax hold.csv --csv early.csv --out early.yaml --report full
[ "$(cat early.csv)" = mine ] && [ ! -e early.yaml ] && ok "a report in a folder that is not empty is refused before any file is written" || fail "refused late"
knead identify relax modulus.csv --strain 30% --no-models --out m.yaml >with.txt 2>err && [ "$(ls m.yaml*)" = m.yaml ] &&
    ok "--out replaces its own file and leaves no other file" || fail "m.yaml: $(ls m.yaml*)"
ln -s m.yaml link.yaml
refuses 3 "knead identify relax: link.yaml: is no regular file, expected a file that may be replaced" identify relax modulus.csv --strain 30% --no-models --out link.yaml
exit $failed
