#!/usr/bin/env bash
# --json of every command that has the option: one JSON object on stdout and nothing else, with the numbers of the
# text output. Absent values are null or missing.
. "$KN_SOURCE/tests/e2e/kneadd.sh"
scene=$KN_SOURCE/core/scenes/dough-small.yaml
pressed "$scene" press.lcmlog || exit 70
# json SENTENCE EXPRESSION COMMAND...: evaluate EXPRESSION in python, with `it` the JSON object and `text` the
# command's output without --json.
json() {
    local sentence=$1 expression=$2
    shift 2
    "$@" >text 2>/dev/null
    "$@" --json >out 2>err
    check "$sentence" python3 -c 'import json, re, sys
it, text = json.load(open("out")), open("text").read()
sys.exit(0 if isinstance(it, dict) and eval(sys.argv[1]) else str(it)[:2000])' "$expression"
}
json "the JSON of creep has the numbers of its text" 'len(it["loads"]) == 2 and it["loads"][1]["load_n"] > 0.68 and "%.4f" % it["loads"][1]["strain"] in text' \
    knead creep dough --load 50gf,70gf
json "the JSON of relax has a held and a final stress" 'it["runs"][0]["held_pa"] > it["runs"][0]["end_pa"] > 0 and it["runs"][0]["of"] == "element"' knead relax dough --strain 30% --ramp 10%/s
json "the JSON of sweep has five frequencies" 'len(it["frequencies"]) == 5 and it["frequencies"][0]["storage_pa"] > 0 and it["frequencies"][0]["frequency_hz"] == 0.01' \
    knead sweep dough --frequency 0.01:1:5
json "the JSON of tpa has the numbers of its text" '"%.4f" % it["runs"][0]["cohesiveness"] in text and it["runs"][0]["hardness_n"] > 1' knead tpa dough
json "the JSON of zwidth has the device and five couplings" 'it["default_calm"] and it["device"] == "touch" and len(it["couplings"]) == 5 and it["hand"] == "none"' knead zwidth --quick
json "the JSON of check has the scene's sizes and probes" 'it["nodes"] == 144 and it["edges"] == 1208 and [p["name"] for p in it["probes"]] == ["plate", "finger"] and it["dt_s"] == 0.001' \
    knead check "$scene"
json "the JSON of check has the warnings" 'any("narrower" in w["text"] for w in it["warnings"]) and it["warnings"][0]["text"] in text' \
    knead check "$scene" --set 'probes.plate.size=[5 mm, 5 mm]'
json "the JSON of replay has the numbers of its text" 'it["hash"] in text and "%.3f N" % it["peak_contact_force_n"] in text and it["ticks"] > 4000' knead replay press.lcmlog --hash
json "the JSON of stability counts every cell" 'it["bad"] == 0 and it["families"][0]["right"] + it["families"][0]["refused"] == it["cells"]' \
    knead stability --quick --family bar
json "the JSON of tradeoff has points with times" 'len(it["points"]) > 0 and any(p["own"] for p in it["points"]) and it["points"][0]["median_us"] > 0' \
    knead tradeoff "$scene" press.lcmlog --quick --solver blend --iterations 4 --precision f32
json "the JSON of devices is an object" '"devices" in str(it)' knead devices
json "the JSON of doctor is not empty" 'len(it) > 0' knead doctor --seconds 1
for command in "creep nosuch" "replay nosuch.lcmlog" "check nosuch.yaml" "zwidth --device nosuch"; do
    knead $command --json >out 2>err
    check "knead $command: one line on stderr and nothing on stdout" eval '[ ! -s out ] && [ $(wc -l <err) = 1 ]'
done
knead replay press.lcmlog --json >/dev/full 2>err
got=$?
check "a full disk is reported: $(cat err)" [ $got = 3 ]

start_kneadd dough-small.yaml
$ahead knead probe --path poke --csv poke.csv --json >out 2>err
stop_kneadd
check "the JSON of probe has the numbers of its text" python3 -c 'import csv, json
it = json.load(open("out"))
peak = max(sum(float(r[f"contact_f{k}_n"]) ** 2 for k in "xyz") ** 0.5 for r in csv.DictReader(open("poke.csv")))
assert it["tool"] == "finger" and it["contact_s"] > 0.05 and it["hold_end_n"] is None and it["peak_n"] <= peak * 1.000001, it'
exit $failed
