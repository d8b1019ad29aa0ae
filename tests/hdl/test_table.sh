#!/usr/bin/env bash
# hdl/README.md says of formats and registers what the circuit and the host read.
source "$KN_SOURCE/tests/hdl/tools.sh"
"$KN_BUILD/hdl/knead_table" --markdown >table.md
sed -n '/^| format |/,/^$/p; /^| register |/,/^$/p; /^| window |/,/^$/p' "$KN_SOURCE/hdl/README.md" | sed -e '$ { /^$/d }' >readme.md
[ -s table.md ] && diff table.md readme.md && echo "ok   formats, registers and windows as in hdl/README.md"
