`default_nettype none
// Frames out of bytes: COBS( payload | CRC-32 ) 0x00, payload 1 to 1024 bytes; server/backend/frame.h is the same in C.
//
// A byte comes with in_valid, one per clock at most. The payload leaves as it comes, a byte with store at address; it
// counts only once good says, for one clock, that a whole frame has ended and its checksum held. length is the
// payload's then. What is wrong is one clock of one of the three, the first that holds: bad_length (too long),
// bad_cobs, bad_length (too short), bad_crc.
//
// After a 0x00 every register is as out of reset, whatever came before: that is why any frame behind a 0x00 is heard.
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
    localparam [10:0] CHECKSUM = 11'd4, MOST = 11'd1028; // bytes within the coding
    localparam [31:0] RESIDUE = 32'hdebb20e3;

    reg [10:0] size;  // bytes so far; MOST + 1: too many
    reg [ 7:0] left;  // bytes of the block that have not come
    reg        begun; // a block has
    reg        full;  // it is one of 254, behind which no 0 is meant
    reg        hollow; // it is empty, behind a full one: no sender of ours would
    reg [31:0] crc;

    wire        ends = in_valid && in_data == 8'd0;
    wire        code = in_valid && in_data != 8'd0 && left == 8'd0;
    wire        byte_comes = (in_valid && in_data != 8'd0 && left != 8'd0) || (code && begun && !full);
    wire [31:0] crc_next;

    assign data    = code ? 8'd0 : in_data;
    assign store   = byte_comes && !size[10];
    assign address = size[9:0];
    assign length  = size - CHECKSUM;

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
