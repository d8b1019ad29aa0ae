`default_nettype none
// The small circuit on Lattice's iCE40-HX8K breakout board: 32 nodes, 128 edges, 15 boundary records, at 36 MHz. It
// uses the serial line of the board's USB port at 3 Mbaud. hdl/reports/hx8k places and routes it.
module hx8k (
    input  wire clk, // 12 MHz
    input  wire rx,
    output wire tx
);
    wire fast, locked;
    SB_PLL40_CORE #(
        .FEEDBACK_PATH("SIMPLE"), .DIVR(4'd0), .DIVF(7'd47), .DIVQ(3'd4), .FILTER_RANGE(3'd1)
    ) pll (
        .REFERENCECLK(clk), .PLLOUTGLOBAL(fast), .LOCK(locked), .RESETB(1'b1), .BYPASS(1'b0)
    );
    knead_top_uart #(.NANO(1), .LOG_NODES(5), .LOG_EDGES(7), .LOG_LIST(4), .CLOCKS(16'd12)) top (
        .clk(fast), .rst(!locked), .rx(rx), .tx(tx)
    );
endmodule
`default_nettype wire
