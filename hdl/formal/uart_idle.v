`default_nettype none
// From any content of its registers, a line that was high for eleven bits makes the receiver ready: it hears the next
// byte whole, once, and without a framing error. The proof is bounded, and complete: the byte ends within the bound.
module uart_idle (
    input wire clk
);
    localparam QUIET = 44, BYTE = 40, DELAY = 8; // clocks, at 4 a bit
    (* anyconst *) reg [7:0] sent;

    reg  [6:0] now = 7'd0;
    wire [9:0] bits = {1'b1, sent, 1'b0};
    wire [6:0] since = now - QUIET;
    wire       rx = now < QUIET || now >= QUIET + BYTE ? 1'b1 : bits[since[5:2]];
    wire       out_valid, framing, overrun;
    wire [7:0] out_data;
    reg        heard = 1'b0;

    knead_uart_rx #(.CLOCKS(16'd4)) receiver (.rst(1'b0), .out_ready(1'b1), .*);

    always @(posedge clk) begin
        if (now != 7'd127) now <= now + 7'd1;
        if (now > QUIET + 2) begin
            if (out_valid) heard <= 1'b1;
            assert (!framing && !overrun);
            if (out_valid) assert (!heard && out_data == sent);
            if (now >= QUIET + BYTE + DELAY) assert (heard);
        end
    end
endmodule
`default_nettype wire
