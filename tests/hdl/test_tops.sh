#!/usr/bin/env bash
# Ticks through the boards' tops, compared with core/fixed: knead_top_uart through its two wires, bit by bit;
# knead_top_axi through AXI4-Lite cycles (KN_MODELS=N lattices, KN_SEED=N).
# night: Verilates two circuits
source "$KN_SOURCE/tests/hdl/tools.sh"
sizes="-GLOG_NODES=5 -GLOG_EDGES=7 -GLOG_LIST=4"
export KN_MODELS=${KN_MODELS:-4}
bench knead_top_uart engine $sizes -GCLOCKS="16'd4" -CFLAGS -DKN_TOP_UART || fail=1
KN_MODELS=$((5 * KN_MODELS)) bench knead_top_axi engine $sizes -CFLAGS -DKN_TOP_AXI || fail=1
exit $fail
