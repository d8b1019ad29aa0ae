`default_nettype none
// Serial line to bytes: 8 data bits, no parity, one stop bit, least significant bit first.
//
// The line is synchronised, and each clock's level is the majority of three samples, so a glitch of one clock has no
// effect. Bits are sampled in their middle. With CLOCKS of 5 or more the sender's rate may be 3 % off, with 4 it may be
// 2.5 % off. A low stop bit is a framing error: the byte is dropped, and the line must be high before the next start
// bit. A break is therefore one framing error and no bytes. From any content of the registers, a line that stays high
// leads to idle within ten bits.
//
// A byte stays at out_data from out_valid until out_ready. A byte that ends in the meantime is lost (overrun).
module knead_uart_rx #(
    parameter [15:0] CLOCKS = 16'd16 // per bit, 4 at least
) (
    input  wire       clk,
    input  wire       rst,
    input  wire       rx,
    output reg        out_valid,
    output reg  [7:0] out_data,
    input  wire       out_ready,
    output reg        framing, // high for one clock, as overrun
    output reg        overrun
);
    localparam [2:0] IDLE = 3'd0, START = 3'd1, DATA = 3'd2, STOP = 3'd3, BREAK = 3'd4;
    localparam [15:0] HALF = (CLOCKS >> 1) - 16'd1, BIT = CLOCKS - 16'd1;

    reg  [ 4:0] line;  // bits 0 and 1 synchronise, 2 to 4 vote
    reg  [ 2:0] state;
    reg  [15:0] count; // clocks of this bit; in the start bit, up to its middle
    reg  [ 2:0] bits;
    reg  [ 7:0] shift;

    wire level = (line[2] & line[3]) | (line[2] & line[4]) | (line[3] & line[4]);
    wire strobe = count >= (state == START ? HALF : BIT);
    wire done = state == STOP && strobe;
    wire taken = !out_valid || out_ready;

    always @(posedge clk) begin
        line  <= {line[3:0], rx};
        count <= strobe || state == IDLE ? 16'd0 : count + 16'd1;
        case (state)
        IDLE:  if (!level) state <= START;
        START: if (strobe) state <= level ? IDLE : DATA;
        DATA:  if (strobe && bits == 3'd7) state <= STOP;
        STOP:  if (strobe) state <= level ? IDLE : BREAK;
        default: if (level) state <= IDLE;
        endcase
        if (state != DATA) bits <= 3'd0;
        else if (strobe) bits <= bits + 3'd1;
        if (state == DATA && strobe) shift <= {level, shift[7:1]};
        if (rst) begin
            line  <= 5'b11111;
            state <= IDLE;
        end
    end

    always @(posedge clk) begin
        if (done && level && taken) out_data <= shift;
        out_valid <= !rst && ((done && level) || !taken);
        overrun   <= !rst && done && level && !taken;
        framing   <= !rst && done && !level;
    end
endmodule
`default_nettype wire
