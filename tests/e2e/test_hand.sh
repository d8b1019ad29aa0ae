#!/usr/bin/env bash
# clients/examples/hand.c: as short as it states, built as its first lines state, and used on a served dough.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

example=$KN_SOURCE/clients/examples/hand.c
check "the example has at most 80 lines" [ "$(wc -l <"$example")" -le 80 ]
check "the example marks three places to replace" [ "$(grep -c '// ([123])' "$example")" = 3 ]
check "the example needs only the generated types" \
    [ "$(grep '#include "' "$example" | grep -vc '"proto/knead_.*_t.h"')" = 0 ]
check "the mesh header has at most 100 lines" [ "$(wc -l <"$KN_SOURCE/clients/knead_mesh.h")" -le 100 ]

# Run the commands of its head from the top of the tree, into a scratch folder instead of build/hand.
sed -n 's,^//     \(mkdir\|lcm-gen\|cc\) ,\1 ,p' "$example" | sed "s|build/hand|$PWD/built|g" >build.sh
check "the comment at the top of the example holds three commands" [ "$(wc -l <build.sh)" = 3 ]
check "the three commands build the example" sh -c "cd '$KN_SOURCE' && sh -e '$PWD/build.sh'"

start_kneadd dough-small.yaml
built/hand >hand.txt & hand=$!
feels() { awk '$5 > 0.1 { n++ } END { exit n == 0 }' hand.txt; }
await feels
kill -KILL "$server"
await eval "tail -1 hand.txt | grep -q 'no force'"
kill $hand
wait "$server" $hand 2>/dev/null
cat hand.txt
check "the example feels the dough" feels
check "the example reports a server that does not answer" sh -c "tail -1 hand.txt | grep -q ' 0.00 N   no force from kneadd'"
exit $failed
