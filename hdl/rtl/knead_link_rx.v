`default_nettype none
// The receiving side: checked payloads out of bytes. It keeps two payloads, one that is being executed and one that is
// coming in. While both are full, in_ready is low. frame says that a payload of length bytes is there. read_data is the
// byte at read_address, one clock later. release_frame frees the payload's buffer.
module knead_link_rx (
    input  wire        clk,
    input  wire        rst,
    input  wire        in_valid,
    input  wire [ 7:0] in_data,
    output wire        in_ready,
    output wire        frame,
    output wire [10:0] length,
    input  wire [ 9:0] read_address,
    output wire [ 7:0] read_data,
    input  wire        release_frame,
    output reg  [31:0] frames, // counters; they wrap
    output reg  [31:0] crc_errors,
    output reg  [31:0] cobs_errors,
    output reg  [31:0] length_errors
);
    reg         bank_in, bank_out; // buffer that bytes go to; buffer that is read
    reg  [ 1:0] full;
    reg  [10:0] length_0, length_1;

    wire        store, good, bad_length, bad_cobs, bad_crc;
    wire [ 9:0] address;
    wire [ 7:0] data;
    wire [10:0] size;

    assign in_ready = !full[bank_in];
    assign frame    = full[bank_out];
    assign length   = bank_out ? length_1 : length_0;

    knead_link_decode decode (
        .clk(clk), .rst(rst), .in_valid(in_valid && in_ready), .in_data(in_data),
        .store(store), .address(address), .data(data), .good(good), .length(size),
        .bad_length(bad_length), .bad_cobs(bad_cobs), .bad_crc(bad_crc)
    );
    knead_ram #(8, 11) banks (
        .clk(clk), .i_write(store), .i_write_address({bank_in, address}), .i_data(data),
        .i_address({bank_out, read_address}), .o_data(read_data)
    );

    always @(posedge clk) begin
        if (good) begin
            full[bank_in] <= 1'b1;
            bank_in       <= !bank_in;
            if (bank_in) length_1 <= size;
            else length_0 <= size;
        end
        if (release_frame) begin
            full[bank_out] <= 1'b0;
            bank_out       <= !bank_out;
        end
        if (rst) begin
            full     <= 2'b00;
            bank_in  <= 1'b0;
            bank_out <= 1'b0;
        end
    end

    always @(posedge clk) begin
        if (good) frames <= frames + 32'd1;
        if (bad_crc) crc_errors <= crc_errors + 32'd1;
        if (bad_cobs) cobs_errors <= cobs_errors + 32'd1;
        if (bad_length) length_errors <= length_errors + 32'd1;
        if (rst) begin
            frames        <= 32'd0;
            crc_errors    <= 32'd0;
            cobs_errors   <= 32'd0;
            length_errors <= 32'd0;
        end
    end
endmodule
`default_nettype wire
