#!/usr/bin/env bash
# Proofs of the link: it is in step again behind any 0x00, executes whole frames and no others, and keeps the protocol
# of the bus.
# night: proofs take half a minute
source "$KN_SOURCE/tests/hdl/tools.sh"

prove framer_resync induction 4 knead_link_decode.v knead_crc32.v
cover 12
mutant 8 knead_link_decode.v "s/^            hollow <= 1'b0;//"
mutant 8 knead_link_decode.v "s/^            left   <= 8'd0;//"
mutant 8 knead_link_decode.v 's/if (rst || ends)/if (rst || good)/'

prove link_checked induction 3 knead_link_rx.v knead_link_decode.v knead_crc32.v knead_link_exec.v
mutant 30 knead_link_decode.v 's/ && crc == RESIDUE//'
mutant 30 knead_link_decode.v "s/crc    <= 32'hffffffff;//"
mutant 30 knead_link_rx.v 's/if (good) begin/if (good || bad_crc) begin/'
mutant 30 knead_link_exec.v 's/if (frame \&\& !busy)/if (!busy)/'

prove link_bus induction 3 knead_link_exec.v
cover 60
mutant 18:40 knead_link_exec.v 's/assign bus_addr      = address;/assign bus_addr = address ^ {16'"'"'d0, read_data};/'
mutant 18:40 knead_link_exec.v 's/BUS: if (bus_ready)/BUS: if (bus_ready || busy)/'
mutant 18:40 knead_link_exec.v "s/asked == 8'd0 || !fits/!fits/"
exit $fail
