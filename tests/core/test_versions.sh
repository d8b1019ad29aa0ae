#!/usr/bin/env bash
# The table "Interfaces" of CHANGELOG.md says what the tree is: versions as in the code, and a fingerprint of each
# interface, so that a change cannot be released without a word.
set -u
fail=0
cd "$KN_SOURCE" || exit 1
cell() { awk -F' *[|] *' -v name="$1" -v column="$2" '$2 == name { print $column }' CHANGELOG.md; }
version() { # version NAME VERSION-IN-THE-CODE
    [ "$(cell "$1" 3)" = "$2" ] && echo "ok   $1 $2" && return
    echo "FAIL CHANGELOG.md says $1 '$(cell "$1" 3)', the code $2" && fail=1
}
fingerprint() { # fingerprint NAME: of the standard input; not at the end of a pipe, where `fail` would be lost
    local now
    now=$(sha256sum | cut -c1-8)
    [ "$(cell "$1" 5)" = "$now" ] && echo "ok   $1: $now" && return
    echo "FAIL $1 has changed: raise its version in CHANGELOG.md, add a line on the change, and state the fingerprint $now" && fail=1
}
constant() { sed -nE "s/^#define $2 +([0-9]+).*/\1/p" "$1"; }
without_comments() { sed 's|//.*||' "$@" | tr -s ' \n' ' '; }

fingerprint scene < <("$KN_BUILD/bin/knead" check --keys)
fingerprint wire < <(without_comments proto/*.lcm)
fingerprint log < <(without_comments proto/*.lcm && grep -oE '0x[0-9a-f]{16}' tests/golden/test_golden.c)
version snapshot "$(constant server/snapshot_file.c FORMAT).$(constant core/snapshot.c LAYOUT)"
map=$(sed -n 's/.*KN_ENGINE_VERSION = 0x\([0-9]*\),/\1/p' hdl/registers.h)
version "register map" "$((16#${map:0:4})).$((16#${map:4:2})).$((16#${map:6:2}))"
fingerprint "register map" < <(grep -oE '(REGISTER|COMMAND|WINDOW|BIT|FIELD)\([^"]*' hdl/registers.h)
fingerprint ABI <core/libknead.abi
library=$(find "$KN_BUILD/core" -name libknead.so)
[ -z "$library" ] || version ABI "$(objdump -p "$library" | sed -n 's/.*SONAME *libknead.so.//p')" # no library with sanitizers
exit $fail
