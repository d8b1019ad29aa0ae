#!/usr/bin/env bash
# knead tradeoff on a recorded press. Runs with --jobs and on a host give the same result to the bit as runs here. A
# killed sweep goes on with its finished runs. --write replaces one block of the scene and nothing else.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
command -v gnuplot >/dev/null || { echo "skipped: no gnuplot"; exit 77; }

scene() { sed 's/^  size: .*/  size: [2 cm, 2 cm, 3 cm]/' "$KN_SOURCE/core/scenes/dough-small.yaml" >scene.yaml; }
scene
pressed scene.yaml press.lcmlog 4
points=(scene.yaml press.lcmlog --quick --solver blend,secant --iterations 2,4,8)
sweep() { knead tradeoff "${points[@]}" "$@"; }
errors() { cut -d, -f1-11,14-28 "$1" | sort; } # all columns but the times and their consequences: the fronts, the order

sweep --csv here.csv --png here.png >here 2>here.err
check "a sweep ends with 0" [ $? = 0 ]
check "a sweep without a terminal prints only its table" [ ! -s here.err ]
[ ! -s here.err ] || cat here.err
check "the table has every point" [ "$(grep -c '^10 mm ' here)" = 7 ]
check "the named quality points are printed" [ "$(grep -cE '^(fast       10 mm, 1 ms, |balanced   |accurate   )' here)" = 3 ]
check "the picture is a PNG" [ "$(head -c 4 here.png | tail -c 3)" = PNG ]

# Killed in the middle, then run again.
knead tradeoff "${points[@]}" --resume kept >/dev/null 2>&1 &
sweeping=$!
await eval '[ "$(ls kept 2>/dev/null | grep -c trace$)" -ge 2 ]'
kill -KILL $sweeping
wait $sweeping 2>/dev/null
kept=$(ls kept | grep -c trace$)
sweep --resume kept --csv kept.csv >resumed
check "a killed sweep is resumed" [ $? = 0 ]
check "the resumed sweep keeps its $kept runs" grep -q "of which $kept were kept" resumed
check "the resumed sweep has the same errors" cmp -s <(errors here.csv) <(errors kept.csv)
touch -d '1 hour ago' before && find kept -name '*.trace' -exec touch -d '2 hours ago' {} +
sweep --resume kept >again
check "a complete sweep plays no run again" [ -z "$(find kept -name '*.trace' -newer before)" ]

mkdir failing
printf '#!/bin/sh\ncat >/dev/null\necho "line 7: no such thing" >&2\nexit 1\n' >failing/gnuplot
chmod +x failing/gnuplot
PATH=$PWD/failing:$PATH sweep --resume kept --png no.png >/dev/null 2>failed
check "a picture that gnuplot cannot draw gives exit code 3" [ $? = 3 ]
check "the error has gnuplot's message" grep -q 'no.png: gnuplot could not draw it: exit 1, said: line 7: no such thing$' failed

# knead batch: one table of many commands, however it is played and however often it is killed.
for i in $(seq 40); do echo "creep dough --load ${i}gf"; done >list
printf '# the end\n\nreplay missing.lcmlog' >>list
knead batch - --out table.csv <list >/dev/null 2>said
check "a batch with a run that fails gives exit code 1" [ $? = 1 ]
check "it names the line" grep -q '^1 of 41 runs failed; the first is standard input:43:1: exit 2 .*missing.lcmlog: No such file' said
check "the table has a row per command, with its numbers" python3 -c 'import csv
rows = list(csv.DictReader(open("table.csv")))
assert len(rows) == 41 and rows[40]["exit"] == "2" and "missing.lcmlog" in rows[40]["message"], rows[40]
strains = [float(row["loads.0.strain"]) for row in rows[:40]]
assert rows[9]["line"] == "creep dough --load 10gf" and strains == sorted(strains) and strains[0] > 0, strains'
knead batch list --out killed.csv >/dev/null 2>&1 &
batch=$!
await eval '[ "$(ls killed.csv.runs 2>/dev/null | wc -l)" -ge 10 ]'
kill -KILL $batch
wait $batch 2>/dev/null
pause 0.5 # its run ends with it
results=(killed.csv.runs/????????????????)
while head -n 5 list; do :; done 2>/dev/null | knead batch - --out killed.csv >/dev/null 2>&1 & # a list without an end
pause 0.5
kill -TERM $!
wait $!
check "a batch that is ended while it reads its list writes no table" [ "$? $(ls killed.csv 2>/dev/null)" = "143 " ]
check "and keeps its results" cmp <(printf '%s\n' "${results[@]}") <(printf '%s\n' killed.csv.runs/????????????????)
printf x | dd of="${results[0]}" bs=1 seek=40 conv=notrunc status=none
knead batch list --out killed.csv >resumed 2>&1
check "a killed batch goes on, but not with a damaged result" grep -q "of which $((${#results[@]} - 1)) were kept" resumed
check "its table is the same" cmp table.csv killed.csv
printf 'check dough.yaml\n\nmesh dough.yaml\n' >bad
expect '^bad:3:1: knead mesh: ' 2 knead batch bad --out bad.csv
echo 'check dough.yaml | rm' >bad
expect '^bad:1:1: expected words as in a shell' 2 knead batch bad --out bad.csv
check "a batch leaves no folder" [ -z "$(ls -d ./*.runs 2>/dev/null)" ]

if command -v parallel >/dev/null; then
    sweep --jobs 2 --csv jobs.csv >jobs.out
    check "two jobs at a time give the same errors" cmp -s <(errors here.csv) <(errors jobs.csv)
    check "the times are measured afterwards" [ -z "$(cut -d, -f12 jobs.csv | grep -x '0\|')" ]
else
    echo "no GNU parallel here: --jobs and --hosts are not tested"
fi
if command -v parallel >/dev/null && command -v rsync >/dev/null; then
    # A host without a network: another home folder, reached through a fake ssh.
    mkdir there both
    cat >ssh <<'SSH'
#!/bin/bash
while [ "${1#-}" != "$1" ]; do case $1 in -[lpio]) shift ;; esac; shift; done
shift
[ "$1" = -- ] && shift
cd "${0%/*}/there" && HOME=$PWD SHELL=/bin/bash exec bash -c "$*"
SSH
    chmod +x ssh
    TMPDIR=$PWD/both sweep --hosts "$PWD/ssh there" --csv host.csv >host.out
    check "a sweep on another host gives the same errors" cmp -s <(errors here.csv) <(errors host.csv)
    check "neither machine keeps a file after the sweep" [ -z "$(find there both -type f)" ]
    knead batch list --out hosts.csv --hosts "$PWD/ssh there,:" >/dev/null 2>&1
    check "a host and this machine together give the same table" cmp table.csv hosts.csv
    mkdir broken && printf '#!/bin/sh\nexit 1\n' >broken/knead && chmod +x broken/knead
    sed -i 's|exec bash|PATH=${0%/*}/broken:$PATH exec bash|' ssh
    sweep --hosts "$PWD/ssh there" >/dev/null 2>failed
    check "a host with another build gives exit code 3" [ $? = 3 ]
    check "the error says so" grep -q 'no knead in its PATH, or another build' failed
    check "the failing host keeps no file" [ -z "$(find there -name 'knead-jobs-*')" ]
    printf '#!/bin/sh\nexit 255\n' >ssh
    sweep --hosts "$PWD/ssh there" >/dev/null 2>dead
    check "an unreachable host gives exit code 3" [ $? = 3 ]
    check "the error reports the missing runs" grep -q 'runs have no result (.*); with --resume DIR the finished runs would be kept' dead
fi

# --write replaces the block, and nothing else.
printf '# mine\nquality: # old\n  fast: {iterations: 3}\n\n# the end, without its line end' >>scene.yaml
cp scene.yaml old.yaml && chmod 640 scene.yaml
sweep --write >written
check "the quality points are written into the scene" [ $? = 0 ]
check "the scene loads with each quality point" eval 'for q in fast balanced accurate; do knead check scene.yaml --quality $q >/dev/null || exit 1; done'
without() { awk '/^quality:/ { skip = 1; next } skip && /^  / { next } { skip = 0; print }' "$1"; }
check "the rest of the scene is unchanged, byte for byte" cmp -s <(without old.yaml) <(without scene.yaml)
check "the scene keeps its file mode" [ "$(stat -c %a scene.yaml)" = 640 ]
check "a sweep still recognises the scene" eval 'sweep --resume kept | grep -q "of which 8 were kept"'
printf '\n  - {name: third, shape: plate, size: [1 cm, 1 cm]}\n' >>scene.yaml
cp scene.yaml broken.yaml
expect 'scene.yaml:' 2 knead tradeoff scene.yaml press.lcmlog --write
check "an invalid scene is left unchanged" cmp -s scene.yaml broken.yaml
cp old.yaml scene.yaml && chmod 444 scene.yaml
expect 'scene.yaml: is read-only, expected' 3 sweep --write # before any run is played
check "a read-only scene is left unchanged" cmp -s scene.yaml old.yaml
chmod 644 scene.yaml

# With a point in force that has its own lattice: points found on that lattice stay there, a missing point is removed.
scene
printf 'quality: {chosen: fast, fast: {spacing: 5 mm, precision: f64}, accurate: {spacing: 10 mm}}\n' >>scene.yaml
knead tradeoff scene.yaml press.lcmlog --quick --solver blend --iterations 2,4 --write >written
check "quality points with another lattice are written" [ $? = 0 ]
check "the removal of the old accurate point is reported" grep -q '^removed the old quality point accurate' written
for point in fast balanced accurate; do
    knead check scene.yaml --quality $point >checked
    check "$point has that lattice and precision" eval 'grep -q "175 nodes" checked && grep -q "^solver .* f64" checked'
done
check "the scene without a point keeps its own lattice" eval 'knead check scene.yaml --quality own | grep -q "36 nodes"'

exit $failed
