#!/bin/sh
# knead doctor: what is there is ok, what is not is named with a fix, and a fix that is carried out is one.
set -u
failures=0
fail() { echo "FAIL $*"; failures=$((failures + 1)); }
knead doctor --seconds 1 >out 2>err
[ $? -le 1 ] || fail "exit on this machine"
[ ! -s err ] || fail "on stderr: $(cat err)"
cat out
grep -q '^ok    route ' out || fail "the route of this namespace is loopback"
grep -q '^\(ok   \|LACKS\) wakes  *of 1000, ' out || fail "no measurement"

if ip route del 224.0.0.0/4 dev lo; then
    knead doctor --seconds 1 >out
    [ $? = 1 ] || fail "something is missing, exit 1"
    grep -q '^LACKS route ' out || fail "the route is not there"
    fix=$(sed -n '/^LACKS route/{n;s/.*fix: as root: //p}' out)
    sh -c "$fix" || fail "its fix cannot be carried out: $fix"
    knead doctor --seconds 1 --json >out
    python3 - <<'END' || fail "not the JSON that was promised, or the fix is none"
import json
checks = {c["check"]: c for c in json.load(open("out"))["checks"]}
assert checks["route"]["good"] and checks["route"]["fix"] == ""
assert {"priority", "memory", "buffers", "processors", "instructions", "kernel", "wakes"} <= set(checks)
END
fi
if [ "$(id -u)" = 0 ] && command -v setpriv >/dev/null; then # a user whom nobody granted anything
    cp "$(command -v knead)" .
    chmod 755 . knead
    prlimit --rtprio=0 --memlock=65536 setpriv --reuid 65534 --regid 65534 --clear-groups ./knead doctor --seconds 1 >out
    grep -q '^LACKS priority ' out && grep -q 'fix: .*rtprio 80' out || fail "no real-time priority, and no fix"
    grep -q '^LACKS memory ' out && grep -q 'fix: .*memlock unlimited' out || fail "no locked memory, and no fix"
fi
LCM_DEFAULT_URL=tcpq://localhost knead doctor --seconds 1 >out
grep -q '^LACKS route ' out && grep -q 'fix: unset LCM_DEFAULT_URL' out || fail "a bus that is none"
for wrong in "--seconds 0" "--seconds 2x" "now" "--fast"; do
    knead doctor $wrong >out 2>err
    [ $? = 2 ] && [ "$(wc -l <err)" = 1 ] && [ ! -s out ] || fail "knead doctor $wrong: $(cat err)"
done
[ $failures = 0 ]
