`default_nettype none
// Bytes in block RAM: one write port, one read port whose data comes a clock behind its address.
module knead_link_buffer #(
    parameter BITS = 10 // of an address
) (
    input  wire            clk,
    input  wire            write,
    input  wire [BITS-1:0] write_address,
    input  wire [     7:0] write_data,
    input  wire [BITS-1:0] read_address,
    output reg  [     7:0] read_data
);
    reg [7:0] bytes [0:(1 << BITS) - 1];

    always @(posedge clk) begin
        if (write) bytes[write_address] <= write_data;
        read_data <= bytes[read_address];
    end
endmodule
`default_nettype wire
