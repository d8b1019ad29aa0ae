#!/usr/bin/env bash
# Proofs of the serial line's sender and receiver: every byte sent is heard, and from any state a quiet line leads to
# idle.
# night: proofs take half a minute
source "$KN_SOURCE/tests/hdl/tools.sh"

prove uart_idle bmc 94 knead_uart_rx.v
mutant 94 knead_uart_rx.v 's/default: if (level) state <= IDLE;/default: ;/'
mutant 94 knead_uart_rx.v 's/strobe = count >= /strobe = count == /'

prove uart_loop induction 7 knead_uart_rx.v knead_uart_tx.v
cover 60
mutant 60 knead_uart_rx.v 's/{level, shift\[7:1\]}/{shift[6:0], level}/'
mutant 60 knead_uart_rx.v 's/HALF = (CLOCKS >> 1)/HALF = CLOCKS/'
mutant 60 knead_uart_tx.v "s/left  <= 4'd10/left  <= 4'd9/"
exit $fail
