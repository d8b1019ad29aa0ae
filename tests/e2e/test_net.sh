#!/usr/bin/env bash
# An object of tetrahedra is served, poked, drawn and replayed as a block is.
. "$KN_SOURCE/tests/e2e/kneadd.sh"
mkdir meshes
cp "$KN_SOURCE/core/scenes/bun.yaml" .
cp "$KN_SOURCE/core/scenes/meshes/bun.msh" meshes/

start_kneadd bun.yaml
knead probe --path poke --depth '4 mm' --record poke.lcmlog >out 2>err
code=$?
check "a bun is poked ($(tail -1 err))" [ $code = 0 ]
check "the dent is told" grep -qE 'residual depth +[1-9][0-9.]* mm' out
knead view --png bun.png --size 320x180 --wait 20 >view 2>&1
check "and drawn, when there is OpenGL ($(cat view))" grep -qE 'bun.yaml live|install the package' view
stop_kneadd
check "kneadd ends well" [ $status = 0 ]

knead replay poke.lcmlog --verify >verify 2>&1
check "its log replays to the same forces ($(tail -1 verify))" grep -qE 'verified [1-9][0-9]* forces' verify

# the log names the mesh and its hash; the file it was made with is gone, another of its name is no replacement
knead check bun.yaml --text >text.yaml
sed -i "s|^\( *mesh: \).*|\1$PWD/elsewhere/bun.msh|" text.yaml
cp meshes/bun.msh bun.msh
check "a mesh is found beside what names it" eval 'knead check text.yaml >/dev/null 2>err2 || ! cat err2'
cp "$KN_SOURCE/core/scenes/meshes/block.msh" bun.msh
knead check text.yaml >/dev/null 2>err
[ $? = 2 ] && check "another mesh of that name is refused" grep -q 'hash' err || check "another mesh is refused" false
exit $failed
