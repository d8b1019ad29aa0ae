`default_nettype none
// The engine on a ULX3S with an LFE5U-85F: 25 MHz oscillator, and two wires to its USB serial converter. hdl/boards/run
// lets ecppll write knead_pll, which makes 45 MHz of 25: 15 clocks a bit at 3 Mbaud.
module knead_ulx3s (
    input  wire clk_25mhz,
    input  wire ftdi_txd,
    output wire ftdi_rxd
);
    wire clk, locked;
    knead_pll pll (.clkin(clk_25mhz), .clkout0(clk), .locked(locked));
    reg [1:0] unlocked; // locked comes at any time; reset ends with a clock
    initial unlocked = 2'b11;
    always @(posedge clk) unlocked <= {unlocked[0], ~locked};
    knead_top_uart #(.CLOCKS(16'd15)) top (
        .clk(clk), .rst(unlocked[1]), .rx(ftdi_txd), .tx(ftdi_rxd));
endmodule
`default_nettype wire
