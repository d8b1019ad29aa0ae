#!/usr/bin/env bash
# knead doctor: present items are ok, missing ones are named with a fix, and a fix that is carried out works.
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"
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
assert {"priority", "memory", "buffers", "processors", "instructions", "kernel", "group", "wakes"} <= set(checks)
END
fi
if setpriv --reuid 65534 --regid 65534 --clear-groups true 2>/dev/null; then # a user without any special rights
    cp "$(command -v knead)" .
    chmod 755 . knead
    prlimit --rtprio=0 --memlock=65536 setpriv --reuid 65534 --regid 65534 --clear-groups ./knead doctor --seconds 1 >out
    grep -q '^LACKS priority ' out && grep -q 'fix: .*rtprio 80' out || fail "no real-time priority, and no fix"
    grep -q '^LACKS memory ' out && grep -q 'fix: .*memlock unlimited' out || fail "no locked memory, and no fix"
fi

# The groups: 4001 may command the service, 4002 owns the serial lines. 4003 owns a line that only root may open, so
# no user needs 4003.
mkdir -p root/dev
touch root/dev/ttyACM0 root/dev/ttyACM1 root/dev/ttyUSB0
if chown 0:4002 root/dev/ttyACM? 2>/dev/null && chown 0:4003 root/dev/ttyUSB0 && unshare -m true 2>/dev/null &&
    setpriv --reuid 65534 --regid 65534 --clear-groups true 2>/dev/null; then
    chmod 660 root/dev/ttyACM? && chmod 600 root/dev/ttyUSB0 && chmod 755 root root/dev
    # as_nobody GROUPS MEMBERS: run knead doctor as nobody. The session has the groups GROUPS; the group file lists
    # nobody in MEMBERS ("knead serial").
    as_nobody() {
        grep -v -e '^knead:' -e ':400[123]:' /etc/group >group
        for name in knead:4001 serial:4002 closed:4003; do
            case " $2 " in *" ${name%:*} "*) member=nobody ;; *) member= ;; esac
            echo "${name%:*}:x:${name#*:}:$member" >>group
        done
        unshare -m sh -c 'mount --bind group /etc/group && exec setpriv --reuid 65534 --regid 65534 --groups "$1" \
            ./knead doctor --root root --seconds 1' as_nobody "$1" >out
        [ $? = 1 ] || fail "groups $1, in $2: an exit that is not 1"
    }
    line() { sed -n "/^$1 *group *$2, /{n;s/^ *fix: //p}" out; }
    as_nobody 65534 ""
    [ "$(line LACKS knead)" = 'sudo usermod -aG knead $USER; log in again' ] || fail "no member of knead: $(cat out)"
    [ "$(line LACKS serial)" = 'sudo usermod -aG serial $USER; log in again' ] || fail "no member of serial: $(cat out)"
    [ "$(grep -c ' group  *serial, owns /dev/ttyACM0' out)" = 1 ] || fail "one line for one group: $(cat out)"
    grep -q 'closed' out && fail "a group that the mode grants nothing: $(cat out)"
    as_nobody 65534 "knead serial"
    for group in knead serial; do
        [ "$(line LACKS $group)" = 'log in again: this session is older than the membership' ] || fail "older than $group: $(cat out)"
    done
    as_nobody 4001,4002 "knead serial"
    [ "$(grep -c '^ok  *group .*: a member$' out)" = 2 ] && ! grep -q '^LACKS group' out || fail "a member of both: $(cat out)"
    grep -q '^ok    tty  *.*/dev/ttyACM1' out || fail "a line that the group opens: $(cat out)"
    knead doctor --root root --seconds 1 >out
    grep -q '^LACKS group' out && fail "root needs no group: $(cat out)"
else
    echo "nothing tried of groups: no root, no mount namespace"
fi
LCM_DEFAULT_URL=tcpq://localhost knead doctor --seconds 1 >out
grep -q '^LACKS route ' out && grep -q 'fix: unset LCM_DEFAULT_URL' out || fail "a bus that is none"
for wrong in "--seconds 0" "--seconds 2x" "now" "--fast" "--root"; do
    knead doctor $wrong >out 2>err
    [ $? = 2 ] && [ "$(wc -l <err)" = 1 ] && [ ! -s out ] || fail "knead doctor $wrong: $(cat err)"
done
exit $failed
