#!/usr/bin/env bash
# knead export: a press as VTK, PLY, CSV and MCAP files; scenes at rest; and all possible errors, which leave no files
# behind. VTK's own readers read the files back, and where npm is, the reader of MCAP's authors reads the messages.
. "$KN_SOURCE/tests/e2e/kneadd.sh"
/usr/bin/python3 -c 'import vtk' 2>/dev/null || { echo "skipped: no VTK here (package python3-vtk9)"; exit 77; }
exported() { /usr/bin/python3 "$KN_SOURCE/tests/e2e/exported.py" "$@" || failed=1; }
# refused SENTENCE EXIT PATTERN OPTION...: expect one line, and no new file in this folder.
refused() {
    local before=(*)
    expect "$3" "$2" knead export "${@:4}"
    local after=(*)
    check "$1: no file is left" [ "${before[*]}" = "${after[*]}" ]
}
touch out err
scenes=$KN_SOURCE/core/scenes
pressed "$scenes/dough-small.yaml" press.lcmlog || exit 70
edges=$(knead check "$scenes/dough-small.yaml" | grep -oE '[0-9]+ edges' | cut -d' ' -f1)

check "a press is exported for ParaView and as a table" knead export press.lcmlog --vtk press --csv press.csv
knead replay press.lcmlog --csv replay.csv >/dev/null
check "the table has the rows of knead replay, except for the step times" \
    cmp <(cut -d, -f1-17,19-21 press.csv) <(cut -d, -f1-17,19-21 replay.csv | awk -F, 'NR == 1 || $2 >= 0')
exported log press press.csv 144 "$edges"
check "a part of a press is exported" knead export press.lcmlog --vtk part --csv part.csv --from 0.2 --to 0.3 --every 0.05
check "the exported part has three moments" [ "$(ls part | grep -c ^object_)" = 3 ]
check "the exported part has a row for each of its 101 ticks" [ "$(wc -l <part.csv)" = 102 ]

check "a press is exported as messages" knead export press.lcmlog --mcap press.mcap --every 0.1
knead export press.lcmlog --mcap again.mcap --every 0.1 >/dev/null
check "exported again, the messages are the same to the byte" cmp press.mcap again.mcap
knead export press.lcmlog --mcap part.mcap --from 0.2 --to 0.3 --every 0.05 >/dev/null
if [ -d "$KN_BUILD/../mcap/node_modules" ]; then
    ln -s "$KN_BUILD/../mcap/node_modules" .
    cp "$KN_SOURCE/tests/e2e/mcap_reader.mjs" .
    node mcap_reader.mjs press.mcap press.csv "$(ls press | grep -c ^object_)" 2 || failed=1
    node mcap_reader.mjs part.mcap part.csv 3 0 || failed=1
else
    echo "     the reader of MCAP's authors has not read it: build/mcap is missing, which tests/run --yes makes with npm"
fi

at=$(grep -o 'timestep="[0-9.]*"' press/object.pvd | tail -1 | tr -dc 0-9.)
for what in displacement:displacement_m stress:von_mises_stress_pa residual:residual_strain; do
    check "the surface is exported with the colours of ${what%:*}" knead export press.lcmlog --at "$at" --ply a.ply --color "${what%:*}"
    exported ply a.ply press "${what#*:}"
done
check "a surface is exported for each moment" knead export press.lcmlog --ply plys --color stress --top '20 kPa' --every 0.5
knead export press.lcmlog --at 0.5 --ply one.ply --color stress --top '20 kPa'
check "the surface of one moment equals the one exported alone" cmp one.ply plys/surface_00001.ply

# A log without forces ends with its last pose. Every program that reads the log agrees.
python3 - press.lcmlog poses.lcmlog <<'END'
import struct, sys
log, poses = open(sys.argv[1], "rb").read(), open(sys.argv[2], "wb")
at = 0
while at + 28 <= len(log):
    channel, data = struct.unpack_from(">II", log, at + 20)
    if log[at + 28:at + 28 + channel].startswith((b"KNEAD_SCENE", b"KNEAD_POSE")): poses.write(log[at:at + 28 + channel + data])
    at += 28 + channel + data
END
for name in press poses; do
    knead export $name.lcmlog --at end --vtk $name-end --csv $name-end.csv >/dev/null
    knead replay $name.lcmlog --csv replay.csv --json >result
    row=$(tail -1 replay.csv | cut -d, -f1-17,19-21)
    check "the last row of $name.lcmlog equals knead replay's: $row" [ "$(tail -n +2 $name-end.csv | cut -d, -f1-17,19-21)" = "$row" ]
    end=$(knead view $name.lcmlog --depth end.png --size 16x16 | sed -n 's/.* at \(-*[0-9.]*\) s;.*/\1/p')
    check "the export of $name.lcmlog ends at $end s: $(grep -o 'timestep="[^"]*"' $name-end/object.pvd | head -1)" \
        [ "$(cut -d, -f2 <<<"$row") $(grep -oE '"end_s": *[0-9.]+' result | grep -oE '[0-9.]+$')" = "$end $(awk -v t="$end" 'BEGIN { print t + 0 }')" ]
    check "the ParaView file ends at the same time" grep -q "timestep=\"${end}000\"" $name-end/object.pvd
done

cat >flat.yaml <<'END'
version: 1
object: {size: [4 cm, 2 cm], spacing: 5 mm, thickness: 1 cm}
material: dough
support: bonded
device: bench
probes: [{name: ball, shape: sphere, radius: 1 cm}]
END
check "a block of two resolutions is exported at rest" knead export --scene "$scenes/dough-fine.yaml" --vtk fine
exported rest fine 4.86e-5
check "a bun of tetrahedra is exported" knead export --scene "$scenes/bun.yaml" --vtk bun
exported rest bun "$(knead mesh "$scenes/meshes/bun.msh" | sed -n 's/.*volume \([0-9.]*\) cm^3.*/\1e-6/p')"
check "a tool of several parts is exported" knead export --scene "$scenes/rolling-pin.yaml" --vtk pin --ply pin.ply
check "a flat object is exported" knead export --scene flat.yaml --vtk flat
exported flat flat 8e-4

refused "nothing to export" 2 'expected a LOG or --scene' --vtk x
refused "nothing to write" 2 'expected --vtk DIR, --ply PATH, --csv FILE or --mcap FILE' press.lcmlog
refused "no such log" 2 'nosuch.lcmlog: .*expected an LCM event log' nosuch.lcmlog --vtk x
refused "a file that is no log" 2 'expected an LCM event log|not a record of an LCM event log' press.csv --vtk x
refused "an output folder that is not empty" 2 'press: is not empty, expected a new folder' press.lcmlog --vtk press
refused "a file in the place of the output folder" 2 'press.csv: is not a folder' press.lcmlog --vtk press.csv
refused "an output folder in a missing folder" 3 'nosuch/x: No such file' press.lcmlog --vtk nosuch/x
refused "a table in a missing folder" 3 'nosuch/x.csv: No such file' press.lcmlog --csv nosuch/x.csv --vtk x
refused "an output over the log itself" 2 'press.lcmlog: is being read' press.lcmlog --csv press.lcmlog
refused "a file of messages over the log itself" 2 'press.lcmlog: is being read' press.lcmlog --mcap press.lcmlog
refused "a file of messages in a missing folder" 3 'nosuch/x.mcap: No such file' press.lcmlog --mcap nosuch/x.mcap --csv x
refused "messages of a scene at rest" 2 'expected a log, because a scene at rest does not change' --scene "$scenes/dough-small.yaml" --mcap x
refused "two outputs with the same path" 2 'expected a separate path' press.lcmlog --csv x --vtk x
refused "two outputs with the same path in two spellings" 2 'expected a separate path' press.lcmlog --csv x --vtk ./x --at 0.1
refused "two outputs with the same path, one with a slash" 2 'expected a separate path' press.lcmlog --vtk x --ply x/
ln -s . here
refused "two outputs with the same path through a link" 2 'expected a separate path' press.lcmlog --csv x --ply here/x --at 0.1
mkdir empty
refused "one output in another" 2 'expected a separate path for each output, none inside another' press.lcmlog --vtk empty --csv empty/x
refused "an empty path" 2 "^knead export: --vtk '': expected a value$" press.lcmlog --vtk ''
refused "an empty path of a table" 2 "^knead export: --csv '': expected a value$" press.lcmlog --csv ''
for text in ' 1' 0x2 1e inf nan +; do
    refused "an invalid time" 2 '--at .*: expected a time, or end' press.lcmlog --at "$text" --csv x
done
# A log of 200 s is refused as fast as it is read. Stepping to the last existing name would take a hundred times as
# long.
python3 - poses.lcmlog long.lcmlog <<'END'
import struct, sys
log, long = bytearray(open(sys.argv[1], "rb").read()), open(sys.argv[2], "wb")
for again in range(40):
    at = 0
    while at + 28 <= len(log):
        channel, data = struct.unpack_from(">II", log, at + 20)
        struct.pack_into(">Q", log, at + 12, struct.unpack_from(">Q", log, at + 12)[0] + 5_000_000 * (again > 0))
        at += 28 + channel + data
    long.write(log)
END
refused "more moments than file names" 2 '--every 0.001: expected at most 100000 moments, but long.lcmlog would give' \
    long.lcmlog --vtk x --every 0.001
check "a short part of a long log is exported" knead export long.lcmlog --ply part-ply --top '1 mm' --every 0.001 --from 0.001 --to 0.003
check "the exported part has three surfaces" [ "$(ls part-ply | wc -l)" = 3 ]
refused "an interval of 0 between moments" 2 '--every 0: expected a time of 1 ms or more' press.lcmlog --vtk x --every 0
refused "a moment after the end" 2 '--at 99: press.lcmlog ends at [0-9.]+ s' press.lcmlog --vtk x --at 99
refused "a part after the end" 2 '--from 99: press.lcmlog ends at [0-9.]+ s' press.lcmlog --vtk x --csv y --from 99
refused "a part that ends before it begins" 2 '--to 1: expected no less than --from 2' press.lcmlog --vtk x --from 2 --to 1
refused "a moment together with a part" 2 'expected no --from' press.lcmlog --vtk x --from 1 --at 2
refused "an unknown colour" 2 '--color heat: expected displacement, stress or residual' press.lcmlog --ply x --at 1 --color heat
refused "colours without a common scale" 2 'expected --top' press.lcmlog --ply x
refused "several moments of a scene at rest" 2 'expected a log, because a scene at rest does not change' --scene "$scenes/dough-small.yaml" --vtk x --every 1
refused "a missing scene" 2 'nosuch.yaml:1:1: ' --scene nosuch.yaml --vtk x
head -c 300000 press.lcmlog >cut.lcmlog
knead export cut.lcmlog --vtk cut >out 2>err
check "a damaged log is exported up to the damage" [ -e cut/object.pvd ]
check "the export reports the damage: $(cat err)" grep -q "only the log before this point was used" err
(ulimit -f 200 && trap '' XFSZ && knead export press.lcmlog --vtk full --csv full.csv --mcap full.mcap) >out 2>err
got=$?
check "a full disk is reported in one line ($(cat err))" eval '[ $got = 3 ] && [ $(wc -l <err) = 1 ]'
(ulimit -f 200 && trap '' XFSZ && knead export press.lcmlog --mcap full.mcap) >out 2>err
got=$?
check "so is one that the messages fill ($(cat err))" eval '[ $got = 3 ] && grep -q full.mcap err && [ $(wc -l <err) = 1 ]'
check "a full disk leaves no partial files" [ -z "$(ls -A | grep full)" ]
knead export press.lcmlog --vtk stopped --every 0.001 >out 2>err &
exporter=$!
for ((tries = 0; tries < 500; tries++)); do [ "$(ls stopped.* 2>/dev/null | wc -l)" -lt 50 ] || break; pause 0.02; done
kill -INT $exporter
wait $exporter
got=$?
check "an interrupted export says so and exits with 130 ($(cat err))" eval '[ $got = 130 ] && grep -q "interrupted: nothing is written" err'
check "an interrupted export leaves no files" [ -z "$(ls -A | grep stopped)" ]
exit $failed
