`default_nettype none
// Advance a CRC-32 of IEEE 802.3 (reflected, polynomial 0xedb88320) by one byte. A checksum begins with all ones and is
// sent inverted, lowest byte first. The CRC over data and checksum together is 0xdebb20e3. Combinational.
module knead_crc32 (
    input  wire [31:0] crc,
    input  wire [ 7:0] data,
    output wire [31:0] next
);
    // Each bit of the byte shifted out adds a constant to the rest: entries 1, 2, 4 to 128 of any CRC-32 table.
    wire [7:0] x = crc[7:0] ^ data;
    assign next = {8'd0, crc[31:8]}
        ^ (x[0] ? 32'h77073096 : 32'd0)
        ^ (x[1] ? 32'hee0e612c : 32'd0)
        ^ (x[2] ? 32'h076dc419 : 32'd0)
        ^ (x[3] ? 32'h0edb8832 : 32'd0)
        ^ (x[4] ? 32'h1db71064 : 32'd0)
        ^ (x[5] ? 32'h3b6e20c8 : 32'd0)
        ^ (x[6] ? 32'h76dc4190 : 32'd0)
        ^ (x[7] ? 32'hedb88320 : 32'd0);
endmodule
`default_nettype wire
