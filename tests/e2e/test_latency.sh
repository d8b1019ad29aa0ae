#!/usr/bin/env bash
# knead latency starts a kneadd of its own or uses a running one. It counts every pose and writes its measurements.
# timed.latency tests how long a pose waits.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
small=$KN_SOURCE/core/scenes/dough-small.yaml
# counted FILE 1|0: check for 1000 poses; 1: each stage of kneadd has one entry per pose with a tick; 0: no entries
counted() {
    python3 - "$@" <<'END'
import json, sys
series, own = json.load(open(sys.argv[1]))["series"], int(sys.argv[2])
pose = series["pose_to_force"]
assert pose["count"] == series["lcm_echo"]["count"] == 1000, pose
for name in "receive", "wait", "step", "guard", "publish":
    assert series[name]["count"] == own * (pose["count"] - pose["missed"]), (name, series[name], pose)
END
}
expect 'knead latency: --slow: unknown option; --help lists them$' 2 knead latency "$small" --slow
expect '--seconds 0: expected a time from 1 to 3600 s$' 2 knead latency "$small" --seconds 0
expect '--contract 60: expected two times, like .60 us,150 us., or none$' 2 knead latency "$small" --contract 60
expect '--phase lose: expected lock or free$' 2 knead latency "$small" --phase lose
expect '--phase lose: expected lock or free$' 2 kneadd "$small" --phase lose
expect 'nope.yaml:1:1: ' 2 knead latency nope.yaml
expect 'no/where.png: ' 3 knead latency "$small" --png no/where.png
expect 'no KNEAD_SCENE for 4 s: ' 3 knead latency --lcm-url 'udpm://239.255.76.67:7700?ttl=0'
check "one second is measured" eval 'knead latency "$small" --seconds 1 --contract 1s,1s --drift 500 --json --png own.png >own.json'
cat out
check "every pose is counted" counted own.json 1
check "the plot is a PNG" eval 'head -c 4 own.png | grep -q PNG'
start_kneadd dough-small.yaml --trace trace.csv
check "an already running kneadd is measured" \
    eval 'knead latency --lcm-url "udpm://239.255.76.67:7667?ttl=0" --seconds 1 --contract none --json >there.json'
cat out
check "for the running kneadd every pose is counted and no stage" counted there.json 0
stop_kneadd
check "kneadd's trace has a row per tick with a hand, with its stages in order: wake, step, guard" python3 - <<'END'
import csv, json
pose = json.load(open("there.json"))["series"]["pose_to_force"]
rows = [{k: v if k == "probe" else int(v) for k, v in row.items()} for row in csv.DictReader(open("trace.csv"))]
assert len(rows) >= pose["count"] - pose["missed"] > 0 and {row["probe"] for row in rows} == {"plate"}, len(rows)
assert all(a["tick"] < b["tick"] for a, b in zip(rows, rows[1:]))
assert all(a["seq"] <= b["seq"] for a, b in zip(rows, rows[1:]) if a["session"] == b["session"])
assert all(row["woke_ns"] <= row["stepped_ns"] <= row["guarded_ns"] and row["arrived_ns"] <= row["guarded_ns"] for row in rows)
END
expect '--trace nowhere/trace.csv: No such file or directory' 3 kneadd "$small" --trace nowhere/trace.csv
exit $failed
