#!/usr/bin/env bash
# clients/examples/hand.c: as short as it states, built as its first lines state, and used on a served dough.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

example=$KN_SOURCE/clients/examples/hand.c
check "the example has at most 40 lines" [ "$(wc -l <"$example")" -le 40 ]
check "the example marks three places to replace" [ "$(grep -c '// ([123])' "$example")" = 3 ]
check "the example needs only the one header" [ "$(grep '#include "' "$example")" = '#include "knead_hand.h"' ]
check "the mesh header has at most 100 lines" [ "$(wc -l <"$KN_SOURCE/clients/knead_mesh.h")" -le 100 ]

# Run the command of its head from the top of the tree, into a scratch folder instead of build.
sed -n 's,^//     cc ,cc ,p' "$example" | sed "s|build/my_hand|$PWD/hand|" >build.sh
check "the comment at the top of the example holds one command" [ "$(wc -l <build.sh)" = 1 ]
check "the command builds the example" sh -c "cd '$KN_SOURCE' && sh -e '$PWD/build.sh'"

start_kneadd dough-small.yaml
./hand >hand.txt & hand=$!
feels() { awk '$5 > 0.1 { n++ } END { exit n == 0 }' hand.txt; }
await feels
kill -KILL "$server"
await eval "tail -1 hand.txt | grep -q 'no force'"
kill $hand
wait $hand
check "the example ends when it is told to" [ $? = 0 ]
wait "$server" 2>/dev/null
cat hand.txt
check "the example feels the dough" feels
check "the example reports a server that does not answer" sh -c "tail -1 hand.txt | grep -q ' 0.00 N   no force from kneadd'"
exit $failed
