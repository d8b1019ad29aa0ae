#!/usr/bin/env bash
# knead check: the shipped scenes are good and described. Each bad file gives one line file:line:col and exit 2.
# gate in release: many runs of programs that start slowly with the sanitizers
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"
program="knead check"
# reports WORDS ARGUMENT...: expect that knead check accepts the scene and prints a line with these words (a pattern)
reports() { knead check "${@:2}" >out 2>err && grep -q -- "$1" out || fail "knead check ${*:2} does not report '$1': $(cat out err)"; }

mkdir folder
dough=$KN_SOURCE/core/scenes/dough-diagonals.yaml
reports "^quality *fast: .*; in force" "$dough" --quality fast
refuses 2 "knead check: --set =3: expected key=value, e.g. material.k1='300 gf/cm^3'" "$dough" --set =3
refuses 2 "knead check: '': expected the name of a scene file" ''
refuses 2 "knead check: --wood: unknown option; --help lists them" "$dough" --wood
refuses 2 "knead check: expected one scene file; see --help"

reports "^solver *rk4 f64, dt 2e-08 s, mass scale 1; stable up to" "$dough" --set solver.kind=rk4 --set solver.dt='0.02 us'

slow= # a property of this build, not of a scene
[ "${KN_BUILD##*/}" = release ] || slow="longer than 1 ms here"
for scene in dough dough-diagonals dough-fine dough-small bun jelly clay liver pinch rolling-pin; do
    coarse=$([ $scene = dough-small ] && echo "cells along z are few" || echo "no such warning")
    knead check "$KN_SOURCE/core/scenes/$scene.yaml" >out 2>err || fail "$scene: $(cat err)"
    grep -q "^scene *$scene.yaml, version 1" out && grep -q "^kernels" out || fail "$scene: $(cat out)"
    grep "^warning" out | grep -v -e "multiply-add" -e "real time" ${slow:+-e "$slow"} | grep -v "$coarse" && fail "$scene gives a warning"
done
reports "^object .*11 x 11 x 7 = 847 nodes, 8706 edges" "$dough"
reports "16 x 16 x 10 = 2560 nodes" "$dough" --set object.spacing='3.3333333333333333 mm'
small=$KN_SOURCE/core/scenes/dough-small.yaml
reports "^warning *3 cells along z are few" "$small"
reports "^forces  *of edges and gas are multiplied by 0.86" "$small" --set object.force_factor=0.86
grep -q "cells along z" out && fail "a scene with a factor on its forces still warns of coarse cells"
reports "^warning *finger is smaller than 1.5 spacings" "$dough" --set probes.finger.radius='6 mm'

# One scene with every kind of tool, half of the force for a hand, a mesh with gas, and the circuit's solver.
sed '/^probes:/,$d' "$KN_SOURCE/core/scenes/dough-small.yaml" >tools.yaml
cat >>tools.yaml <<YAML
probes:
  - {name: brick, shape: box, extent: [1 cm, 1 cm, 1 cm]}
  - {name: star, shape: cross, extent: [2 cm, 1 cm, 1 cm]}
  - {name: pin, shape: cylinder, radius: 10 mm, length: 2 cm}
  - {name: stamp, shape: mesh, mesh: $KN_SOURCE/tests/clients/surfaces/block.stl, mesh_unit: mm}
YAML
knead check tools.yaml --set device.force_scale=0.5 >out || fail "the scene with every kind of tool is refused: $(cat out)"
for line in 'brick: box 10 x 10 x 10 mm' 'star: cross 20 x 10 x 10 mm' 'pin: cylinder of radius 10 mm, 20 mm high' 'stamp: mesh of 12 triangles' \
    'the hand feels 0.5 times the object'; do
    grep -q "$line" out || fail "$line: $(cat out)"
done
reports "^pressure .* elements, each closed" "$KN_SOURCE/core/scenes/bun.yaml" --set object.pressure=cells
reports "^support *bonded, which holds 137 of 567 nodes" "$KN_SOURCE/core/scenes/liver.yaml"
printf '%s\n' '$MeshFormat' '2.2 0 8' '$EndMeshFormat' '$Nodes' 4 '1 0 0 0' '2 -3 -3 5' '3 3 -3 5' '4 0 3 6' '$EndNodes' '$Elements' 1 \
    '1 4 2 1 1 1 2 3 4' '$EndElements' >tip.msh
printf '%s\n' 'version: 1' 'object: {mesh: tip.msh, mesh_unit: cm}' 'material: liver' 'support: bonded' 'device: bench' >tip.yaml
refuses 2 "tip.yaml:4:10: support: bonded holds only nodes on one line, about which the object turns, expected support_depth of 50.5 mm or more" tip.yaml
reports "note: the object cannot move; expected less support_depth" "$KN_SOURCE/core/scenes/liver.yaml" --set support_depth='10 cm'
reports "^support *bonded, which holds 3 of 4 nodes" tip.yaml --set support_depth='52 mm'
reports '^warning  *[0-9.]* % of the force is left unsolved' "$KN_SOURCE/core/scenes/dough-small.yaml" --set solver.kind=fixed --set solver.passes=1 --set solver.iterations=3
reports '^warning  *nothing holds the object' tools.yaml --set support=none --set gravity='9.8 m/s^2'

# Two resolutions.
fine=$KN_SOURCE/core/scenes/dough-fine.yaml
reports "^accuracy *1 % of the force: fine cells in the box x -10.5..10.5 y -10.5..10.5 z 15..24 mm, cells of twice the size outside: 3210 nodes" "$fine"
reports "^accuracy *the tools reach the whole object: uniform" "$fine" --set object.margin='5 cm'
knead check "$fine" --set object.accuracy=0 | grep -q "^accuracy" && fail "accuracy 0 makes a fine box"
refuses 2 "knead check: --set object.accuracy: probes.plate.reach is missing, expected [x_min, x_max, y_min, y_max] with object.accuracy" \
    "$dough" --set object.accuracy='1 %'
refuses 2 "$fine:8:13: object.size along z is 17 spacings, expected an even number with object.accuracy" \
    "$fine" --set object.size='[4.5 cm, 4.5 cm, 2.55 cm]'
knead check "$fine" --set object.structure=axis --set object.accuracy=0 >/dev/null || fail "accuracy 0 is refused with structure: axis"
refuses 2 "knead check: --set probes.spatula.reach: probes.spatula.reach ends at -1 m along x, expected 1 m or more" \
    "$fine" --set probes.spatula.reach='[1 m, -1 m, 0, 0]'
refuses 2 "knead check: --set probes.spatula.reach: probes.spatula.reach and the reach of every other probe lie outside the object, expected at least one on the object" \
    "$fine" --set probes.spatula.reach='[1 m, 2 m, 0, 0]' --set probes.fingertip.reach='[1 m, 2 m, 0, 0]'
refuses 2 "knead check: $dough: has no object.accuracy, which --log needs" "$dough" --log none.lcmlog
refuses 2 "knead check: none.lcmlog: No such file or directory, expected an LCM event log" "$fine" --log none.lcmlog

# A material file of one's own. Its path is relative to the scene's folder, or to this folder when --set names it.
# Messages name the line of the material file.
printf '# mine\nmaterial: {k1: 5 kPa, c1: 1 kPa s, damper: constant, c2: 1 MPa s}\ndensity: 1.5 g/cm^3\n' >folder/mine.yaml
sed 's/^material: .*/material: mine.yaml/' "$dough" >folder/own.yaml
reports "^material *k1 5000 Pa" folder/own.yaml
reports "^density: 1500 kg/m^3" "$dough" --set material=folder/mine.yaml --text
sed 's/k1: 5 kPa/k1: 5/' folder/mine.yaml >folder/bad.yaml
refuses 2 "folder/bad.yaml:2:16: material.k1: '5' has no unit, expected a number from 0 to 1e+09 Pa (or Pa/m with a specimen_height)" \
    "$dough" --set material=folder/bad.yaml
sed 's/k1: 5 kPa, //' folder/mine.yaml >folder/bad.yaml
refuses 2 "knead check: --set material: material.k1 is missing, expected a number from 0 to 1e+09 Pa (or Pa/m with a specimen_height)" \
    "$dough" --set material=folder/bad.yaml
echo 'support: none' >>folder/mine.yaml
refuses 2 "folder/own.yaml:12:11: support is in folder/mine.yaml, expected only a material, its density and label there" folder/own.yaml

# The label is shown in lines of 120 columns; a material brings its own.
reports "^label *for comparisons of speed, not faithful: every edge" "$dough"
reports "^label *stands for the dough of the first paper" "$KN_SOURCE/core/scenes/dough.yaml"
awk 'length > 120 && /^(label|  )/ { exit 1 }' out || fail "a line of the label is too long"
reports "^label *mine" "$KN_SOURCE/core/scenes/dough.yaml" --set label=mine
knead check "$KN_SOURCE/core/scenes/dough.yaml" --set material=clay | grep -q "^label" && fail "clay has the label of dough"
knead check "$dough" --set material.k1='1 kPa' | grep -q "^label" && fail "another k1 leaves the label"
refuses 2 "knead check: --set label: a list, expected one line of at most 1023 bytes" "$dough" --set label='[a, b]'

# A plastic material: one damper in effect, or a warning. For a stroke the program tells the range of lengths.
reports "^plastic .* c2 within 3.8 % at every stress" "$dough" --set material=dough-plastic
! grep -q "^warning.*c1 and c2 in series" out || fail "dough-plastic gives a warning about c1"
reports "^warning *c1 and c2 in series differ from c2 by up to 94 %, above 5 %" "$dough" --set material.k1='0 Pa'
reports "^stroke *Voigt part a = 0.02 to 0.98 of an edge's length, 0.2 when new: without load an edge has 0.2041 to 10 times its" "$dough" --set material.stroke='[0.02, 0.98]'

# Structure, gas, and combinations that are impossible.
pressure=$KN_SOURCE/core/scenes/dough.yaml
reports "^pressure *600 cells, each closed, at rest 101325 Pa" "$pressure"
reports "(diagonals, 0.02 times as stiff as the sides)" "$pressure" --set object.diagonal_stiffness=0.02
grep -q "^warning" out && fail "diagonals of 2 % give a warning"
reports "^warning *gas does not resist shear" "$pressure" --set object.diagonal_stiffness=0.005
reports "^warning *a lattice without diagonals cannot keep its shape" "$pressure" --set object.structure=axis
grep -q "^warning *gas does not resist shear" out || fail "no warning of gas in a lattice without diagonals"
reports "^warning *one pressure for the object" "$pressure" --set object.pressure=object
reports "^object *flat, 50 x 30 mm, 10 mm thick, spacing 5 mm: 11 x 7 = 77 nodes, 256 edges" "$dough" --set object.size='[5 cm, 3 cm]' --set object.thickness='1 cm'

# What a second thread would bring here.
reports "^threads  *\(with solver.threads 2\|one: only one processor\)" "$pressure"
reports "^threads  *one: \(the object is too small for a second one\|only one processor\)" "$KN_SOURCE/core/scenes/dough-small.yaml"

# The text written out parses to the same scene.
knead check "$dough" --text >dough-diagonals.yaml && knead check dough-diagonals.yaml --text | cmp -s - dough-diagonals.yaml || fail "--text of a scene written by --text is different"
untimed() { knead check "$1" | grep -v -e ^deadline -e ^threads -e 'the shortest step takes longer than 1 ms here'; } # both depend on other load
[ "$(untimed "$dough")" = "$(untimed dough-diagonals.yaml)" ] || fail "the scene written by --text gives another report"
reports "^deadline  [1-9][0-9]* units of work, .* the worst tick of a stroke at 5 cm/s takes" "$dough"

reports "^material.k1 *Pa *0 .. 1e+09 *required" --keys
reports "^usage: knead check SCENE" --help
exit $failed
