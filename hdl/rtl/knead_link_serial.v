`default_nettype none
// The link on two wires. Beside the link's counters it counts bytes without a stop bit (framing errors) and bytes that
// came when the link had no room (overruns).
module knead_link_serial #(
    parameter [15:0] CLOCKS = 16'd16 // per bit, 4 at least
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        rx,
    output wire        tx,
    output wire        bus_valid,
    output wire        bus_write,
    output wire [23:0] bus_addr,
    output wire [31:0] bus_wdata,
    input  wire        bus_ready,
    input  wire [31:0] bus_rdata,
    input  wire        bus_error,
    output wire [31:0] frames, // counters; they wrap
    output wire [31:0] crc_errors,
    output wire [31:0] cobs_errors,
    output wire [31:0] length_errors,
    output reg  [31:0] framing_errors,
    output reg  [31:0] overruns
);
    wire       rx_valid, rx_ready, tx_valid, tx_ready, framing, overrun;
    wire [7:0] rx_data, tx_data;

    knead_uart_rx #(.CLOCKS(CLOCKS)) receiver (
        .clk(clk), .rst(rst), .rx(rx), .out_valid(rx_valid), .out_data(rx_data), .out_ready(rx_ready),
        .framing(framing), .overrun(overrun)
    );
    knead_uart_tx #(.CLOCKS(CLOCKS)) sender (
        .clk(clk), .rst(rst), .in_valid(tx_valid), .in_data(tx_data), .in_ready(tx_ready), .tx(tx)
    );
    knead_link link (
        .clk(clk), .rst(rst), .rx_valid(rx_valid), .rx_data(rx_data), .rx_ready(rx_ready),
        .tx_valid(tx_valid), .tx_data(tx_data), .tx_ready(tx_ready),
        .bus_valid(bus_valid), .bus_write(bus_write), .bus_addr(bus_addr), .bus_wdata(bus_wdata),
        .bus_ready(bus_ready), .bus_rdata(bus_rdata), .bus_error(bus_error),
        .frames(frames), .crc_errors(crc_errors), .cobs_errors(cobs_errors), .length_errors(length_errors)
    );

    always @(posedge clk) begin
        if (framing) framing_errors <= framing_errors + 32'd1;
        if (overrun) overruns <= overruns + 32'd1;
        if (rst) begin
            framing_errors <= 32'd0;
            overruns       <= 32'd0;
        end
    end
endmodule
`default_nettype wire
