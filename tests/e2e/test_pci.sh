#!/usr/bin/env bash
# A card under a real kernel. In QEMU, Debian's kernel finds a PCI function whose registers are knead-simdev's. kneadd
# steps a press on it through vfio-pci and through sysfs. The card is removed and found again under the running kneadd.
# The guest's clock counts its instructions (-icount), so a slow machine or a slow circuit does not delay its ticks.
# night: boots a kernel without KVM, once per engine (KN_ENGINES)
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
for tool in qemu-system-x86_64 busybox dpkg-deb; do command -v $tool >/dev/null || skip "no $tool here (tests/packages)"; done

# The kernel (GPL-2) is unpacked, not installed: an installed one would become this machine's.
guest=$KN_BUILD/tests/guest
if [ ! -e "$guest" ]; then
    read -r _ _ _ parent _ <"/proc/$PPID/stat"
    package=$(apt-cache depends linux-image-cloud-amd64 | sed -n 's/.*Depends: \(linux-image\)/\1/p')
    [ -n "$package" ] || skip "apt knows no linux-image-cloud-amd64"
    nsenter --net="/proc/$parent/ns/net" apt-get download -q "$package" >apt.log 2>&1 || skip "$package: $(tail -1 apt.log)"
    mkdir kernel
    dpkg-deb --fsys-tarfile linux-image-*.deb | tar -x --wildcards './boot/vmlinuz-*' '*/drivers/vfio/*.ko' '*/irqbypass.ko'
    find boot lib -type f -exec mv -t kernel {} +
    mv kernel "$guest"
fi

mkdir -p root/{bin,lib,lib64,proc,sys,dev,tmp,run}
cp "$KN_SOURCE/tests/e2e/guest_init.sh" root/init
cp "$guest"/*.ko root
cp "$(command -v busybox)" root/bin
cp /lib64/ld-linux-x86-64.so.2 root/lib64
for program in kneadd knead; do
    cp "$(command -v $program)" root/bin
    ldd "$(command -v $program)" | grep -oE '/[^ ]+' | xargs -I{} cp -u {} root/lib
done
sed 's/size: .5 cm.*/size: [2 cm, 1 cm, 1 cm]/' "$KN_SOURCE/core/scenes/dough-small.yaml" >root/scene.yaml
echo 'solver: {kind: fixed, passes: 1, iterations: 3}' >>root/scene.yaml
(cd root && find . | busybox cpio -o -H newc) >initrd 2>cpio.err || { cat cpio.err && exit 3; }

said() { grep -qE "^guest: $1" guest.log; }
for engine in ${KN_ENGINES:-golden rtl}; do
    SECONDS=0
    timeout 300 knead-simdev --pci --engine $engine qemu-system-x86_64 -machine q35,memory-backend=ram -m 512 \
        -object memory-backend-memfd,id=ram,size=512M,share=on -accel tcg -icount shift=1,sleep=off \
        -device intel-iommu -device x-pci-proxy-dev,fd=3 -nodefaults -no-user-config -display none -serial stdio -no-reboot \
        -kernel "$guest"/vmlinuz-* -initrd initrd -append "console=ttyS0 intel_iommu=on panic=-1 quiet loglevel=4" >guest.log 2>qemu.err
    echo "     $engine: $SECONDS s, $(tail -1 guest.log)"
    ! has 'without Verilator' qemu.err || [ $failed = 1 ] || skip "$(cat qemu.err)"
    grep '^guest: ' guest.log
    check "$engine: the kernel finds the card, its memory and its IOMMU group" said '0000:.*: 0x1234 0x4b4e 0x120000 BAR 0 0x0*[1-9a-f].*/iommu_groups/'
    check "$engine: knead doctor's fix binds the card to vfio-pci" said 'driver: .*/vfio-pci, /dev/vfio: [0-9]+ vfio'
    check "$engine: kneadd says what sysfs costs, and only there" [ "$(grep -o 'guest: .*without isolation' guest.log)" = \
        'guest: sysfs: kneadd: the card is reached by sysfs: without isolation' ]
    for way in vfio sysfs; do
        check "$engine, $way: a hand presses with a force" said "$way: press: exit 0, *force_max_n  *[1-9.]"
        ticks=$(sed -n "s/^guest: $way: kneadd: \([0-9]*\) ticks on the circuit.*/\1/p" guest.log)
        check "$engine, $way: at least 5000 ticks on the card: $ticks" [ "${ticks:-0}" -ge 5000 ]
        check "$engine, $way: lost when removed, in step again when found again" said "$way: found again, in step again"
        check "$engine, $way: lost once, and always the twin's results" \
            said "$way: kneadd: .* lost 1 times, results different 0, .* at the end its state equals the twin's"
        check "$engine, $way: the kernel removes the card while kneadd has it open" said "$way: removed: ls: .*No such file"
        check "$engine, $way: kneadd ends" said "$way: exit 0"
    done
    check "$engine: the kernel removes the card of an object that takes no ticks" said 'untouched: removed: ls: .*No such file'
    check "$engine: a kernel under lockdown refuses sysfs, and the reason says so" said 'locked: exit 3: .*/resource0: this kernel is locked down'
    check "$engine: the guest reaches its end, and the kernel tells no fault" \
        bash -c "grep -q '^guest: end' guest.log && ! grep -E 'BUG|Oops|DMAR: .*fault|stall|blocked until' guest.log"
    [ $failed = 0 ] || tail -n 40 guest.log qemu.err
done
exit $failed
