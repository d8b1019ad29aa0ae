#!/usr/bin/env bash
# An object from a mesh is served like a block. The log of a press replays to the bit while the mesh is in its place
# or beside the log. The log is refused once the mesh has been edited.
source "$KN_SOURCE/tests/e2e/kneadd.sh" || exit 70
mkdir here there
cp "$KN_SOURCE/core/scenes/meshes/block.msh" here/bread.msh
start_kneadd dough-small.yaml --set object.mesh="$PWD/here/bread.msh" --set object.mesh_unit=mm --touch --local-model
knead touch --probe finger --once --seconds 60 >once.txt 2>&1 & touch=$!
$ahead knead probe --path poke --probe finger --quiet
check "a finger pokes the mesh and gets the place and the pressure of its contact" ended $touch
check "$(cat once.txt)" grep -q 'finger: area [0-9.]* cm2, peak [0-9.]* kPa' once.txt
stop_kneadd
pressed "$KN_SOURCE/core/scenes/dough-small.yaml" press.lcmlog 10 object.mesh="$PWD/here/bread.msh" object.mesh_unit=mm

check "the log verifies" verifies press.lcmlog
check "the peak contact force is above 1 N" awk '/peak contact force/ { for (i = 1; i < NF; i++) if ($(i + 1) == "N") { exit !($i > 1) } }' press.lcmlog.said
mv here/bread.msh there
expect 'object.mesh: No such file or directory, expected a Gmsh mesh$' 2 knead replay press.lcmlog
cp press.lcmlog there
check "with the mesh beside the log it verifies" verifies there/press.lcmlog
sed 's/^-25 -25 0$/-25.5 -25 0/' there/bread.msh >here/bread.msh
cmp -s here/bread.msh there/bread.msh && echo "FAIL the mesh was not edited" && failed=1
expect 'object.mesh_hash is .*: the file has changed since' 2 knead replay press.lcmlog
check "the log finds its old mesh beside it and verifies" verifies there/press.lcmlog
exit $failed
