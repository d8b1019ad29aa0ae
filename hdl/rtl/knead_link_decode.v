`default_nettype none
// Decode frames from bytes: COBS( payload | CRC-32 ) 0x00, payload 1 to 1024 bytes. server/backend/frame.h is the same
// decoder in C.
//
// A byte comes with in_valid, one per clock at most. The payload leaves while it comes in: a byte with store, at
// address. It counts only when good is high for one clock, which says that a whole frame has ended and its checksum
// held; length is then the payload's length. A faulty frame raises one of three signals for one clock, the first that
// holds of: bad_length (too long), bad_cobs, bad_length (too short), bad_crc.
//
// After a 0x00 every register is as after reset, whatever came before. Any frame behind a 0x00 is therefore decoded.
module knead_link_decode (
    input  wire        clk,
    input  wire        rst,
    input  wire        in_valid,
    input  wire [ 7:0] in_data,
    output wire        store,
    output wire [ 9:0] address,
    output wire [ 7:0] data,
    output wire        good,
    output wire [10:0] length,
    output wire        bad_length,
    output wire        bad_cobs,
    output wire        bad_crc
);
    localparam [10:0] CHECKSUM = 11'd4, MOST = 11'd1028; // bytes of payload and checksum, after decoding
    localparam [31:0] RESIDUE = 32'hdebb20e3;

    reg [10:0] size;  // bytes so far; MOST + 1: too many
    reg [ 7:0] left;  // bytes of the block still to come
    reg        begun; // a block has begun
    reg        full;  // the block is one of 254 bytes, which no implied 0 follows
    reg        hollow; // the block is empty and follows a full one; our senders never send that
    reg [31:0] crc;

    // A byte of the line is the 0x00, a block's length byte, or data. The length byte of a later block stands for a 0,
    // unless the block before it was full.
    wire        ends = in_valid && in_data == 8'd0;
    wire        code = in_valid && in_data != 8'd0 && left == 8'd0;
    wire        byte_comes = (in_valid && in_data != 8'd0 && left != 8'd0) || (code && begun && !full);
    wire [31:0] crc_next;

    assign data    = code ? 8'd0 : in_data;
    assign store   = byte_comes && !size[10];
    assign address = size[9:0];
    assign length  = size - CHECKSUM;

    // Judge the frame at its 0x00.
    wire too_long  = size > MOST;
    wire too_short = size <= CHECKSUM;
    wire torn      = left != 8'd0 || hollow;
    wire judged    = ends && begun;
    assign bad_length = judged && (too_long || (too_short && !torn));
    assign bad_cobs   = judged && torn && !too_long;
    assign bad_crc    = judged && !torn && !too_long && !too_short && crc != RESIDUE;
    assign good       = judged && !torn && !too_long && !too_short && crc == RESIDUE;

    knead_crc32 sum (.crc(crc), .data(data), .next(crc_next));

    always @(posedge clk) begin
        if (byte_comes && !too_long) size <= size + 11'd1;
        if (byte_comes) crc <= crc_next;
        if (code) begin
            begun  <= 1'b1;
            full   <= in_data == 8'hff;
            hollow <= full && in_data == 8'd1;
            left   <= in_data - 8'd1;
        end else if (byte_comes) left <= left - 8'd1;
        if (rst || ends) begin
            size   <= 11'd0;
            left   <= 8'd0;
            begun  <= 1'b0;
            full   <= 1'b0;
            hollow <= 1'b0;
            crc    <= 32'hffffffff;
        end
    end
endmodule
`default_nettype wire
