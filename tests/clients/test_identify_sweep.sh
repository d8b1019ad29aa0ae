#!/usr/bin/env bash
# knead identify sweep: from the moduli of knead sweep back to their element, for every class of figure 2; bad input.
# gate in release: many runs of programs that start slowly with the sanitizers
set -u
. "$KN_SOURCE/tests/clients/refuses.sh"

# swept NOISE SPECIMEN...: write sweep.csv with that share of noise.
swept() {
    local share=$1
    shift
    knead sweep "$@" --csv all.csv >sweep.txt || exit 1
    awk -F, -v share="$share" 'BEGIN { srand(11); print "frequency [Hz];G'"'"' [Pa];G'"''"' [Pa]" }
        function normal(   s, i) { s = -6; for (i = 0; i < 12; i++) s += rand(); return s }
        NR > 1 { printf "%.6g;%.8g;%.8g\n", $1, $2 * (1 + share * normal()), $3 * (1 + share * normal()) }' all.csv >sweep.csv
}

# finds BEST NUMBER=VALUE...: check that this element is named best (-: any) and that its numbers are within 5 %. The
# intervals must hold the truth, or lie near it. An element that contains another one must fit no worse: the sums of
# squares of the logarithms are compared, derived from AICc's equation.
finds() {
    knead identify sweep sweep.csv --json >o.json 2>err || { fail "$1: $(cat err)"; return; }
    python3 - "$(($(wc -l <sweep.csv) - 1))" "$@" <<'PY' && ok "$1: $*; an element that contains another one fits no worse" || fail "$1"
import json, sys
o, n, best = json.load(open("o.json")), 2 * int(sys.argv[1]), sys.argv[2]
rows = {e["expression"]: e for e in o["elements"]}
assert best in (o["best"], "-"), (o["best"], o["verdict"])
for said in sys.argv[3:]:
    name, value = said.split("=")
    number, value = rows[best]["numbers"][name], float(value)
    assert number["known"] == "known" and abs(number["value"] / value - 1) < 0.05, (name, number)
    wide = number["high"] - number["low"]
    assert number["low"] - wide < value < number["high"] + wide and wide < 0.2 * value, (name, number)
within = {"(s|d)-s": ["s|d"], "(s|d)-d": ["s|d", "s-d"], "(s|d)-s-d": ["(s|d)-s", "(s|d)-d", "s-d"],
          "(s|d)-(s|d)": ["(s|d)-s", "(s|d)-d", "s|d"]}
def log_sum(e):
    p = len(e["numbers"]) + 1
    return (e["aicc"] - 2 * p - 2 * p * (p + 1) / (n - p - 1)) / n
for large, small in within.items():
    for s in small:
        assert log_sum(rows[large]) <= log_sum(rows[s]) + 1e-3, (large, s, rows[large]["misfit"], rows[s]["misfit"])
PY
}

range="--frequency 0.0005:5:31"
swept 0.01 voigt --param s1='10 kPa' --param d1='20 kPa*s' $range && finds 's|d' k1=1e4 c1=2e4
swept 0.01 maxwell --param s1='10 kPa' --param d1='50 kPa*s' $range && finds s-d k1=1e4 c2=5e4
swept 0.01 '(s|d)-s' --param s1='10 kPa' --param d1='50 kPa*s' --param s2='20 kPa' $range && finds '(s|d)-s' s1=1e4 d1=5e4 s2=2e4
swept 0.01 burgers --param s1='20 kPa' --param d1='1 MPa*s' --param s2='10 kPa' --param d2='50 kPa*s' $range &&
    finds '(s|d)-s-d' s1=1e4 d1=5e4 s2=2e4 d2=1e6
swept 0.01 'voigt-voigt' --param s1='20 kPa' --param d1='1 MPa*s' --param s2='10 kPa' --param d2='20 kPa*s' $range &&
    grep -q . sweep.csv && finds '(s|d)-(s|d)'
swept 0 dough $range && finds '(s|d)-d'
swept 0.05 dough $range && finds -
swept 0.01 dough $range && finds '(s|d)-d' k1=46091 c1=245166 c2=3842871

knead identify sweep sweep.csv --out dough.yaml --csv fit.csv >dough.txt 2>err || fail "dough: $(cat err)"
grep -q 'c2 = c_max at rest, not how c2 falls' dough.txt && grep -q 'not how c2 falls' dough.yaml && ok "the output and the material say that a linear sweep does not show the thinning" ||
    fail "the limits of a linear sweep are not stated"
cp "$KN_SOURCE/core/scenes/dough-small.yaml" scene.yaml && sed -i 's/^material: .*/material: dough.yaml/' scene.yaml
knead sweep scene.yaml $range --csv back.csv >out 2>err || fail "scene: $(cat err)"
paste -d, all.csv back.csv | awk -F, 'NR > 1 { a = $8 / $2; b = $9 / $3; if (a > 1.05 || a < 0.95 || b > 1.05 || b < 0.95) exit 1 }' &&
    ok "a scene loads the material that --out wrote, and its sweep is within 5 % of the dough's" || fail "the sweep of the identified material differs"
head -1 fit.csv | grep -q '^curve,frequency_hz,storage_pa,loss_pa,fit_storage_pa,fit_loss_pa$' && [ "$(wc -l <fit.csv)" = 32 ] &&
    ok "--csv writes the moduli and the fit" || fail "--csv"
knead identify sweep sweep.csv --shear --out shear.yaml >out 2>err || fail "--shear: $(cat err)"
awk '$1 == "k1:" { k = $2 } END { exit !(k > 3 * 46091 * 0.95 && k < 3 * 46091 * 1.05) }' shear.yaml && grep -q 'of shear, with E = 3 G' shear.yaml &&
    ok "--shear: the modulus in compression is three times the shear modulus" || fail "--shear"

swept 0.01 burgers --param s1='2 MPa' --param d1='1 MPa*s' --param s2='10 kPa' --param d2='50 kPa*s' --frequency 0.0005:0.5:31
knead identify sweep sweep.csv --out nearest.yaml >out 2>err && grep -q 'a scene cannot have this element; the nearest' out && [ -s nearest.yaml ] &&
    ok "if a scene cannot have the best element, --out writes the nearest one and says so" || fail "nearest: $(cat err)"
far='(s|d)-d, which a scene can load, does not describe these data: it is [0-9.]* % off on average, (s|d)-s-d [0-9.]* %'
grep -q "^note: $far\$" out && grep -q "^# Beware: $far.\$" nearest.yaml && ok "the output and the material state the error of the nearest element" || fail "how far: $(cat out nearest.yaml)"
knead sweep burgers --param s1='50 kPa' --param d1='4 MPa*s' --param s2='46 kPa' --param d2='245 kPa*s' --frequency 0.0001:100 --csv swb.csv >out
knead identify sweep swb.csv --out absurd.yaml >out 2>err
[ $? = 1 ] && [ ! -s absurd.yaml ] && grep -q '^note: .*does not describe these data: it is 1[0-9][0-9] % off' out &&
    grep -q '^knead identify sweep: --out absurd.yaml: not written, .* is 1[0-9][0-9] % off on average: no element' err &&
    ok "an element far from the data is not written as a material" || fail "absurd: $(cat err)"
swept 0 maxwell --param s1='10 kPa' --param d1='50 kPa*s' $range && sed '1s/Pa/MPa/g' sweep.csv >stiff.csv
knead identify sweep stiff.csv --out stiff.yaml >out 2>err
[ $? = 1 ] && [ ! -e stiff.yaml ] && grep -q '^note: no scene accepts this material: material.k1 is 1e+10 Pa, out of range' out &&
    grep -q '^knead identify sweep: --out stiff.yaml: not written, no scene accepts it: material.k1' err && ok "a material outside the range of a scene is not written" ||
    fail "a material outside the range of a scene is not refused: $(cat out err)"
if command -v gnuplot >/dev/null; then
    knead identify sweep sweep.csv --png fit.png --report report >out 2>err || fail "--png, --report: $(cat err)"
    png fit.png && [ -s report/index.html ] && [ -s report/moduli.csv ] && ok "--png, --report" || fail "--png, --report"
fi

refuses 2 "knead identify sweep: expected a file of readings, CSV; --help lists its columns" identify sweep
refuses 2 "knead identify sweep: --strain: unknown option; --help lists them" identify sweep sweep.csv --strain 5%
refuses 2 "knead identify relax: --shear and --compression: expected one of them" identify relax sweep.csv --shear --compression
awk 'BEGIN { print "frequency [Hz],|G*| [Pa],phase angle [deg]"; for (i = 0; i < 12; i++) printf "%g,20909,%d\n", 0.1 + i, i == 3 ? 100 : 30 + i }' >angle.csv
knead identify sweep angle.csv >out 2>err
[ $? = 2 ] && [ "$(cat err)" = "angle.csv:5:1: phase angle of 100 deg, expected one between 0 and 90" ] && ok "a phase angle above 90 degrees is refused with its line" || fail "angle: $(cat err)"
sed -n 1,9p sweep.csv >few.csv
knead identify sweep few.csv >out 2>err && ! grep -q nan out && grep -q ' - ' out && ok "the runs statistic of few readings is shown as -" || fail "few: $(cat out err)"
sed '4s/;[^;]*;/;1e40;/' sweep.csv >beyond.csv
knead identify sweep beyond.csv >out 2>err
[ $? = 2 ] && grep -Eq '^beyond.csv:4:[0-9]*[2-9]: .* in SI units, expected at most 1e\+30$' err && ok "a number above 1e30 is refused with line and column" || fail "beyond: $(cat err)"
refuses 2 "knead identify sweep: -dash.csv: unknown option; --help lists them" identify sweep sweep.csv -dash.csv
refuses 2 "knead identify sweep: --strain=5%: unknown option; --help lists them" identify sweep sweep.csv --strain=5%
if command -v gnuplot >/dev/null && [ -c /dev/full ]; then
    knead identify sweep sweep.csv --png /dev/full >out 2>err
    [ $? = 3 ] && [ "$(cat err)" = "knead identify sweep: /dev/full: No space left on device, nothing drawn" ] && ok "a picture that cannot be written is reported" || fail "/dev/full: $(cat err)"
fi
refuses 2 "knead identify sweep: nowhere.csv: No such file or directory" identify sweep nowhere.csv
mkdir full && : >full/mine && printf 'mine\n' >early.csv
refuses 2 "knead identify sweep: full: is not empty, expected a new folder" identify sweep sweep.csv --csv early.csv --out early.yaml --report full
[ "$(cat early.csv)" = mine ] && [ ! -e early.yaml ] && ok "a report in a folder that is not empty is refused before any file is written" || fail "refused late"
exit $failed
