#!/usr/bin/env bash
# The circuit's registers and the simulated device's give the same answers to any request of a host (KN_CASES=N
# transfers, KN_SEED=N).
# night: Verilates a circuit
source "$KN_SOURCE/tests/hdl/tools.sh"
bench knead_engine registers -GLOG_NODES=3 -GLOG_EDGES=4 -GLOG_LIST=2
