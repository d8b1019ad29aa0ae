#!/usr/bin/env bash
# Proofs of the engine's sums, its doorbell and its AXI4-Lite slave.
# night: proofs take half a minute
source "$KN_SOURCE/tests/hdl/tools.sh"

prove accumulator induction 3 knead_accumulator.v knead_ram.v
cover 12
mutant 12 knead_accumulator.v 's/assign o_sum = forward_r ? written_r : cell_r/assign o_sum = cell_r/'
mutant 12 knead_accumulator.v 's/write_r \&\& address_r == i_address/write_r/'
mutant 12 knead_accumulator.v 's/forward_r <= write_r \&\& /forward_r <= /'

prove doorbell induction 5 knead_registers.v
cover 24
mutant 24 knead_registers.v 's/knock \&\& next_seq \&\& loaded) seq/knock) seq/'
mutant 24 knead_registers.v 's/o_tick <= knock \&\& next_seq/o_tick <= knock/'
mutant 24 knead_registers.v "s/config_ = i_bus_wdata == seq + 32'd1/config_ = 1'b0/"
mutant 24 knead_registers.v 's/!is_window || i_busy || busy_seen/!is_window/'
mutant 24 knead_registers.v "s/.KN_REG_PASSES: begin read/\`KN_REG_PASSES: begin config_ = 1'b0; read/"
mutant 24 knead_registers.v "s/.KN_REG_RELAX: begin read/\`KN_REG_RELAX: begin config_ = 1'b0; read/"
mutant 24 knead_registers.v "s/if (control \&\& i_bus_wdata\[3\]) loaded <= sane;/if (control) loaded <= 1'b1;/"
mutant 24 knead_registers.v 's/else if (write \&\& is_config || o_act \&\& is_omega) loaded <= 1.b0;//'

prove axi induction 3 knead_top_axi.v
cover 12
mutant 12 knead_top_axi.v 's/valid <= take_read || whole;/valid <= 1;/'
mutant 12 knead_top_axi.v "s/s_axi_bvalid \&\& s_axi_bready) s_axi_bvalid/s_axi_bvalid) s_axi_bvalid/"
mutant 12 knead_top_axi.v 's/rest \&\& s_axi_arvalid \&\& !take_write/rest \&\& s_axi_arvalid/'
exit $fail
