#!/usr/bin/env bash
# The command line of knead-simdev: help, one line for every mistake, exit codes, a name in use.
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"
program="timeout 5 knead-simdev"

serves() { # serves ARGUMENT...: start the device; set $pid and $uri
    rm -f served # otherwise the loop reads the output of the run before
    knead-simdev "$@" >served 2>served.err &
    pid=$!
    for _ in {1..100}; do
        uri=$(head -1 served 2>/dev/null) && [ -n "$uri" ] && return
        sleep 0.05
    done
    fail "$*: prints no URI, $(cat served.err)"
}

knead-simdev --help >help && head -1 help | grep -q '^usage: knead-simdev' || fail "--help"
for fault in flip drop duplicate truncate delay hang disconnect blank torn hash; do
    grep -q "^      $fault " help || fail "--help does not list $fault"
done
[ "$(knead-simdev --version)" = "knead-simdev $(knead --version | sed 's/^knead //')" ] || fail "--version"
knead-simdev --help >/dev/full 2>err
[ $? -eq 3 ] || fail "--help on a full disk does not exit with 3"

refuses 2 "knead-simdev: connection: expected exactly one of --uart, --bar NAME and --pci"
refuses 2 "knead-simdev: connection: expected exactly one of --uart, --bar NAME and --pci" --uart --bar x
refuses 2 "knead-simdev: --pci: expected the command that runs QEMU behind the options" --pci
refuses 2 "knead-simdev: a/b: expected --bar with a name of 1 to 199 letters, without /" --bar a/b
refuses 2 "knead-simdev: --link: expected --uart with it" --bar x --link y
refuses 2 "knead-simdev: spin=1: expected --fault NAME[=RATE] with a rate of 0 to 1; --help lists the names" --uart --fault flip,spin=1
refuses 2 "knead-simdev: flip=2: expected --fault NAME[=RATE] with a rate of 0 to 1; --help lists the names" --uart --fault flip=2
refuses 2 "knead-simdev: flip: expected --uart, because memory has no frames" --bar x --fault flip
refuses 2 "knead-simdev: --caps 1,2: expected 0..16,0..20,1..10" --uart --caps 1,2
refuses 2 "knead-simdev: --seed 1x: expected a whole number from 0 to 2147483647" --uart --seed 1x
refuses 2 "knead-simdev: --engine fast: expected golden or rtl" --uart --engine fast
refuses 2 "knead-simdev: torn: expected --engine golden, because the circuit steps only on request" --uart --engine rtl --fault torn
refuses 2 "knead-simdev: --caps: expected --engine golden, because the circuit is built for 10,14,10" --uart --engine rtl --caps 1,2,3
refuses 2 "knead-simdev: more: expected options only" --uart more
begun=yes refuses 3 "knead-simdev: none/qemu: No such file or directory" --pci none/qemu
begun=yes refuses 3 "knead-simdev: sh: message 9: expected those of QEMU 7.2" --pci sh -c "printf '\\11%15s' | tr ' ' '\\0' >&3"
begun=yes refuses 3 "knead-simdev: none/link: No such file or directory" --uart --link none/link
echo mine >file
begun=yes refuses 3 "knead-simdev: file: File exists" --uart --link file
[ "$(cat file)" = mine ] || fail "--link overwrote a file of that name"

serves --bar "knead-simdev-$$"
[ "$uri" = "shm:knead-simdev-$$" ] || fail "says $uri"
begun=yes refuses 3 "knead-simdev: knead-simdev-$$: Device or resource busy" --bar "knead-simdev-$$"
kill "$pid"
wait "$pid" || fail "SIGTERM: exit $?"
[ "$(tail -1 served)" = "golden: 0 requests" ] && [ ! -e "/dev/shm/knead-simdev-$$" ] || fail "$(tail -1 served)"

serves --uart --link board
[ "$uri" = pty:board ] && [ -c board ] || fail "says $uri"
kill -INT "$pid" 2>/dev/null || fail "gone"
kill "$pid"
wait "$pid" || fail "exit $?"
[ ! -e board ] || fail "the link is left behind"
[ $failed = 0 ] && echo "ok   knead-simdev refuses bad options in one line and removes its names at the end"
exit $failed
