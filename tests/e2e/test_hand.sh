#!/bin/sh
# clients/examples/hand.c: as long as it says, built as its first lines say, at work on a served dough.
set -u
failures=0
fail() { echo "FAIL $*"; failures=$((failures + 1)); }
source=$KN_SOURCE/clients/examples/hand.c
[ "$(wc -l <"$source")" -le 80 ] || fail "hand.c has more than 80 lines"
[ "$(wc -l <"$KN_SOURCE/clients/knead_mesh.h")" -le 100 ] || fail "knead_mesh.h has more than 100 lines"
[ "$(grep -c '// ([123])' "$source")" -eq 3 ] || fail "hand.c does not mark three places to replace"
grep -h '#include "' "$source" | grep -qv '"proto/' && fail "hand.c needs more than the generated types"

# the commands in its head, from the top of the tree, into a scratch folder instead of build/hand
sed -n 's,^//     \(mkdir\|lcm-gen\|cc\) ,\1 ,p' "$source" | sed "s|build/hand|$PWD/built|g" >build.sh
[ "$(wc -l <build.sh)" -eq 3 ] || fail "hand.c's head does not hold three commands"
(cd "$KN_SOURCE" && sh -e "$OLDPWD/build.sh") || fail "hand.c does not build as its head says"

kneadd --scene "$KN_SOURCE/core/scenes/dough-small.yaml" --realtime "${KN_REALTIME:-auto}" >kneadd.log 2>&1 & daemon=$!
sleep 0.5
built/hand >hand.txt & hand=$!
sleep 6
kill -KILL $daemon
sleep 1
kill $hand
wait 2>/dev/null
cat hand.txt
# it pokes and feels dough; it knows when nobody answers
awk '$5 + 0 > 0.1 { n++ } END { exit n == 0 }' hand.txt || fail "the hand felt nothing"
tail -1 hand.txt | grep -q ' 0.00 N   no force from kneadd' || fail "the server was killed, and the hand does not know"
grep -v 'no force' hand.txt | grep -q 'z ' || fail "the server never answered"
[ $failures -eq 0 ] && echo "the example works as it stands"
exit $((failures > 0))
