#!/usr/bin/env bash
# The link as a circuit and as C give the same bytes, bus transfers and counters for any input of the line (KN_CASES=N
# lines, KN_SEED=N).
source "$KN_SOURCE/tests/hdl/tools.sh"
bench knead_link link
