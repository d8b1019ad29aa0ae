#!/usr/bin/env bash
# The driver against the Verilated circuit in knead-simdev: identify, load, ticks, faults, kills (KN_TICKS=N,
# KN_KILLS=N).
# night: a circuit under Verilator
source "$KN_SOURCE/tests/hdl/tools.sh"
need verilator g++
timeout 1 knead-simdev --uart --engine rtl >serves 2>said
[ $? = 3 ] && echo "skipped: $(cat said)" && exit 77
grep -q '^rtl behind knead_link: ' serves || { echo "FAIL the circuit's own link is not before it: $(cat serves)" && fail=1; }
cd "$KN_BUILD" || exit 1
KN_ENGINE=rtl KN_TICKS=${KN_TICKS:-300} tests/test_server_circuit_device || fail=1
exit $fail
