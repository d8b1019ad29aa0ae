#!/usr/bin/env bash
# knead check: the shipped scenes are good and described. Each bad file gives one line file:line:col and exit 2.
# gate in release: many runs of programs that start slowly with the sanitizers
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"
program="knead check"

mkdir folder
dough=$KN_SOURCE/core/scenes/dough.yaml
refuses 2 "knead check: --set material.k1: '300' has no unit, expected a number from 0 to 1e+09 Pa (or Pa/m with a specimen_height)" \
    "$dough" --set material.k1=300
refuses 2 "knead check: --quality quick: expected fast, balanced, accurate or own" "$dough" --quality quick
refuses 2 "knead check: --quality fast: the scene has no quality points, expected this left out" \
    "$KN_SOURCE/core/scenes/jelly.yaml" --quality fast
knead check "$dough" --quality fast | grep -q "^quality *fast: .*; in force" || fail "the quality point in force is not reported"
refuses 2 "knead check: --set =3: expected key=value, e.g. material.k1='300 gf/cm^3'" "$dough" --set =3
refuses 2 "knead check: '': expected the name of a scene file" ''
refuses 2 "knead check: unrecognized option '--wood'" "$dough" --wood
refuses 2 "knead check: expected one scene file; see --help"

# An unstable Runge-Kutta step is refused, and the message names the limit.
knead check "$dough" --set solver.kind=rk4 >out 2>err
[ $? = 2 ] && grep -q "^$dough:1:1: rk4 is stable up to dt = .* s here" err || fail "rk4 beyond its stability limit is not refused: $(cat err)"
knead check "$dough" --set solver.kind=rk4 --set solver.dt='20 ns' >out 2>&1
[ $? = 2 ] && grep -q "unknown unit 'ns'" out || fail "the unit ns is not refused: $(cat out)"
knead check "$dough" --set solver.kind=rk4 --set solver.dt='0.02 us' >out || fail "rk4 inside its limit is refused"
grep -q "^solver *rk4 f64, dt 2e-08 s, mass scale 1; stable up to" out || fail "rk4 does not report its step and stability limit: $(cat out)"

slow= # a property of this build, not of a scene
[ "${KN_BUILD##*/}" = release ] || slow="longer than 1 ms here"
for scene in dough dough-fine dough-pressure dough-small bun jelly clay pinch rolling-pin; do
    knead check "$KN_SOURCE/core/scenes/$scene.yaml" >out 2>err || fail "$scene: $(cat err)"
    grep -q "^scene *$scene.yaml, version 1" out && grep -q "^kernels" out || fail "$scene: $(cat out)"
    grep "^warning" out | grep -v -e "multiply-add" -e "real time" ${slow:+-e "$slow"} && fail "$scene gives a warning"
done
knead check "$dough" | grep -q "^object .*11 x 11 x 7 = 847 nodes, 8706 edges" || fail "wrong number of nodes and edges of dough"
knead check "$dough" --set object.spacing='3.3333333333333333 mm' | grep -q "16 x 16 x 10 = 2560 nodes" || fail "2560 nodes"
knead check "$dough" --set probes.finger.radius='6 mm' | grep -q "^warning *finger is smaller than 1.5 spacings" ||
    fail "no warning of a ball smaller than 1.5 spacings"

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
    'the hand is given 0.5 of the force'; do
    grep -q "$line" out || fail "$line: $(cat out)"
done
knead check "$KN_SOURCE/core/scenes/bun.yaml" --set object.pressure=cells | grep -q "^pressure .* elements, each closed" || fail "the gas of a mesh is not reported"
knead check "$KN_SOURCE/core/scenes/dough-small.yaml" --set solver.kind=fixed --set solver.passes=1 --set solver.iterations=3 |
    grep -q '^warning  *[0-9.]* % of the force is left unsolved' || fail "no warning of the force that the fixed solver leaves unsolved"
knead check tools.yaml --set support=none --set gravity='9.8 m/s^2' | grep -q '^warning  *nothing holds the object' || fail "no warning of an object without support"

# Two resolutions.
fine=$KN_SOURCE/core/scenes/dough-fine.yaml
knead check "$fine" | grep -q "^accuracy *1 % of the force: fine cells in the box x -10.5..10.5 y -10.5..10.5 z 15..24 mm, cells of twice the size outside: 3210 nodes" ||
    fail "the fine box is not reported"
knead check "$fine" --set object.margin='5 cm' | grep -q "^accuracy *the tools reach the whole object: uniform" || fail "a fine box as large as the object is not reported as uniform"
knead check "$fine" --set object.accuracy=0 | grep -q "^accuracy" && fail "accuracy 0 makes a fine box"
refuses 2 "knead check: --set object.accuracy: probes.plate.reach is missing, expected [x, x, y, y] with object.accuracy" \
    "$dough" --set object.accuracy='1 %'
refuses 2 "$fine:8:13: object.size along z is 17 spacings, expected an even number with object.accuracy" \
    "$fine" --set object.size='[4.5 cm, 4.5 cm, 2.55 cm]'
refuses 2 "$fine:8:13: object.accuracy: a fine box needs pressure: none" "$fine" --set object.pressure=cells
refuses 2 "$fine:8:13: object.accuracy means nothing with 'structure: axis', expected it left out" "$fine" --set object.structure=axis
refuses 2 "$fine:8:13: object.accuracy means nothing with object.mesh, expected it left out" \
    "$fine" --set object.mesh="$KN_SOURCE/tests/core/meshes/cube-41.msh" --set object.mesh_unit=mm
knead check "$fine" --set object.structure=axis --set object.accuracy=0 >/dev/null || fail "accuracy 0 is refused with structure: axis"
refuses 2 "$fine:8:13: object.accuracy: a fine box needs the implicit solver" "$fine" --set solver.kind=rk4 --set solver.dt='1 us'
refuses 2 "knead check: --set probes.spatula.reach: probes.spatula.reach ends at -1 m along x, expected 1 m or more" \
    "$fine" --set probes.spatula.reach='[1 m, -1 m, 0, 0]'
refuses 2 "knead check: --set probes.spatula.reach: probes.spatula.reach and all others lie outside the object, expected a reach on it" \
    "$fine" --set probes.spatula.reach='[1 m, 2 m, 0, 0]' --set probes.fingertip.reach='[1 m, 2 m, 0, 0]'
refuses 2 "knead check: $dough: has no object.accuracy, which --log needs" "$dough" --log none.lcmlog
refuses 2 "knead check: none.lcmlog: No such file or directory, expected an LCM event log" "$fine" --log none.lcmlog

# A material file of one's own. Its path is relative to the scene's folder, or to this folder when --set names it.
# Messages name the line of the material file.
printf '# mine\nmaterial: {k1: 5 kPa, c1: 1 kPa s, damper: constant, c2: 1 MPa s}\ndensity: 1.5 g/cm^3\n' >folder/mine.yaml
sed 's/^material: .*/material: mine.yaml/' "$dough" >folder/own.yaml
knead check folder/own.yaml | grep -q "^material *k1 5000 Pa" || fail "a material file beside the scene is not read"
knead check "$dough" --set material=folder/mine.yaml --text | grep -q "^density: 1500 kg/m^3" || fail "the density of the material file is not used"
sed 's/k1: 5 kPa/k1: 5/' folder/mine.yaml >folder/bad.yaml
refuses 2 "folder/bad.yaml:2:16: material.k1: '5' has no unit, expected a number from 0 to 1e+09 Pa (or Pa/m with a specimen_height)" \
    "$dough" --set material=folder/bad.yaml
sed 's/k1: 5 kPa, //' folder/mine.yaml >folder/bad.yaml
refuses 2 "knead check: --set material: material.k1 is missing, expected a number from 0 to 1e+09 Pa (or Pa/m with a specimen_height)" \
    "$dough" --set material=folder/bad.yaml
echo 'support: none' >>folder/mine.yaml
refuses 2 "folder/own.yaml:9:11: support is in folder/mine.yaml, expected only a material and its density there" folder/own.yaml

# A plastic material: one damper in effect, or a warning. For a stroke the program tells the range of lengths.
knead check "$dough" --set material=dough-plastic >out && grep -q "^plastic .* c2 within 3.8 % at every stress" out || fail "plastic"
! grep -q "^warning.*c1 and c2 in series" out || fail "dough-plastic gives a warning about c1"
knead check "$dough" --set material.k1='0 Pa' | grep -q "^warning *c1 and c2 in series differ from c2 by up to 94 %, above 5 %" || fail "no warning of a c1 that is too small"
knead check "$dough" --set material.stroke='[0.02, 0.98]' |
    grep -q "^stroke *Voigt part a = 0.02 to 0.98 of an edge's length, 0.2 when new: without load an edge has 0.2041 to 10 times its" || fail "stroke"

# Structure, gas, and combinations that are impossible.
pressure=$KN_SOURCE/core/scenes/dough-pressure.yaml
knead check "$pressure" | grep -q "^pressure *600 cells, each closed, 101325 Pa" || fail "the gas pressure is not reported"
knead check "$pressure" --set object.diagonal_stiffness=0.02 >out
grep -q "(diagonals, 0.02 times as stiff as the sides)" out || fail "the stiffness of weak diagonals is not reported"
grep -q "^warning" out && fail "diagonals of 2 % give a warning"
knead check "$pressure" --set object.diagonal_stiffness=0.005 | grep -q "^warning *gas does not resist shear" ||
    fail "no warning of diagonals too weak for gas"
knead check "$pressure" --set object.structure=axis >out || fail "a lattice without diagonals is refused with gas"
grep -q "^warning *a lattice without diagonals cannot keep its shape" out || fail "no warning of a lattice without diagonals"
grep -q "^warning *gas does not resist shear" out || fail "no warning of gas in a lattice without diagonals"
knead check "$pressure" --set object.pressure=object | grep -q "^warning *one pressure for the object" ||
    fail "no warning of one pressure for the whole object"
knead check "$dough" --set object.size='[5 cm, 3 cm]' --set object.thickness='1 cm' |
    grep -q "^object *flat, 50 x 30 mm, 10 mm thick, spacing 5 mm: 11 x 7 = 77 nodes, 256 edges" || fail "a flat object is not reported"

# The text written out parses to the same scene.
knead check "$dough" --text >dough.yaml && knead check dough.yaml --text | cmp -s - dough.yaml || fail "--text of a scene written by --text is different"
[ "$(knead check "$dough" | grep -v ^deadline)" = "$(knead check dough.yaml | grep -v ^deadline)" ] || fail "the scene written by --text gives another report"
knead check "$dough" | grep -q "^deadline  [1-9][0-9]* units of work, .* the worst tick of a stroke at 5 cm/s takes" || fail "the work of the worst tick is not reported"

knead check --keys | grep -q "^material.k1 *Pa *0 .. 1e+09 *required" || fail "--keys"
knead check --help | grep -q "^usage: knead check SCENE" || fail "--help"
exit $failed
