`default_nettype none
// CRC-32 of IEEE 802.3 (reflected, polynomial 0xedb88320), one byte further. It begins with all ones and is sent
// inverted, lowest byte first; over data and checksum together it ends as 0xdebb20e3. Combinational.
module knead_crc32 (
    input  wire [31:0] crc,
    input  wire [ 7:0] data,
    output reg  [31:0] next
);
    integer i;
    always @* begin
        next = crc ^ {24'd0, data};
        for (i = 0; i < 8; i = i + 1) next = {1'b0, next[31:1]} ^ (next[0] ? 32'hedb88320 : 32'd0);
    end
endmodule
`default_nettype wire
