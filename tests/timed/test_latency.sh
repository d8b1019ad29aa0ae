#!/usr/bin/env bash
# knead latency: a pose waits much less for its tick when the ticks follow the poses than when they are on a grid of
# their own. Everything is counted, and the contract has its exit codes. Bad input: e2e.latency.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"
small=$KN_SOURCE/core/scenes/dough-small.yaml

# print a number of a series in the JSON: of NAME KEY FILE
of() { /usr/bin/python3 -c 'import json, sys; print(json.load(open(sys.argv[3]))["series"][sys.argv[1]][sys.argv[2]])' "$@"; }
sound() { # counts agree, percentiles rise, the stages do not exceed the total
    /usr/bin/python3 - "$1" <<'END'
import json, sys
series = json.load(open(sys.argv[1]))["series"]
pose, stages = series["pose_to_force"], ["receive", "wait", "step", "guard", "publish"]
assert pose["count"] == series["lcm_echo"]["count"] > 0
for name, s in series.items():
    shown = [s[k] for k in ("p50_us", "p90_us", "p99_us", "p99_9_us", "max_us")]
    assert all(a <= b for a, b in zip(shown, shown[1:]) if b is not None), name
for name in stages + ["execution"]:
    assert series[name]["count"] == pose["count"] - pose["missed"], name
assert 0.5 * pose["p50_us"] < sum(series[name]["p50_us"] for name in stages) < 1.5 * pose["p50_us"]
END
}

[ "$KN_REALTIME" != off ] && chrt -f 90 true 2>/dev/null || { echo "skipped: no SCHED_FIFO here" && exit 77; }

# A hand of 500 ppm passes two periods of a free grid in 4 s.
measure() { knead latency "$small" --seconds 4 --drift 500 "$@" 2>said.err; }
measure --phase free --contract 0s,0s --json >free.json
free_code=$?
measure --phase lock --contract 1e9us,1e9us --json --png lock.png >lock.json
lock_code=$?
cat said.txt said.err
check "a contract that no free clock keeps is missed" [ $free_code = 1 ]
check "one that every machine keeps is kept" [ $lock_code = 0 ]
for phase in free lock; do
    check "$phase: counts agree, percentiles rise, stages make up the whole" sound $phase.json
    check "$phase: 4 s of poses" [ "$(of pose_to_force count $phase.json)" = 4000 ]
done
free_us=$(of wait p50_us free.json) lock_us=$(of wait p50_us lock.json)
check "with the lock a pose waits less than half as long: $lock_us of $free_us us" \
    awk "BEGIN { exit !($lock_us < 0.5 * $free_us) }"
check "the picture is a PNG" sh -c "head -c 4 lock.png | grep -q PNG"

start_kneadd dough-small.yaml
check "a kneadd that runs already is measured" \
    eval 'knead latency --lcm-url "udpm://239.255.76.67:7667?ttl=0" --seconds 1 --contract none --json >there.json'
check "its forces echo" [ "$(of pose_to_force count there.json)" = 1000 ]
check "its stages are its own" [ "$(of wait count there.json)" = 0 ]
stop_kneadd
exit $failed
