#!/usr/bin/env bash
# Touch messages over the bus: kneadd --touch with a virtual hand, shown by knead touch as lines and as JSON. Without
# --touch there are none.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

expect 'knead touch: --seconds 0: expected a time from 0.1 to 86400 s' 2 knead touch --seconds 0
expect 'knead touch: --probe a.b: expected a tool' 2 knead touch --probe a.b
expect 'knead touch: tcpq://127.0.0.1:7700: expected udpm' 2 \
    knead touch --lcm-url tcpq://127.0.0.1:7700

start_kneadd dough-small.yaml
send plate <<<"poses 100000 session=7 seq=1" >/dev/null & hand=$!
expect 'knead touch: no KNEAD_TOUCH_plate for [0-9.]* s: is kneadd running with --touch' 3 knead touch --probe plate \
    --seconds 1
kill $hand
stop_kneadd

start_kneadd dough-small.yaml --touch
knead touch --probe plate --once --seconds 20 >once.txt 2>once.err & once=$!
knead touch --json --seconds 9 >all.json 2>json.err & all=$!
check "a hand presses" $ahead knead probe --path press --hold '0.5 s' --quiet --record press.lcmlog
check "the first contact is reported" ended $once
check "all contacts are reported as JSON" ended $all
cat once.txt once.err json.err
check "the first contact is one line with area, peak, centre and slip" grep -qE '^[0-9.]+ s, plate: area [0-9.]+ cm2, peak [0-9.]+ kPa, centre .* slip .* mm/s$' once.txt
check "only the first contact is printed" [ "$(wc -l <once.txt)" = 1 ]
check "each contact is one line of JSON" python3 - all.json <<'PY'
import json, sys
lines = [json.loads(line) for line in open(sys.argv[1])]
touched = [p for p in lines if p["area_m2"] > 0]
assert len(touched) > 50, len(touched)
for p in touched:
    force = sum(map(sum, p["pressure_pa"])) * 0.01 * 0.06 / 64
    assert len(p["pressure_pa"]) == 8 and force > 0 and p["normal"] == [0, 0, 1], p
    assert all(abs(v) < 0.006 for v in p["centre_m"]), p["centre_m"]
    assert p["peak_pressure_pa"] * p["area_m2"] >= force
steps = [b["pose_seq"] - a["pose_seq"] for a, b in zip(lines, lines[1:]) if a["session"] == b["session"]]
assert sorted(steps)[len(steps) // 2] == 4, "a patch every fourth pose"
PY
check "a press with touch patches replays to the bit" knead replay press.lcmlog --verify
expect 'knead touch: no KNEAD_TOUCH_finger for [0-9.]* s' 3 knead touch --probe finger --seconds 0.5
if command -v script >/dev/null; then
    $ahead knead probe --path poke --probe finger --quiet & hand=$!
    script -qec 'knead touch --probe finger --seconds 6' screen.txt >/dev/null
    wait $hand
    check "on a terminal the pressure is drawn as a picture" grep -q '@@.*kPa' screen.txt
    check "the picture is redrawn in place" grep -qF "$(printf '\033')[11A" screen.txt
fi
stop_kneadd
exit $failed
