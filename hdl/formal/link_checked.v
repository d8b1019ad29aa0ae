`default_nettype none
// Nothing reaches the bus unless a whole frame has come and its checksum held. This module describes a whole frame a
// second time. The link's own buffers may hold anything. By induction, from reset: the link holds as many frames as
// have come whole and have not been answered; bus_valid is never high when it holds none; and a frame is not
// overwritten while it is executed.
module link_checked (
    input wire        clk, in_valid, bus_ready, bus_error, busy,
    input wire [ 7:0] in_data,
    input wire [31:0] bus_rdata
);
    reg         rst = 1'b1;
    wire        in_ready, frame, put, send, bus_valid, bus_write;
    wire [10:0] length;
    wire [ 9:0] read_address, put_address, send_length;
    wire [ 7:0] read_data, put_data;
    wire [23:0] bus_addr;
    wire [31:0] bus_wdata, frames, crc_errors, cobs_errors, length_errors;

    knead_link_rx receiver (.release_frame(send), .*);
    knead_link_exec exec (.*);

    // The second description of a frame.
    reg  [10:0] bytes;
    reg  [ 7:0] block, rest; // the block's length byte, 0 before the first; its bytes still to come
    reg  [ 7:0] before;      // the length byte of the block before
    reg  [31:0] sum;
    reg  [ 1:0] owed;        // whole frames that have not been answered

    wire comes = in_valid && in_ready;
    wire whole = comes && in_data == 8'd0 && rest == 8'd0 && !(before == 8'hff && block == 8'd1) &&
                 bytes >= 11'd5 && bytes <= 11'd1028 && sum == 32'hdebb20e3;
    wire is_zero = comes && in_data != 8'd0 && rest == 8'd0 && block != 8'd0 && block != 8'hff;
    wire is_byte = comes && in_data != 8'd0 && rest != 8'd0;

    wire [31:0] sum_next;
    knead_crc32 check (.crc(sum), .data(is_zero ? 8'd0 : in_data), .next(sum_next));

    always @(posedge clk) begin
        rst <= 1'b0;
        if (is_zero || is_byte) begin
            sum <= sum_next;
            if (bytes <= 11'd1028) bytes <= bytes + 11'd1;
        end
        if (is_byte) rest <= rest - 8'd1;
        else if (comes && in_data != 8'd0) begin
            rest   <= in_data - 8'd1;
            block  <= in_data;
            before <= block;
        end
        if (rst || (comes && in_data == 8'd0)) begin
            bytes  <= 11'd0;
            block  <= 8'd0;
            before <= 8'd0;
            rest   <= 8'd0;
            sum    <= 32'hffffffff;
        end
        owed <= rst ? 2'd0 : owed + {1'b0, whole} - {1'b0, send};
    end

    wire [31:0] crc; // peek: receiver.decode.crc
    wire [10:0] size; // peek: receiver.decode.size
    wire [ 7:0] left; // peek: receiver.decode.left
    wire        begun, full_block; // peek: receiver.decode.begun receiver.decode.full
    wire        hollow, store; // peek: receiver.decode.hollow receiver.decode.store
    wire        bank_in, bank_out; // peek: receiver.bank_in receiver.bank_out
    wire [ 1:0] full; // peek: receiver.full
    wire [ 3:0] state; // peek: exec.state

    always @(posedge clk) if (!rst) begin
        if (bus_valid) assert (owed != 2'd0);
        if (store) assert (!full[bank_in]);
        if (state != 4'd0) assert (frame);
        assert (owed == {1'b0, full[0]} + {1'b0, full[1]} && owed <= 2'd2);
        assert ((bank_in != bank_out) == (owed == 2'd1) && frame == (owed != 2'd0));
        assert (crc == sum && size == bytes && left == rest);
        assert (block != 8'd0 || (bytes == 11'd0 && rest == 8'd0));
        assert (begun == (block != 8'd0) && full_block == (block == 8'hff));
        assert (hollow == (before == 8'hff && block == 8'd1));
    end
    initial assume (rst);
endmodule
`default_nettype wire
