#!/usr/bin/env bash
# proto/README.md and REFERENCE.md describe the wire as it is: every type, constant, event and reason of rejection, with its number.
set -u
page=page.md
cat "$KN_SOURCE"/proto/README.md "$KN_SOURCE"/proto/REFERENCE.md >page.md
source "$KN_SOURCE/tests/clients/refuses.sh"

for type in "$KN_SOURCE"/proto/*.lcm; do
    name=$(basename "$type" .lcm)
    grep -q "^|.*\`$name\`" "$page" || fail "$name is in no channel's row"
    # const int32_t FLAG_X = 1;  ->  "1 FLAG_X", as in "| 1 | `FLAG_X` |" or "1 `MODE_X`"
    sed -n 's/^ *const int[0-9]*_t \([A-Z_]*\) = \([0-9]*\);.*/\2 \1/p' "$type" | while read -r value constant; do
        grep -Eq "(^| )$value( \|)? \`$constant\`" "$page" || echo "$name: $constant = $value"
    done
done >missing
while read -r line; do fail "not in the page, or with another number: $line"; done <missing

# The reasons in the receiver's order, name for name.
sed -n 's/^    X([A-Z_]*, "\([a-z_]*\)",.*/\1/p' "$KN_SOURCE/server/receiver.h" | awk '{ print NR - 1, $1 }' >reasons
[ -s reasons ] || fail "no reasons found in server/receiver.h"
sed -n '/^| n | name | why |/,/^$/s/^| \([0-9]*\) | \([a-z_]*\) |.*/\1 \2/p' "$page" >told
diff reasons told || fail "the reasons of rejection differ from server/receiver.h (left)"

exit $failed
