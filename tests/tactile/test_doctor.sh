#!/usr/bin/env bash
# knead doctor: present items are ok, missing ones are named with a fix, and a fix that is carried out works.
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"
knead doctor --seconds '1500 ms' >out 2>err
[ $? -le 1 ] || fail "the exit code on this machine is above 1"
[ ! -s err ] || fail "on stderr: $(cat err)"
cat out
grep -q '^ok    route ' out || fail "the loopback route of this namespace is not reported as ok"
grep -q '^\(ok   \|LACKS\) wakes  *of 1500, ' out || fail "no measurement of the wake-ups"

if ip route del 224.0.0.0/4 dev lo; then
    knead doctor --seconds 1 >out
    [ $? = 1 ] || fail "the exit code without a route is not 1"
    grep -q '^LACKS route ' out || fail "the missing route is not reported"
    fix=$(sed -n '/^LACKS route/{n;s/.*fix: as root: //p}' out)
    sh -c "$fix" || fail "the proposed fix fails: $fix"
    knead doctor --seconds 1 --json >out
    python3 - <<'END' || fail "the JSON differs from its documented form, or the fix did not work"
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
    grep -q '^LACKS priority ' out && grep -q 'fix: .*rtprio 80' out || fail "missing real-time priority is not reported with a fix"
    grep -q '^LACKS memory ' out && grep -q 'fix: .*memlock unlimited' out || fail "missing locked memory is not reported with a fix"
fi

# The groups: 4001 may command the service, 4002 owns the serial lines. 4003 owns a line that only root may open, so
# no user needs 4003.
card=root/sys/bus/pci/devices/0000:01:00.0 # a PCI card, to which kneadd has another way in each run
mkdir -p root/dev/vfio $card root/sys/kernel/security
echo pci:v00001234d000011E8sv00001AF4sd00001100bc12sc00i00 >$card/modalias
touch $card/resource0 root/dev/vfio/7
touch root/dev/ttyACM0 root/dev/ttyACM1 root/dev/ttyUSB0
if chown 0:4002 root/dev/ttyACM? 2>/dev/null && chown 0:4003 root/dev/ttyUSB0 && unshare -m true 2>/dev/null &&
    setpriv --reuid 65534 --regid 65534 --clear-groups true 2>/dev/null; then
    chmod 600 $card/resource0 && chown 0:4001 root/dev/vfio/7 && chmod 660 root/dev/vfio/7
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
            ./knead doctor --root root --card 0000:01:00.0 --seconds 1' as_nobody "$1" >out
        [ $? = 1 ] || fail "groups $1, member of $2: the exit code is not 1"
    }
    line() { sed -n "/^$1 *group *$2, /{n;s/^ *fix: //p}" out; }
    as_nobody 65534 ""
    [ "$(line LACKS knead)" = 'sudo usermod -aG knead $USER; log in again' ] || fail "a missing membership of knead is not reported: $(cat out)"
    [ "$(line LACKS serial)" = 'sudo usermod -aG serial $USER; log in again' ] || fail "a missing membership of serial is not reported: $(cat out)"
    [ "$(grep -c ' group  *serial, owns /dev/ttyACM0' out)" = 1 ] || fail "the group of two serial lines is not reported once: $(cat out)"
    grep -q 'closed' out && fail "a group without access by the file mode is reported: $(cat out)"
    grep -q '^LACKS card .* by sysfs, .*/resource0: Permission denied$' out || fail "a card of root: $(cat out)"
    grep -q '^LACKS isolation .* no IOMMU group' out || fail "a card without an IOMMU: $(cat out)"
    ln -s ../../../../kernel/iommu_groups/7 $card/iommu_group
    ln -s ../../drivers/vfio-pci $card/driver
    as_nobody 65534 "knead serial"
    grep -q '^LACKS card .* by vfio-pci, root/dev/vfio/7: Permission denied$' out || fail "a group of root: $(cat out)"
    for group in knead serial; do
        [ "$(line LACKS $group)" = 'log in again: this session is older than the membership' ] || fail "a session older than the membership of $group is not reported: $(cat out)"
    done
    as_nobody 4001,4002 "knead serial"
    [ "$(grep -c '^ok  *group .*: a member$' out)" = 2 ] && ! grep -q '^LACKS group' out || fail "a member of both groups is not reported as ok: $(cat out)"
    grep -q '^ok    tty  *.*/dev/ttyACM1' out || fail "a serial line open to the group is not reported as ok: $(cat out)"
    [ "$(grep -c '^ok  *card .* by vfio-pci, .*can be opened$\|^ok  *isolation .* group 7, driver vfio-pci$' out)" = 2 ] ||
        fail "a card that is bound to vfio-pci: $(cat out)"
    ln -sfT ../../drivers/xdma $card/driver
    echo 'none [integrity] confidentiality' >root/sys/kernel/security/lockdown
    knead doctor --root root --card 0000:01:00.0 --seconds 1 >out
    grep -q '^LACKS card .* by sysfs, .*refused, since this kernel is locked down$' out || fail "lockdown: $(cat out)"
    grep -q 'echo 0000:01:00.0 | sudo tee .*/xdma/unbind; echo 1234 11e8 | sudo tee .*/vfio-pci/new_id;' out || fail "how to bind: $(cat out)"
    grep -q '^LACKS group' out && fail "root is asked for a group: $(cat out)"
else
    echo "groups not tested: no root or no mount namespace"
fi
LCM_DEFAULT_URL=tcpq://localhost knead doctor --seconds 1 >out
grep -q '^LACKS route ' out && grep -q 'fix: unset LCM_DEFAULT_URL' out || fail "a bus URL of another kind is not reported with a fix"
for wrong in "--seconds 0" "--seconds 2x" "now" "--fast" "--root" "--card 01:00.0"; do
    knead doctor $wrong >out 2>err
    [ $? = 2 ] && [ "$(wc -l <err)" = 1 ] && [ ! -s out ] || fail "knead doctor $wrong: $(cat err)"
done
exit $failed
