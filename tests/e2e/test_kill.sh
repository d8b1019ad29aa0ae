#!/usr/bin/env bash
# kneadd --state-dir is killed at random times of a press, again and again. No file is ever refused, and the
# generation before exists. The next life continues with the object of at most 1 s before.
#
#     KN_KILLS=N    number of kills (20 at night, else 3)
#     KN_JOBS=N     number of daemons side by side, each with its own hand, network and directory (1)
#     KN_KEPT=FILE  results, kept for a run that is ended early: "kill SERVED REFUSED RESTORED PREVIOUS", 0 or 1;
#                   "file GOOD" for each file that a job had at the end of 50; "lost MS"
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70

kneadd_of_nobody() { # the parent never waits for kneadd: on some kernels a wait takes seconds while other processes end
    command kneadd "$@" &
    echo $! >pid
    exec sleep 30
}
dead() { # wait until kneadd and all its threads are dead
    local stat
    while read -ra stat 2>/dev/null <"/proc/$server/stat" && [ "${stat[2]}" != Z -o "${stat[19]}" -gt 1 ]; do pause 0.005; done
}
# restore GENERATION: over the socket, because the numbers of knead ctl restore are those of the operator's snapshots
restore() { python3 -c '
import json, socket, sys
s = socket.socket(socket.AF_UNIX)
s.connect("control")
s.sendall(b"{\"command\": \"restore\", \"generation\": %d}\n" % int(sys.argv[1]))
answer = json.loads(s.makefile().readline())
sys.exit(None if answer["ok"] else answer["error"])' "$1"; }
# row KILLS FILE: run so many lives, killed 50 to 1550 ms after they serve, and one more life that restores every
# file.
row() {
    local kill tries served previous ms file files restored refused good
    start_logger lives.lcmlog
    for ((kill = 0; kill <= $1; kill++)); do
        files=(state/*.knead)
        rm -f pid
        : >before
        kneadd() { kneadd_of_nobody "$@"; }
        start_kneadd dough-small.yaml --state-dir state --control control
        unset -f kneadd
        until [ -s pid ]; do pause 0.005; done
        read -r server <pid
        if [ $kill != 0 ]; then
            restored=0 refused=0
            has 'kneadd: restored state/dough-small.' kneadd.log && restored=1
            has 'not restored' kneadd.err && refused=1
            [ -e state/.tmp ] && [ state/.tmp -ot before ] && previous=0 # a younger file is just being written
            echo "kill $served $refused $restored $previous" >>"$2"
        fi
        [ $kill = "$1" ] && break
        for ((tries = 0; tries < 200 && ${#files[@]} < 2; tries++)); do # the first file takes a press
            pause 0.1
            files=(state/*.knead)
        done
        ms=$((50 + RANDOM % 1500))
        printf -v ms '%d.%03d' $((ms / 1000)) $((ms % 1000))
        pause $ms
        served=0 previous=0
        kill -0 $server && served=1
        kill -KILL $server
        dead
        files=(state/*.knead)
        [ ${#files[@]} -ge 2 ] && previous=1
    done
    pause 0.2 # its own restore is done by then
    for file in state/*.knead; do # the newest comes last
        for tries in 1 2 3; do # the server may answer that it was too busy
            restore $((10#$(cut -d. -f3 <<<"$file"))) 2>why && good=1 && break
            good=0
            pause 1
        done
        # otherwise it was the oldest, removed meanwhile
        if [ $good = 1 ] || [ -e "$file" ]; then echo "file $good $(<why)"; fi >>"$2"
    done
    kill -TERM $server
    dead
    stop_logger
    lives lives.lcmlog >>"$2"
}
# job SEED KILLS FILE: run in groups of fifty, since the log of thousands of lives is large
job() {
    local left=$2
    RANDOM=$1
    mkdir state
    kneader finger & # the hand outlives the servers
    hand=$!
    for (( ; left > 50; left -= 50)); do row 50 "$3"; done
    row $left "$3"
    kill $hand
}
if [ "${1:-}" = job ]; then
    job "${@:2}"
    exit
fi
kills=${KN_KILLS:-$((KN_NIGHT ? 20 : 3))} jobs=${KN_JOBS:-1} kept=$(realpath "${KN_KEPT:-kept}")
script=$(realpath "$0")
for ((j = 1; j <= jobs; j++)); do
    "$KN_SOURCE/tests/netns" "$script" job $j $((kills / jobs + (j <= kills % jobs))) "$kept" &
    job[j]=$!
done
wait "${job[@]}"
mapfile -t lost < <(sed -n 's/^lost //p' "$kept" | sort -n)
quantile() { echo "${lost[$(($1 * (${#lost[@]} - 1) / 1000))]}"; }
within=0
for ms in "${lost[@]}"; do ((within += ms <= 1000)); done
read -r killed served refused restored previous files good < <(awk '/^kill/ { n++; a += $2; b += $3; c += $4; d += $5 }
    /^file/ { f++; g += $2 } END { print n + 0, a + 0, b + 0, c + 0, d + 0, f + 0, g + 0 }' "$kept")
echo "$killed kills; lost ms: p50 $(quantile 500), p99 $(quantile 990), p99.9 $(quantile 999), most $(quantile 1000)"
[ -z "${KN_NIGHT:-}" ] || check "at least 99 % of the kills lost at most 1 s: $within of ${#lost[@]}" [ $((100 * within)) -ge $((99 * kills)) ]
check "$served of $kills servers were killed while serving" [ "$served $killed" = "$kills $kills" ]
check "no snapshot was refused" [ "$refused" = 0 ]
check "every start restored the object" [ "$restored" = $kills ]
check "the previous generation was there, and no partial file was left" [ "$previous" = $kills ]
check "every kept snapshot can be restored: $files" [ "$files" -gt 0 -a "$good" = "$files" ]
check "the logs cover all kills" [ ${#lost[@]} = $kills ]

mkdir state fresh
start_kneadd dough-small.yaml --state-dir state
kneader finger &
hand=$!
expect 'another kneadd keeps its state there' 3 kneadd "$KN_SOURCE/core/scenes/dough-small.yaml" --state-dir state
while [ -z "$(compgen -G 'state/*')" ]; do pause 0.1; done
pause 1
stop_kneadd

# The log and the snapshot record a life that began with a restored object. The life's work can be undone, and is
# saved at its end.
start_logger life.lcmlog
start_kneadd dough-small.yaml --state-dir state
pause 3 # it presses for 1.5 s of every 2 s
cp -r state then
stop_kneadd
stop_logger
kill $hand
last=$(ls state/*.knead | tail -1)
expect 'expected --snapshot with that file or its directory$' 2 knead replay life.lcmlog --verify
check "with the snapshot the log replays to the bit" verifies life.lcmlog --snapshot then
start_kneadd dough-small.yaml --state-dir state
check "the next start restores the snapshot of the orderly end: $(grep restored kneadd.log)" grep -qF "restored $last" kneadd.log
stop_kneadd

# A press before a kill -9, and one after it.
touched() { awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) c[$i] = i; next } $c["contacts"] > 0 { print 1e3 * $c["z_m"]; exit }' "$1"; }
printf '%s\n' time_s,x_m,y_m,z_m 0,0,0,0.06 0.5,0,0,0.045 1.5,0,0,0.035 2,0,0,0.06 >path.csv
start_kneadd dough-small.yaml --state-dir fresh --control control
$ahead knead probe --path path.csv --quiet --csv before.csv
ctl snapshot >/dev/null
kill -KILL $server
dead
start_kneadd dough-small.yaml --state-dir fresh
$ahead knead probe --path path.csv --quiet --csv after.csv
check "a press after a kill touches in the dent of the press before it: at $(touched before.csv) mm, then at $(touched after.csv)" \
    awk -v a="$(touched before.csv)" -v b="$(touched after.csv)" 'BEGIN { exit !(b > 0 && b < a - 1) }'
stop_kneadd

# A damaged snapshot is reported, and the one before is taken. Another scene is not affected.
last=$(ls state/*.knead | tail -1)
printf 'x' | dd of="$last" bs=1 seek=5000 conv=notrunc status=none
start_kneadd dough-small.yaml --state-dir state
check "a damaged snapshot is reported: $(cat kneadd.err)" grep -qF "not restored: $last: checksum" kneadd.err
check "the previous snapshot is restored: $(grep restored kneadd.log)" grep -q '^kneadd: restored' kneadd.log
stop_kneadd
start_kneadd jelly.yaml --state-dir state
check "another scene has nothing to restore" grep -q '^kneadd: nothing to restore' kneadd.log
stop_kneadd
expect 'No such file' 2 kneadd "$KN_SOURCE/core/scenes/jelly.yaml" --state-dir nowhere
chmod 777 state
expect 'writable by everybody' 2 kneadd "$KN_SOURCE/core/scenes/jelly.yaml" --state-dir state
exit $failed
