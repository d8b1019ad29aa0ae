#!/usr/bin/env bash
# The lattice as a circuit and as core/fixed give the same bits in random models (KN_MODELS=N of them, KN_SEED=N).
# night: Verilates a circuit
source "$KN_SOURCE/tests/hdl/tools.sh"
bench knead_engine engine -GLOG_NODES=7 -GLOG_EDGES=12 -GLOG_LIST=5
