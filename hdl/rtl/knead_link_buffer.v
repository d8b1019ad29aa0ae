`default_nettype none
// Bytes in block RAM, with one write port and one read port. Data comes one clock after its address.
module knead_link_buffer #(
    parameter BITS = 10 // bits of an address
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
