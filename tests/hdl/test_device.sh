#!/usr/bin/env bash
# The driver against the circuit itself, under Verilator in knead-simdev: identify, load, ticks, faults, kills (KN_TICKS=N, KN_KILLS=N).
source "$KN_SOURCE/tests/hdl/tools.sh"
need verilator g++
timeout 1 knead-simdev --uart --engine rtl >/dev/null 2>said
[ $? = 3 ] && echo "skipped: $(cat said)" && exit 77
cd "$KN_BUILD" && KN_ENGINE=rtl KN_TICKS=${KN_TICKS:-300} tests/test_server_device
