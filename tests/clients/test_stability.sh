#!/usr/bin/env bash
# knead stability: two families in their quick form, with the right results. Files are written. A wrong option gives one line. The full survey takes minutes and is run by hand.
# gate in release: arithmetic, ten times slower with the sanitizers
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"

knead stability --quick --family bar --csv bar.csv --png bar.png >one || fail "bar: exit $?"
grep -q 'the default solver is right, or refuses with a reason, in 80 of 80 cells' one || fail "bar: $(tail -n 1 one)"
[ "$(wc -l <bar.csv)" = $((1 + 5 * 80)) ] || fail "rows: $(wc -l <bar.csv)"
png bar.png || fail "no PNG"
grep -q ',rk4,refused,.*rk4 is stable up to' bar.csv || fail "a refusal has no reason"

# The table also shows the failures of the alternatives: from rest to flow the tangent oscillates.
knead stability --quick --family mass >mass || fail "mass: exit $?"
awk '$1 == "mass" && $2 == "default" && $4 + $5 == $3 { ok = 1 } END { exit !ok }' mass || fail "mass: $(sed -n 2p mass)"
awk '$1 == "tangent" && $5 + $6 > 0 { ok = 1 } END { exit !ok }' mass || fail "the tangent does not chatter: $(grep tangent mass)"

# A killed process leaves its cell unfinished, and the other cells are tried.
children() { cat "/proc/$1/task/$1/children"; }
if [ -e /proc/$$/task/$$/children ]; then # not every kernel has this file
    knead stability --quick --family mass >killed 2>/dev/null &
    survey=$!
    sleep 0.2
    # a stopped process is one that had not ended yet
    until child=$(children $survey | cut -d ' ' -f 1) && kill -STOP "$child" && grep -q '^State:.T' "/proc/$child/status"; do :; done 2>/dev/null
    kill -KILL "$child"
    wait $survey
    [ $? = 1 ] || fail "killed: exit $?"
    grep -q ': died, Killed$' killed || fail "killed: $(tail -n 4 killed)"
    grep -q 'in 14 of 15 cells' killed || fail "killed: $(tail -n 1 killed)"
fi

families="k1 c1 c2 mass pairs limits bar aspect sliver squash gas jump mixed size"
[ "$(knead stability --help | sed -n 's/^      \([a-z][a-z0-9]*\)  .*/\1/p' | paste -sd ' ')" = "$families" ] || fail "--help"
refuses 2 "knead stability: --family x: expected k1, c1, c2, mass, pairs, limits, bar, aspect, sliver, squash, gas, jump, mixed or size" stability --family x
refuses 2 "knead stability: --jobs is now knead batch with one --family per line" stability --jobs 2
refuses 2 "knead stability: --slow: unknown option; --help lists them" stability --slow
refuses 2 "knead stability: --csv: expected a value" stability --csv
refuses 2 "knead stability: dough: expected options only; --help lists them" stability dough
mkdir folder
refuses 3 "knead stability: folder: Is a directory, expected a file that can be written" stability --csv folder
refuses 3 "knead stability: folder: Is a directory, expected a file that can be written" stability --png folder
exit $failed
