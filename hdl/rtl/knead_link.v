`default_nettype none
// The link: bytes in, bytes out, and a 32-bit word bus of which it is the only master. A frame that passes every check
// is executed and answered; any other frame only adds to a counter (hdl/REGISTERS.md). rx_ready goes low while one
// request is executed and another one waits. A line that cannot wait then loses bytes, and that frame fails its
// checksum.
module knead_link (
    input  wire        clk,
    input  wire        rst,
    input  wire        rx_valid,
    input  wire [ 7:0] rx_data,
    output wire        rx_ready,
    output wire        tx_valid,
    output wire [ 7:0] tx_data,
    input  wire        tx_ready,
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
    output wire [31:0] length_errors
);
    wire        frame, put, send, busy;
    wire [10:0] length;
    wire [ 9:0] read_address, put_address, send_length;
    wire [ 7:0] read_data, put_data;

    knead_link_rx receiver (
        .clk(clk), .rst(rst), .in_valid(rx_valid), .in_data(rx_data), .in_ready(rx_ready),
        .frame(frame), .length(length), .read_address(read_address), .read_data(read_data),
        .release_frame(send), .frames(frames), .crc_errors(crc_errors), .cobs_errors(cobs_errors),
        .length_errors(length_errors)
    );
    knead_link_exec exec (
        .clk(clk), .rst(rst), .frame(frame), .length(length), .read_address(read_address), .read_data(read_data),
        .busy(busy), .put(put), .put_address(put_address), .put_data(put_data), .send(send), .send_length(send_length),
        .bus_valid(bus_valid), .bus_write(bus_write), .bus_addr(bus_addr), .bus_wdata(bus_wdata), .bus_ready(bus_ready),
        .bus_rdata(bus_rdata), .bus_error(bus_error)
    );
    knead_link_tx sender (
        .clk(clk), .rst(rst), .write(put), .write_address(put_address), .write_data(put_data),
        .start(send), .length(send_length), .busy(busy),
        .out_valid(tx_valid), .out_data(tx_data), .out_ready(tx_ready)
    );
endmodule
`default_nettype wire
