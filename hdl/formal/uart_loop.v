`default_nettype none
// The receiver hears the bytes that the sender takes, in order, none twice, none lost, for any pauses. By induction,
// from reset on: the receiver is where the sender was four clocks ago; the line's registers are those four clocks.
module uart_loop (
    input wire       clk, in_valid,
    input wire [7:0] in_data
);
    reg  [ 1:0] resets = 2'd2; // clocks of reset that are left
    wire        rst = resets != 2'd0;
    wire        in_ready, tx, out_valid, framing, overrun;
    wire [ 7:0] out_data;

    knead_uart_tx #(.CLOCKS(16'd4)) sender (.*);
    knead_uart_rx #(.CLOCKS(16'd4)) receiver (.rx(tx), .out_ready(1'b1), .*);

    wire [ 3:0] left; // peek: sender.left
    wire [ 9:0] sender_shift; // peek: sender.shift
    wire [15:0] sender_count, count; // peek: sender.count receiver.count
    wire [ 2:0] state, bits; // peek: receiver.state receiver.bits
    wire [ 7:0] shift; // peek: receiver.shift

    // The byte being sent, and the sender's clock within it: 0..39, or 63 when idle.
    reg  [ 7:0] sent = 8'd0;
    wire [ 5:0] phase = left == 4'd0 ? 6'd63 : {4'd10 - left, sender_count[1:0]};
    reg  [23:0] phases = {24{1'b1}}; // of the last four clocks, the oldest in the upper bits
    reg  [31:0] bytes = 32'd0;
    wire [ 5:0] then = phases[23:18];
    wire [ 7:0] byte_then = bytes[31:24];
    wire [ 5:0] data_then = then - 6'd3;
    wire [19:0] line_left = {10'h3ff, 1'b1, sent, 1'b0} >> (4'd10 - left);
    reg  [ 5:0] last = 6'd63;        // one clock before
    reg  [ 7:0] byte_last = 8'd0;

    always @(posedge clk) begin
        if (rst) resets <= resets - 2'd1;
        if (in_valid && in_ready) sent <= in_data;
        phases    <= {phases[17:0], phase};
        bytes     <= {bytes[23:0], sent};
        last      <= then;
        byte_last <= byte_then;
        if (rst) begin
            phases <= {24{1'b1}};
            last   <= 6'd63;
        end else begin
            // the sender
            assert (left <= 4'd10 && sender_count < 16'd4);
            assert (left != 4'd0 || (sender_count == 16'd0 && sender_shift == 10'h3ff));
            if (left != 4'd0) assert (sender_shift == line_left[9:0]);
            // the receiver
            if (then == 6'd63 || then == 6'd0 || then == 6'd39) assert (state == 3'd0);
            else if (then <= 6'd2) assert (state == 3'd1 && count == {10'd0, then} - 16'd1);
            else if (then <= 6'd34)
                assert (state == 3'd2 && bits == data_then[4:2] && count == {14'd0, data_then[1:0]});
            else assert (state == 3'd3 && count == {10'd0, then} - 16'd35);
            if (state == 3'd0) assert (count == 16'd0);
            if (state != 3'd2) assert (bits == 3'd0 || state == 3'd3);
            if (state == 3'd2 && bits != 3'd0)
                assert (({8'd0, shift} >> (4'd8 - bits)) == ({8'd0, byte_then} & (16'd255 >> (4'd8 - bits))));
            if (state == 3'd3) assert (shift == byte_then);
            // The promise: the byte comes then, and only then.
            assert (out_valid == (last == 6'd38));
            if (out_valid) assert (out_data == byte_last);
            assert (!framing && !overrun);
        end
        cover (out_valid && out_data == 8'ha5 && phase < 6'd20);
    end
endmodule
`default_nettype wire
