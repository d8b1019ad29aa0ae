#!/usr/bin/env bash
# knead devices on synthetic dev and sys folders, and on this machine: the devices found, and the parts reported
# missing.
set -u
PATH=$KN_BUILD/tests/tools:$PATH
source "$KN_SOURCE/tests/clients/refuses.sh"
has() { grep -qF -- "$1" out || fail "the output lacks: $1"; }
hasnt() { ! grep -qF -- "$1" out || fail "said: $1"; }
usb() { # usb PLACE VENDOR PRODUCT NAME
    mkdir -p "root/sys/bus/usb/devices/$1"
    echo "$2" >"root/sys/bus/usb/devices/$1/idVendor"
    echo "$3" >"root/sys/bus/usb/devices/$1/idProduct"
    printf '%s\n' "$4" >"root/sys/bus/usb/devices/$1/product"
}
tty() { # tty NAME PLACE INTERFACE: make a serial line of that USB device
    mkdir -p root/dev root/sys/class/tty/"$1" root/sys/bus/usb/devices/"$2/$3"
    : >root/dev/"$1"
    ln -s "../../../bus/usb/devices/$2/$3" root/sys/class/tty/"$1"/device
}
export SPNAV_SOCKET=$PWD/spnav.sock

knead devices >out 2>err || fail "exit $? on this machine"
[ ! -s err ] || fail "on stderr: $(cat err)"
has 'spacenavd is not running'
has 'fix: apt install spacenavd; systemctl start spacenavd'
has 'the Inverse Service does not answer at localhost:10001: Connection refused'

mkdir root
knead devices --root root >out || fail "exit $? without any device"
has 'no serial device is plugged in'

usb 1-1 2341 0043 'Arduino Uno'
tty ttyACM0 1-1 1-1:1.0
usb 1-2 0403 6001 'FT232R USB UART'
tty ttyUSB0 1-2 1-2:1.0/ttyUSB0
usb 1-3 0403 cb48 'Falcon HAPTIC'
usb 1-4 046d c626 "$(printf 'Space\033[31mNavigator')"
usb 1-5 046d c077 'a mouse'
chmod 600 root/dev/ttyUSB0
knead devices --root root >out || fail "exit $?"
has 'tty       /dev/ttyACM0  2341:0043  Arduino Uno'
has 'ready: knead hand paddle --tty /dev/ttyACM0, with a scene that has `device: unknown`'
has 'tty       /dev/ttyUSB0  0403:6001  FT232R USB UART'
has '0403:cb48  Falcon HAPTIC'
has 'no driver for Novint Falcon'
has '`device: falcon` in the scene'
has '046d:c626  Space?[31mNavigator'
has 'spacenavd is not running, but a puck is plugged in'
hasnt 'a mouse'

# Devices of makers with libraries of their own: the library is missing, then the permission, then nothing.
usb 1-6 1451 0402 'omega.3'
echo 1 >root/sys/bus/usb/devices/1-6/busnum
echo 12 >root/sys/bus/usb/devices/1-6/devnum
usb 1-7 2988 0302 'Touch'
tty ttyACM1 1-7 1-7:1.0
knead devices --root root >out || fail "exit $?"
has 'libdhd.so.3: cannot open shared object file'
has 'install the Force Dimension SDK, with its folder in LD_LIBRARY_PATH'
has 'libHD.so: cannot open shared object file'
mkdir libraries
cp "$KN_BUILD/tests/tools/libvendor.so" libraries/libHD.so
ln -s libHD.so libraries/libdhd.so.3
LD_LIBRARY_PATH=$PWD/libraries knead devices --root root >out || fail "exit $?"
has '/dev/bus/usb/001/012: No such file or directory'
has 'ready: knead hand touch --no-watchdog, with a scene that has `device: touch`'
mkdir -p root/dev/bus/usb/001
: >root/dev/bus/usb/001/012
LD_LIBRARY_PATH=$PWD/libraries knead devices --root root >out || fail "exit $?"
has 'ready: knead hand forcedimension, with a scene that has `device: omega`'
rm -r root/sys/bus/usb/devices/1-7 root/dev/ttyACM1 root/sys/class/tty/ttyACM1

spacenavd "$SPNAV_SOCKET" 60 & daemon=$!
haply 10001 60 >/dev/null & service=$!
for _ in 1 2 3 4 5 6 7 8 9 10; do
    sleep 0.2
    knead devices --root root --json >out
    [ "$(grep -c '"ready": true' out)" -ge 4 ] && break # both services, the Arduino, the puck
done
/usr/bin/python3 - <<'END' || fail "the JSON differs from its documented form"
import json
found = json.load(open("out"))["devices"]
assert [f["kind"] for f in found] == ["spacenavd", "haply", "tty", "tty", "usb", "usb", "usb"]
assert found[0]["ready"] and found[0]["use"] == "knead hand spacenav" and not found[0]["missing"]
assert found[1]["ready"] and found[2]["usb"] == "2341:0043" and found[4]["profile"] == "falcon"
END
kill $daemon $service

# A user outside of the group.
if [ "$(id -u)" = 0 ] && command -v setpriv >/dev/null; then
    chmod 660 root/dev/ttyUSB0
    chgrp dialout root/dev/ttyUSB0
    chmod 755 . root root/dev libraries
    chmod 600 root/dev/bus/usb/001/012
    LD_LIBRARY_PATH=$PWD/libraries setpriv --reuid 65534 --regid 65534 --clear-groups "$(command -v knead)" devices --root root >out 2>err
    grep -q 'tty' out && { has 'no permission'; has 'fix: sudo usermod -aG dialout $USER, and log in again'
        has '/dev/bus/usb/001/012: Permission denied'
        has "fix: echo 'SUBSYSTEM==\"usb\", ATTR{idVendor}==\"1451\", MODE=\"0666\"' | sudo tee /etc/udev/rules.d/99-haptic.rules; then"; }
fi

knead devices --wood >out 2>err && fail "an unknown option is accepted"
[ "$(wc -l <err)" = 1 ] || fail "an unknown option is not refused in one line"
exit $failed
