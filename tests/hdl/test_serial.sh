#!/usr/bin/env bash
# The link on two wires, bit by bit: rates that are off, glitches, breaks, noise, floods (KN_CASES=N, KN_SEED=N). Five
# clocks a bit are the fewest with which a rate may be 3 % off.
# night: Verilates two circuits
source "$KN_SOURCE/tests/hdl/tools.sh"
for clocks in 5 16; do
    bench knead_link_serial serial -GCLOCKS="16'd$clocks" || fail=1
done
exit $fail
