#!/usr/bin/env bash
# clients/examples/weight.c holds a weight on a served cube of dough by force control. The cube sinks as knead creep says.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
cc -O2 -I"$KN_SOURCE/clients" -o weight "$KN_SOURCE/clients/examples/weight.c" -lm || exit 70
start_kneadd dough.yaml --set object.size='[1 cm, 1 cm, 1 cm]' --set support=frictionless --set probes.plate.size='[2 cm, 2 cm]'
$ahead ./weight plate 0.01 0.4903325 8 >sinks.txt
status=$?
check "the client holds 50 gf for 8 s: $(tail -1 sinks.txt)" [ $status = 0 ]
kill -INT $server
wait $server
knead creep "$KN_SOURCE/core/scenes/dough.yaml" --load 50gf --hold 8 --rest 0 --lattice 2x2x2 --json >creep.json
check "the height is within 1 % of knead creep's" python3 - <<'END'
import json
served = float(open("sinks.txt").read().splitlines()[-1].split()[2])
bench = [row["height_m"] for row in json.load(open("creep.json"))["loads"] if row["of"] == "lattice"][0]
print("     served %.5f m, knead creep %.5f m" % (served, bench))
assert bench < 0.9e-2 and abs(served / bench - 1) < 0.01, (served, bench)
END
exit $failed
