#!/bin/busybox sh
# The first process in the guest of test_pci.sh. Each fact is a line "guest: ..." on the serial console. The last one is
# "guest: end"; without it, the test has failed.
/bin/busybox --install -s /bin
export PATH=/bin LD_LIBRARY_PATH=/lib KNEAD_CONTROL=/tmp/control
mount -t proc proc /proc
mount -t sysfs sysfs /sys
mount -t devtmpfs devtmpfs /dev
mount -t tmpfs tmpfs /tmp
mkdir /dev/shm
mount -t tmpfs tmpfs /dev/shm
ip link set lo up
ip route add 224.0.0.0/4 dev lo
cd /tmp
say() { echo "guest: $*"; }
in_step() { knead ctl status | grep -q 'state  *in_step'; }
await() { until "$@"; do kill -0 $server && sleep 0.1 || return; done; }

# served WAY: kneadd on the card, with a press. Then the card is removed and found again under the running kneadd.
served() {
    kneadd /scene.yaml --backend "pcie:$bdf" --control control >log 2>err & server=$!
    await grep -qs serving log || { say "$1: no server: $(cat err)" && return; }
    await in_step
    knead probe --path poke --quiet
    say "$1: press: exit $?, $(knead ctl status | grep force_max_n)"
    sleep 2 # ticks without a hand are cheaper
    echo 1 >$card/remove
    say "$1: removed: $(ls -d $card 2>&1)"
    sleep 0.5
    in_step && say "$1: in step without a card"
    echo 1 >/sys/bus/pci/rescan
    [ "$1" = vfio ] || echo 1 >$card/enable
    await in_step && say "$1: found again, in step again, driver: $(readlink $card/driver)"
    sleep 0.5
    kill $server
    wait $server
    say "$1: exit $?"
    grep -hE 'sysfs|circuit (lost|.s answers)|on the circuit,' log err | sed "s/^/guest: $1: /"
}

card=$(dirname "$(grep -l 0x4b4e /sys/bus/pci/devices/*/device)") bdf=${card##*/}
say "$bdf: $(cd $card && cat vendor device class | tr '\n' ' ')BAR 0 $(head -1 $card/resource) $(readlink $card/iommu_group)"
for module in irqbypass vfio vfio_iommu_type1 vfio_virqfd vfio-pci-core vfio-pci; do insmod /$module.ko; done
knead doctor --card $bdf --seconds '1 s' | grep -A 1 isolation >doctor
say "doctor: $(head -1 doctor)"
eval "$(sed -n 's/.*\(echo [0-9a-f ]* | \)sudo \(tee [^;]*\);.*/\1\2/p' doctor)" # as its fix says
say "driver: $(readlink $card/driver), /dev/vfio: $(ls /dev/vfio | tr '\n' ' ')"
served vfio
# An object under gravity that nobody touches takes no ticks. Its card can be removed all the same.
kneadd /scene.yaml --set 'gravity=1 m/s^2' --backend "pcie:$bdf" --control control >log 2>err & server=$!
await grep -qs serving log
await in_step
timeout 5 sh -c "echo 1 >$card/remove"
say "untouched: removed: $(ls -d $card 2>&1)"
kill $server
wait $server
echo 1 >/sys/bus/pci/rescan
echo 1234 4b4e >/sys/bus/pci/drivers/vfio-pci/remove_id
echo $bdf >/sys/bus/pci/drivers/vfio-pci/unbind
echo 1 >$card/enable
served sysfs
mount -t securityfs none /sys/kernel/security
echo integrity >/sys/kernel/security/lockdown
kneadd /scene.yaml --backend "pcie:$bdf" 2>err
say "locked: exit $?: $(cat err)"
say end
reboot -f
