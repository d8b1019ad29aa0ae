#!/usr/bin/env bash
# knead mesh reports the properties of a mesh and refuses broken meshes and open surfaces. Closed surfaces are filled
# by gmsh or tetgen. Without these programs knead mesh names the missing package.
# gate in release: many runs of programs that start slowly with the sanitizers
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"
program="knead mesh"

# ---- an existing mesh
meshes=$KN_SOURCE/core/scenes/meshes
knead mesh "$meshes/block.msh" >out || fail "block.msh is refused"
grep -q "block.msh: Gmsh 4.1 ASCII, 169 nodes, 481 tetrahedra, 799 edges$" out || fail "wrong format or counts of block.msh"
grep -q "^size *50 x 50 x 30 mm, volume 75 cm^3$" out || fail "size and volume of block.msh"
grep -q "^warning" out && fail "block.msh gives a warning"
knead mesh "$meshes/block.msh" --unit cm | grep -q "^size *500 x 500 x 300 mm" || fail "--unit"
knead mesh "$meshes/disc.msh" | grep -q "Gmsh 2.2 ASCII, 175 nodes, 308 triangles" || fail "disc.msh"
bad=$KN_SOURCE/tests/core/meshes_bad # core.msh reads all of them
refuses 2 "$bad/$(grep '^inverted.msh' "$bad/expected")" "$bad/inverted.msh"

# ---- wrong arguments
surface=$KN_SOURCE/tests/clients/surfaces/block.obj
refuses 2 "knead mesh: expected one .obj, .stl or .msh file; see --help"
refuses 2 "knead mesh: 'dough.yaml': expected a file that ends in .obj, .stl or .msh" dough.yaml
refuses 2 "knead mesh: -o, --size and --tool make a mesh of a surface, expected a file that ends in .obj or .stl" "$meshes/block.msh" --size 5mm
refuses 2 "knead mesh: expected --size LENGTH, e.g. --size 5mm" "$surface" --out x.msh
refuses 2 "knead mesh: expected --out OUT.msh" "$surface" --size 5mm
refuses 2 "knead mesh: expected --out OUT.msh" "$surface" --size 5mm --out x.stl
refuses 2 "knead mesh: --size 5: expected a length from 1e-05 to 1 m, e.g. 5mm" "$surface" --size 5 --out x.msh
refuses 2 "knead mesh: --unit inch: expected m, cm, mm or um" "$surface" --unit inch
refuses 2 "knead mesh: --tool mesher: expected gmsh or tetgen" "$surface" --tool mesher
refuses 2 "knead mesh: --size: 0.1 mm would make about 9e+08 tetrahedra, expected at most 2097152" "$surface" \
    --size 0.1mm --out x.msh
refuses 2 "missing.msh:1:1: No such file or directory, expected a file of at most 256 MiB" missing.msh
knead mesh --help | grep -q "^usage: knead mesh IN.obj|IN.stl --out OUT.msh --size LENGTH" || fail "--help"

# ---- surfaces that cannot be filled
sed '$d' "$surface" >hole.obj
(cat "$surface" && echo "v 99 0 0" && echo "f 1 5 9") >three.obj
sed '$d' "$surface" | (cat && echo "f 6 8 4 2") >turned.obj
(cat "$surface" && sed -n 's/^v /v 1/p' "$surface" && echo "f -8 -6 -5 -7" && echo "f -4 -3 -1 -2" &&
    echo "f -8 -7 -3 -4" && echo "f -6 -2 -1 -5" && echo "f -8 -4 -2 -6" && echo "f -7 -5 -1 -3") >two.obj
echo "v 0 0 0" >points.obj
printf 'v 0 0 0\nf 1 2 3\n' >number.obj
printf 'v 0 0 0\nv 0 0 x\n' >text.obj
printf 'v 0 0 0\nf 1 1\n' >face.obj
: >empty.stl
echo "one solid block" >prose.stl
printf 'solid\nfacet\nvertex 0 0 0\nvertex 1 0 0\nendfacet\n' >corner.stl
head -c 200 "$KN_SOURCE/tests/clients/surfaces/block-binary.stl" >cut.stl
refused() { refuses 2 "$1:$2" "$1" --size 1cm --out x.msh; }
refused hole.obj "11:1: the surface has holes: 4 edges belong to one triangle only, the first to triangle 2; expected a closed surface"
refused three.obj "15:1: triangles 6, 9 and 13 share one edge, expected two at every edge"
refused turned.obj "16:1: triangles 5 and 12 face opposite ways, expected all to face outwards"
refused two.obj "25:1: 2 closed surfaces, expected one: triangle 13 does not belong to the first"
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0.3 0.3 0\nf 1 2 4\nf 2 3 4\nf 3 1 4\nf 1 3 2\n' >flat.obj
refused flat.obj "1:1: the surface encloses no volume, expected a body"
refused points.obj "1:1: no triangles, expected a closed surface"
refused number.obj "2:5: no vertex so far with this number, expected 1 to 1"
refused text.obj "2:7: not a finite number, expected a coordinate"
refused face.obj "2:1: a face of 2 corners, expected 3 or more"
refused empty.stl "1:1: empty, expected a closed surface"
refused prose.stl "1:1: not an STL file: neither binary nor text, expected 'solid'"
refused corner.stl "5:1: a facet of 2 corners, expected 3"
refused cut.stl "1:1: byte 80: 12 triangles are declared, expected 684 bytes for them, not 200"
[ -e x.msh ] && fail "a refused surface left a mesh"

# ---- without the programs
for tool in gmsh tetgen; do
    PATH=$(dirname "$(command -v knead)") refuses 3 "knead mesh: $surface: $tool is not installed: apt-get install $tool" \
        "$surface" --size 1cm --out x.msh --tool $tool
done
[ $failed = 0 ] || exit 1
for tool in gmsh tetgen; do
    command -v $tool >/dev/null || { echo "skipped: $tool is not installed"; exit 77; }
done

# ---- with the programs
export TMPDIR=$PWD/tmp
mkdir "$TMPDIR"
for tool in gmsh tetgen; do
    for file in block.obj block.stl block-binary.stl; do
        knead mesh "$KN_SOURCE/tests/clients/surfaces/$file" --out block.msh --size 1cm --tool $tool >out 2>err ||
            fail "$tool, $file: $(cat err)"
        grep -q "^surface .*12 triangles, closed, 75 cm^3 inside" out || fail "$tool, $file: $(cat out)"
        grep -q "^size *50 x 50 x 30 mm, volume 75 cm^3" out || fail "$tool, $file: $(cat out)"
        awk '/^spacing/ && $4 > 7 && $4 < 14 { good = 1 } END { exit !good }' out || fail "$tool: $(grep spacing out)"
        knead mesh block.msh | cmp -s - <(grep -v ^surface out) || fail "$tool: the mesh is reported differently when it is read back"
    done
    cp block.msh first.msh
    knead mesh "$KN_SOURCE/tests/clients/surfaces/block-binary.stl" --out block.msh --size 1cm --tool $tool >/dev/null
    cmp -s first.msh block.msh || fail "$tool makes a different mesh in the second run"
done
knead mesh "$surface" --out metre.msh --size 20cm --unit cm | grep -q "^size *500 x 500 x 300 mm" || fail "--unit cm does not scale the surface"

# Text in letters of any size, what a program appends, and corners that rounding has set apart.
sed 's/[A-Za-z]*/\U&/g' "$KN_SOURCE/tests/clients/surfaces/block.stl" >upper.stl
(sed 's/facet/Facet/; s/vertex/VERTEX/' "$KN_SOURCE/tests/clients/surfaces/block.stl" && printf '; made by\n\032') >mixed.stl
(cat "$KN_SOURCE/tests/clients/surfaces/block-binary.stl" && printf 'MATERIAL=clay, colour=red, and so on for more than fifty bytes') >tail.stl
awk '/vertex/ { $2 += 1e-4 * (NR % 3 - 1) } 1' "$KN_SOURCE/tests/clients/surfaces/block.stl" >apart.stl
(printf '\357\273\277' && sed 's/^\(f.*\) \([0-9]*\)$/\1 \\\n \2/' "$surface") >bom.obj # a byte order mark, lines that go on
sed 's/^solid.*/solid facet vertex one/; s/^endsolid.*/endsolid vertex one/' "$KN_SOURCE/tests/clients/surfaces/block.stl" >named.stl
for file in bom.obj named.stl; do
    knead mesh $file --out block.msh --size 1cm >out 2>err && grep -q "^surface .*12 triangles, closed, 75 cm^3 inside" out || fail "$file: $(cat out err)"
done
for file in upper mixed tail apart; do
    knead mesh $file.stl --out odd.msh --size 1cm >out 2>err && grep -q "12 triangles, closed, 75 cm^3 inside" out || fail "$file: $(cat out err)"
done
grep -q "corners up to 0.0002 mm apart were welded" out || fail "welding is not told: $(cat out)"

# A size that cuts off too much is made smaller. If gmsh cannot fill a surface, tetgen does.
awk 'BEGIN { n = 48; for (i = 0; i < n; i++) for (z = 0; z < 2; z++) printf "v %.6f %.6f %d\n", 10 * cos(6.2831853 * i / n), 10 * sin(6.2831853 * i / n), 10 * z
    printf "f"; for (i = n - 1; i >= 0; i--) printf " %d", 2 * i + 1; printf "\nf"; for (i = 0; i < n; i++) printf " %d", 2 * i + 2; print ""
    for (i = 0; i < n; i++) { j = (i + 1) % n; print "f", 2 * i + 1, 2 * j + 1, 2 * j + 2, 2 * i + 2 } }' >pin.obj
knead mesh pin.obj --out pin.msh --size 9mm >out 2>err && grep -q "instead of 9 mm, because larger ones change the volume by more than 5 %" out || fail "pin: $(cat out err)"
awk '/volume/ { v = $(NF - 1) } END { exit !(v > 2.97 && v < 3.28) }' out || fail "the volume of the pin: $(cat out)"
knead mesh pin.obj --out pin.msh --size 10cm >out 2>err && grep -q "instead of 100 mm\|tetgen has filled it" out err || fail "a size above the object: $(cat out err)"

# A terminal shows that a program is at work; a log does so every ten seconds.
script -qec "knead mesh $surface --out watched.msh --size 1cm" watched </dev/null >/dev/null
grep -q "gmsh at work: 0 s" watched || fail "no progress is shown on a terminal while gmsh is at work"
knead mesh "$surface" --out watched.msh --size 1cm 2>err >/dev/null
[ ! -s err ] || fail "$(cat err)"

# A corner pushed through the opposite side: the message is the program's own, in one line.
sed 's/^v 50 50 30/v 25 24 -20/' "$surface" >cross.obj
refuses 2 "knead mesh: cross.obj: tetgen cannot fill this surface: Facet #1 intersects facet #4 at triangles: (repair the surface there, split polygons into triangles, or try a smaller --size)" cross.obj \
    --size 6mm --out x.msh --tool tetgen
knead mesh cross.obj --size 6mm --out x.msh >out 2>err
[ $? = 2 ] && [ "$(wc -l <err)" = 1 ] && grep -q "^knead mesh: cross.obj: gmsh cannot fill this surface: .*intersect" err ||
    fail "a self-intersecting surface is not refused in one line: $(cat err)"
refuses 3 "knead mesh: /nowhere/x.msh: No such file or directory, expected a file that can be written" "$surface" \
    --size 2cm --out /nowhere/x.msh
[ -e x.msh ] && fail "a self-intersecting surface left a mesh"

# Stopped by a signal: neither files nor the program are left.
knead mesh "$surface" --size 1mm --out stopped.msh >out 2>err &
child=$!
for _ in $(seq 200); do
    log=$(echo "$TMPDIR"/*/log)
    [ -s "$log" ] && break
    sleep 0.02
done
[ -s "$log" ] || fail "no program was started within 4 s"
kill -TERM $child
wait $child
[ $? = 143 ] || fail "knead mesh does not die of SIGTERM"
[ -e stopped.msh ] && fail "a stopped knead mesh left a mesh"
[ -z "$(ls -A "$TMPDIR")" ] || fail "left behind: $(ls -A "$TMPDIR")"
exit $failed
