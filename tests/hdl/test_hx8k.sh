#!/usr/bin/env bash
# The small circuit fits an iCE40-HX8K with its link at 36 MHz and gives a bitstream (one seed; hdl/reports/run takes
# more).
# night: place and route take minutes
source "$KN_SOURCE/tests/hdl/tools.sh"
need yosys nextpnr-ice40 icepack icetime
"$KN_SOURCE/hdl/reports/hx8k" "$KN_BUILD"
