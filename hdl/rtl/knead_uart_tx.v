`default_nettype none
// Bytes to a serial line: 8 data bits, no parity, one stop bit, least significant bit first. A byte is taken when
// in_valid && in_ready. It lasts 10 * CLOCKS, and the next byte can start one clock later.
module knead_uart_tx #(
    parameter [15:0] CLOCKS = 16'd16 // per bit
) (
    input  wire       clk,
    input  wire       rst,
    input  wire       in_valid,
    input  wire [7:0] in_data,
    output wire       in_ready,
    output wire       tx
);
    localparam [15:0] BIT = CLOCKS - 16'd1;

    reg [15:0] count; // clocks of this bit
    reg [ 3:0] left;  // bits left to send
    reg [ 9:0] shift; // ones when idle

    assign in_ready = left == 4'd0;
    assign tx = shift[0];

    always @(posedge clk) begin
        count <= in_ready || count >= BIT ? 16'd0 : count + 16'd1;
        if (in_ready && in_valid) begin
            shift <= {1'b1, in_data, 1'b0};
            left  <= 4'd10;
        end else if (!in_ready && count >= BIT) begin
            shift <= {1'b1, shift[9:1]};
            left  <= left - 4'd1;
        end
        if (rst) begin
            shift <= 10'h3ff;
            left  <= 4'd0;
        end
    end
endmodule
`default_nettype wire
