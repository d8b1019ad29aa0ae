#!/usr/bin/env bash
# Every module of hdl/rtl and hdl/boards is one file of its name, in Verilog-2005, with every width explicit. No warning
# is waived.
source "$KN_SOURCE/tests/hdl/tools.sh"
need verilator
echo 'module knead_pll (input wire clkin, output wire clkout0, locked); assign {clkout0, locked} = {2{clkin}}; endmodule' >knead_pll.v # as ecppll's
for file in "$rtl"/*.v "$KN_SOURCE"/hdl/boards/*.v; do
    module=$(basename "$file" .v)
    if verilator --lint-only -Wall --default-language 1364-2005 -y . -y "$rtl" -y "$tables" --top-module "$module" "$file" >lint.log 2>&1; then
        echo "ok   $module"
    else
        echo "FAIL $module" && cat lint.log && fail=1
    fi
    head -1 "$file" | grep -qx '`default_nettype none' || { echo "FAIL $module: no default_nettype none" && fail=1; }
done
found=$(grep -n 'lint_off' "$rtl"/*.v "$KN_SOURCE"/hdl/boards/*.v)
[ -z "$found" ] || { printf 'FAIL waived:\n%s\n' "$found" && fail=1; }
exit $fail
