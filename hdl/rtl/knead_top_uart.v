`default_nettype none
// A board on a serial line: the engine behind the link, on two wires. CLOCKS is the number of clocks per bit: 48 MHz
// and 3 Mbaud give 16. The reset input may be tied low if the board's flip-flops begin at zero, because this module
// holds its reset for the first 16 clocks in any case.
module knead_top_uart #(
    parameter LOG_NODES = 10,
    parameter LOG_EDGES = 13,
    parameter LOG_LIST = 6,
    parameter [15:0] CLOCKS = 16'd16
) (
    input  wire clk,
    input  wire rst,
    input  wire rx,
    output wire tx
);
    reg [4:0] begun = 5'd0;
    always @(posedge clk) if (!begun[4]) begun <= begun + 5'd1;
    wire reset = rst | ~begun[4];

    wire        bus_valid, bus_write, bus_ready, bus_error;
    wire [23:0] bus_addr;
    wire [31:0] bus_wdata, bus_rdata, frames, crc_errors, cobs_errors, length_errors, framing_errors, overruns;
    knead_link_serial #(.CLOCKS(CLOCKS)) link (
        .clk(clk), .rst(reset), .rx(rx), .tx(tx), .bus_valid(bus_valid), .bus_write(bus_write), .bus_addr(bus_addr),
        .bus_wdata(bus_wdata), .bus_ready(bus_ready), .bus_rdata(bus_rdata), .bus_error(bus_error), .frames(frames),
        .crc_errors(crc_errors), .cobs_errors(cobs_errors), .length_errors(length_errors),
        .framing_errors(framing_errors), .overruns(overruns));
    knead_engine #(.LOG_NODES(LOG_NODES), .LOG_EDGES(LOG_EDGES), .LOG_LIST(LOG_LIST)) engine (
        .clk(clk), .rst(reset), .bus_valid(bus_valid), .bus_write(bus_write), .bus_addr(bus_addr),
        .bus_wdata(bus_wdata), .bus_ready(bus_ready), .bus_rdata(bus_rdata), .bus_error(bus_error));
    wire unused = &{frames, crc_errors, cobs_errors, length_errors, framing_errors, overruns};
endmodule
`default_nettype wire
