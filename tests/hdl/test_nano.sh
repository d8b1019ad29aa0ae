#!/usr/bin/env bash
# The small circuit, too, is core/fixed and its registers the simulated device's: the same bits in random models (KN_MODELS=N of them,
# KN_CASES=N transfers, KN_SEED=N).
# night: Verilates two circuits
source "$KN_SOURCE/tests/hdl/tools.sh"
need verilator g++
sizes="-GLOG_NODES=5 -GLOG_EDGES=7 -GLOG_LIST=4"
flags="-DKN_NANO -DKN_LOG_NODES=5 -DKN_LOG_EDGES=7 -DKN_LOG_LIST=4"
golden=$KN_BUILD/hdl/golden_nano.o
gcc -std=gnu17 -O2 -Wall -I"$KN_SOURCE" -I"$KN_BUILD" -c "$KN_SOURCE/clients/simdev/golden.c" -o "$golden" || exit 1
bench knead_nano registers --prefix Vknead_engine $sizes -LDFLAGS "$golden" -CFLAGS "$flags"
KN_CASES=${KN_CASES:-20000} "$bench" || fail=1
bench knead_nano engine --prefix Vknead_engine $sizes -CFLAGS "$flags"
KN_MODELS=${KN_MODELS:-150} "$bench" || fail=1
exit $fail
