#!/usr/bin/env bash
# kneadd --state-dir killed at random times of a press, again and again (20 times; KN_KILLS=N for more): no file is ever
# refused, the generation before is there, and the next life goes on with the object of at most 1 s before.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
kills=${KN_KILLS:-20}
mkdir state
RANDOM=1
files() { ls state/*.knead 2>/dev/null | wc -l; }
start_logger lives.lcmlog
kneader finger & # whoever serves
hand=$!
refused=0 missing=0 unrestored=0 running=0
for ((kill = 0; kill <= kills; kill++)); do
    start_kneadd dough-small.yaml --state-dir state
    refused=$((refused + $(grep -c 'not restored' kneadd.err)))
    [ $kill = 0 ] || grep -q '^kneadd: restored state/dough-small\.' kneadd.log || unrestored=$((unrestored + 1))
    [ -e state/.tmp ] && missing=$((missing + 1))
    [ $kill = $kills ] && break
    sleep "$((kill == 0 ? 3 : RANDOM % 2)).$((100 + RANDOM % 900))" # not before its first tick
    kill -0 $server && running=$((running + 1))
    kill -KILL $server
    wait $server 2>/dev/null
    [ "$(files)" -ge 2 ] || missing=$((missing + 1))
done
check "$running of $kills were killed while they served" [ $running = $kills ]
check "no file was refused" [ $refused = 0 ]
check "every start went on with the object" [ $unrestored = 0 ]
check "the generation before was there, and nothing half written was left" [ $missing = 0 ]
kneadd --scene "$KN_SOURCE/core/scenes/dough-small.yaml" --state-dir state >out 2>err
second=$?
check "a second one is refused: $(cat err)" [ "$second $(wc -l <err)" = "3 1" ]
stop_kneadd
stop_logger
lives lives.lcmlog | tee lives.txt
check "the log has them all" [ "$(number lives lives.txt)" = $((kills + 1)) -a "$(number restored lives.txt)" = $kills ]
check "nine in ten lost 1 s at most" [ $((10 * $(number within lives.txt))) -ge $((9 * kills)) ]

# what a life that began with a restored object did, is in its log and its snapshot; and is undone, and saved at its end
start_logger life.lcmlog
start_kneadd dough-small.yaml --state-dir state
sleep 6
cp -r state then
stop_kneadd
stop_logger
kill $hand
last=$(ls state/*.knead | tail -1)
check "kneadd ended well" [ "$status" = 0 ]
knead replay life.lcmlog --verify >/dev/null 2>why
refused=$?
check "without the snapshot its log is refused: $(cut -c1-90 why)" [ "$refused $(wc -l <why)" = "2 1" ]
knead replay life.lcmlog --snapshot then --verify >said 2>why
check "with it the log replays to the bit: $(cat said why | tail -1)" grep -q '^verified' said
start_kneadd dough-small.yaml --state-dir state
check "the next start has what the orderly end left: $(grep restored kneadd.log)" grep -qF "restored $last" kneadd.log
stop_kneadd

# one that is damaged is told, and the one before it taken; another scene is not touched by it
last=$(ls state/*.knead | tail -1)
printf 'x' | dd of="$last" bs=1 seek=5000 conv=notrunc status=none
start_kneadd dough-small.yaml --state-dir state
check "a damaged one is told: $(cat kneadd.err)" grep -qF "not restored: $last: checksum" kneadd.err
check "the one before is taken: $(grep restored kneadd.log)" grep -q '^kneadd: restored' kneadd.log
stop_kneadd
start_kneadd jelly.yaml --state-dir state
check "jelly has none of it" grep -q '^kneadd: nothing to restore' kneadd.log
stop_kneadd
expect() { # expect SENTENCE PATTERN DIR: 2 and one line
    kneadd --scene "$KN_SOURCE/core/scenes/jelly.yaml" --state-dir "$3" >out 2>err
    local code=$?
    check "$1: $(cat err)" [ "$code $(cat out err | wc -l) $(grep -c -e "$2" err)" = "2 1 1" ]
}
expect "no such directory" 'No such file' nowhere
chmod 777 state
expect "one that everybody may write to" 'everybody may write there' state
exit $failed
