`default_nettype none
// After one 0x00 a decoder does what any other decoder does that has seen this 0x00, for example one just out of reset.
// It stores the same bytes, accepts the same frames and counts the same errors. Two decoders begin with any registers;
// proved by induction, for all time.
module framer_resync (
    input wire       clk, in_valid,
    input wire [7:0] in_data
);
    wire [ 1:0] store, good, bad_length, bad_cobs, bad_crc;
    wire [19:0] address;
    wire [15:0] data;
    wire [21:0] length;
    knead_link_decode pair[1:0] (
        .clk(clk), .rst(1'b0), .in_valid(in_valid), .in_data(in_data), .store(store), .address(address), .data(data),
        .good(good), .length(length), .bad_length(bad_length), .bad_cobs(bad_cobs), .bad_crc(bad_crc));

    wire [31:0] crc_0, crc_1; // peek: pair[0].crc pair[1].crc
    wire [ 7:0] left_0, left_1; // peek: pair[0].left pair[1].left
    wire        begun_0, full_0, hollow_0; // peek: pair[0].begun pair[0].full pair[0].hollow
    wire        begun_1, full_1, hollow_1; // peek: pair[1].begun pair[1].full pair[1].hollow

    reg delimited = 1'b0;
    always @(posedge clk) begin
        if (in_valid && in_data == 8'd0) delimited <= 1'b1;
        if (delimited) begin
            assert (crc_0 == crc_1 && left_0 == left_1 && begun_0 == begun_1 && full_0 == full_1);
            assert (hollow_0 == hollow_1 && length[10:0] == length[21:11]);
            assert (store[0] == store[1] && address[9:0] == address[19:10] && data[7:0] == data[15:8]);
            assert (good[0] == good[1] && bad_length[0] == bad_length[1]);
            assert (bad_cobs[0] == bad_cobs[1] && bad_crc[0] == bad_crc[1]);
        end
        cover (delimited && good[0]);
    end
endmodule
`default_nettype wire
