#!/usr/bin/env bash
# The command line of `knead hand`: one line for every mistake, before any device or bus is touched.
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"
expect() { begins 2 "knead hand: $1" knead hand "${@:2}"; } # expect WORDS OPTION...
expect 'expected one device'
expect 'expected one device' paddle paddle --tty x
expect 'no device `glove`' glove
expect 'expected --tty DEVICE' paddle
expect '--baud 115200: expected 230400' paddle --tty x --baud 115200
expect "--force-limit 3: expected something like '3.3 N'" paddle --force-limit 3
expect "--force-limit -1 N: expected something like '3.3 N'" paddle --force-limit '-1 N'
expect "--origin 0,0,6: expected three lengths like '0,0,6 cm'" paddle --origin 0,0,6
expect "--origin 0,0: expected three lengths" paddle --origin 0,0
expect "--origin 0,0,6 cm,7: expected three lengths" paddle --origin '0,0,6 cm,7'
expect "--baud 500000x: expected 230400" paddle --baud 500000x
expect "--origin 0,0,nan m: expected three lengths" paddle --origin '0,0,nan m'
expect '--basis XXZ: the basis is not a permutation' paddle --basis XXZ
expect '--basis X-YZ: the basis is left-handed' paddle --basis X-YZ
expect '--basis XYZX: more than three axes' paddle --basis XYZX
expect '--scale 0: expected a number above 0' paddle --scale 0
expect '--scale: expected a value' paddle --scale
expect '--wood: unknown option' paddle --wood
expect 'tcpq://127.0.0.1: expected udpm' paddle --tty x --lcm-url tcpq://127.0.0.1
expect '--turn 11: expected 0 to 10 rad/s' spacenav --turn 11
expect '--dead 350: expected 1 to 349' spacenav --dead 350
expect '--local: a puck has no motors' spacenav --local
expect "--reach 8: expected something like '8 cm'" spacenav --reach 8
expect '--url localhost: expected ws://HOST:PORT' haply --url localhost
expect '--device a"b: expected an id' haply --device 'a"b'
expect '--device: only for haply and touch' forcedimension --device 1
expect 'touch needs --no-watchdog, because libHD cannot show that the arm drops its force' touch
expect "--preset '': expected a value" haply --preset ''
knead hand --help | grep -q 'UNTESTED ON HARDWARE' || fail "--help does not say what is untested on hardware"
exit $failed
