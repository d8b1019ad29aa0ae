#!/bin/sh
# A virtual hand on a served dough: it presses, pokes, swings and follows a file; it records what replays to the bit; it
# survives a killed server with its own watchdog, and lost poses by lifting.
set -u
scene=$KN_SOURCE/core/scenes/dough-small.yaml
failures=0
fail() { echo "FAIL $*"; failures=$((failures + 1)); }
serve() { kneadd --scene "$scene" --realtime "${KN_REALTIME:-auto}" >kneadd.log 2>&1 & daemon=$!; }
end() { kill -TERM $daemon 2>/dev/null; wait $daemon; }
number() { sed -n "s/^  $1 *\([0-9.-]*\).*/\1/p" "$2"; } # of a line of the table
holds() { awk "BEGIN { exit !($1) }"; }                  # a comparison of numbers

# The probe waits for the scene, so it hears the one that kneadd says first and is there from its first tick on.
knead probe --hold '0.5 s' --record press.lcmlog --csv press.csv >press.txt 2>press.err & hand=$!
serve
wait $hand || fail "press: exit $?: $(cat press.err)"
cat press.txt
head -1 press.txt | grep -q '^press of dough-small.yaml, tool plate$' || fail "the table does not say what was pressed"
holds "$(number peak press.txt) > $(number 'end of hold' press.txt) && $(number 'end of hold' press.txt) > 0" ||
    fail "the force does not relax"
dent=$(number 'residual depth' press.txt)
holds "$dent > 1 && $dent < 10" || fail "no dent, or no recovery"
holds "$(number 'echoes matched' press.txt) == $(number 'forces received' press.txt)" || fail "a force answers nobody"
holds "$(number 'forces received' press.txt) > 0.9 * $(number 'poses sent' press.txt)" || fail "forces are missing"
holds "$(wc -l <press.csv) - 1 == $(number 'echoes matched' press.txt)" || fail "the CSV has another number of rows"
knead replay press.lcmlog --verify >verify.txt 2>&1 || fail "the record does not verify: $(cat verify.txt)"
cat verify.txt

# the object keeps the dent: the next press begins where it now touches, and has less to do
knead probe --hold '0.2 s' >again.txt 2>again.err || fail "press into its own dent: exit $?: $(cat again.err)"
holds "$(number 'residual depth' again.txt) < 0.5 * $dent" || fail "the dent was not kept"
printf 'time_s,x_m,y_m,z_m\n0,0.015,0,0.06\n0.5,0.015,0,0.045\n1,0.015,0,0.042\n2,0.01,0,0.06\n' >path.csv
for path in poke sine path.csv; do
    knead probe --path $path --hold '0.5 s' >$path.txt 2>$path.err || fail "$path: exit $?: $(cat $path.err)"
    holds "$(number contact $path.txt) > 0" || fail "$path: no contact"
done
knead probe --probe spoon 2>err && fail "a tool that is not there: exit 0"
grep -q 'has no probe `spoon`; it has: plate finger' err || fail "a tool that is not there: $(cat err)"
knead probe --depth '29 mm' 2>err && fail "through the table: exit 0"
grep -q 'expected at most 27.0 mm' err || fail "through the table: $(cat err)"
end || fail "kneadd: exit $?"

# lost poses latch a fault in kneadd; lifting clears it; the press is repeated in a new session
serve
knead probe --hold '0.2 s' --drop-at 2.3:60 --record drop.lcmlog >drop.txt 2>drop.err || fail "lost poses: exit $?"
cat drop.err
grep -q 'press, 2\.[0-9]* s, .*: kneadd latched: pose silence; way back: ' drop.err || fail "lost poses: no word why"
grep -q 'tool lifted, fault cleared; once more' drop.err || fail "lost poses: lifting did not clear the fault"
grep -q '^  try [23]: ' drop.txt || fail "lost poses: not repeated"
end

# a killed server cannot ramp anything down: the own watchdog does, the tool gets out of the way, nobody answers then
knead probe --hold '4 s' --record killed.lcmlog --tries 2 >killed.txt 2>killed.err & hand=$!
serve
recorded() { stat -c %s killed.lcmlog 2>/dev/null || echo 0; }
while kill -0 $hand 2>/dev/null && [ "$(recorded)" -lt 2300000 ]; do sleep 0.02; done
kill -KILL $daemon # some 0.5 KB per ms: the press is in its hold now
wait $daemon 2>/dev/null
wait $hand && fail "killed server: exit 0"
cat killed.err
grep -q 's, [0-9.]* N taken to 0 N: own watchdog: no force for 2' killed.err || fail "killed server: no own watchdog"
grep -q 'no force for 3 s: kneadd has ended' killed.err || fail "killed server: no word of it"

knead probe --lcm-url 'udpm://239.255.76.67:7700?ttl=0' 2>err && fail "nobody there: exit 0"
grep -q 'no KNEAD_SCENE for 6 s: is kneadd running' err || fail "nobody there: $(cat err)"
[ $failures -eq 0 ] && echo "a hand can be trusted to leave"
exit $((failures > 0))
