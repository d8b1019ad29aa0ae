#!/usr/bin/env bash
# The hands that need no build, on a served dough: clients/examples/touch.* in C, C++, Python and JavaScript, one after the
# other. Each feels the dough, leaves without a fault, and gives no force once kneadd is gone; Python's also with a key.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

examples=$KN_SOURCE/clients/examples
export PYTHONPATH=$KN_BUILD/python
check "the mesh header has at most 100 lines" [ "$(wc -l <"$KN_SOURCE/clients/knead_mesh.h")" -le 100 ]
check "the example in C marks three places to replace" [ "$(grep -c '// ([123])' "$examples/touch.c")" = 3 ]
cc -Wall -Wextra -Wconversion -Werror -I "$KN_SOURCE/clients" -o touch_c "$examples/touch.c" -lm
c++ -x c++ -Wall -Wextra -Wconversion -Werror -I "$KN_SOURCE/clients" -o touch_cpp "$examples/touch.c" -lm
feels() { awk '$1 == "z" && $5 > 0.5 { n++ } END { exit n == 0 }' "$1"; } # the dough keeps the first hand's dent

start_kneadd dough-small.yaml --control control
trips() { knead ctl --control control --json status | python3 -c 'import json, re, sys; print(*re.findall(r"\"(trips|faults)\": ([^,}]*)", json.dumps(json.load(sys.stdin))))'; }
check "kneadd counts trips: $(trips)" [ -n "$(trips)" ]
for hand in ./touch_c ./touch_cpp "/usr/bin/python3 $examples/touch.py" "node $examples/touch.js"; do
    for try in 1 2 3; do # only a machine that stands still may end a press
        before=$(trips)
        $hand >hand.txt 2>&1
        ended=$?
        pause 0.1
        [ "$(trips)" != "$before" ] || break
    done
    check "${hand##*/} ends with 0" [ $ended = 0 ]
    check "${hand##*/} feels the dough, up to $(awk '{ print $5 }' hand.txt | sort -g | tail -n 1) N" feels hand.txt
    check "${hand##*/} leaves without a fault" [ "$(trips)" = "$before" ]
done
kill -INT "$server" && wait "$server"

openssl rand -hex 32 >key && chmod 600 key
start_kneadd dough-small.yaml --key key
cat >signed.py <<'PY'
import math, sys, knead
felt = 0
with knead.Hand('finger', key=sys.argv[1]) as hand:
    for ms in range(int(sys.argv[2])):
        phase = 2 * math.pi * ms / 4000
        z, speed = 0.0485 + 0.0115 * math.cos(phase), -0.0115 * 2 * math.pi / 4 * math.sin(phase)
        felt = max(felt, hand.move((0, 0, z), (0, 0, speed))[2])
        if ms % 4000 == 3999 and felt > 0.5:
            break  # else once more, since a machine that stands still may end a press
print('%.1f %s' % (felt, hand.trouble()))
PY
/usr/bin/python3 signed.py key 12000 >signed.txt
check "Python's hand feels a dough whose kneadd has a key: $(cat signed.txt)" awk '{ exit $1 < 0.5 }' signed.txt
openssl rand -hex 32 >other && chmod 600 other
/usr/bin/python3 signed.py other 2500 >other.txt
check "with another key it gives no force, and says so" grep -q '^0.0 no force from kneadd' other.txt


# A kneadd that is gone: no force within a second, and with a key the hand comes back to its next run.
cat >returns.py <<'PY'
import sys, time, knead
seen = []
with knead.Hand('finger', key='key') as hand:
    end = time.monotonic() + 12
    while time.monotonic() < end:
        hand.move((0, 0, 0.06))
        if not seen or seen[-1] != hand.trouble():
            seen.append(hand.trouble())
            print(repr(hand.trouble()), flush=True)
PY
/usr/bin/python3 returns.py >returns.txt & returning=$!
await grep -q "^''" returns.txt
kill -KILL "$server" && wait "$server" 2>/dev/null
await eval "tail -n 1 returns.txt | grep -q 'no force'"
check "a hand whose kneadd is gone says so" grep -q 'no force' returns.txt
start_kneadd dough-small.yaml --key key
wait $returning
check "with a key the hand comes back to kneadd's next run" sh -c 'tail -n 1 returns.txt | grep -q "^.\{2\}$"'
kill -INT "$server" && wait "$server"
exit $failed
