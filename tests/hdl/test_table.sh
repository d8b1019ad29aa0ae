#!/usr/bin/env bash
# The tables in hdl/REGISTERS.md are the formats and registers that the circuit and the host use.
source "$KN_SOURCE/tests/hdl/tools.sh"
"$KN_BUILD/hdl/knead_table" REGISTERS.md >table.md
sed -n '/^| format |/,/^$/p; /^| register |/,/^$/p; /^| window |/,/^$/p' "$KN_SOURCE/hdl/REGISTERS.md" | sed -e '$ { /^$/d }' >page.md
[ -s table.md ] && diff table.md page.md && echo "ok   formats, registers and windows as in hdl/REGISTERS.md"
