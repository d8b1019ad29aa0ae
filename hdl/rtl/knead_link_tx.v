`default_nettype none
// The sending side. A reply is written into the buffer; start then sends length (1..1023) bytes of it as a frame:
//
//     SUM    reads the bytes once for their checksum, which from then on stands behind them
//     SCAN   finds the end of a block: a 0, 254 bytes, or the end
//     CODE   sends the block's length byte
//     DATA   sends the block's bytes, then SCAN again or END
//     END    sends the 0x00
//
// A byte is read every other clock. busy stays high until the 0x00 has been taken.
module knead_link_tx (
    input  wire        clk,
    input  wire        rst,
    input  wire        write,
    input  wire [ 9:0] write_address,
    input  wire [ 7:0] write_data,
    input  wire        start,
    input  wire [ 9:0] length,
    output wire        busy,
    output wire        out_valid,
    output wire [ 7:0] out_data,
    input  wire        out_ready
);
    localparam [2:0] IDLE = 3'd0, SUM = 3'd1, SCAN = 3'd2, CODE = 3'd3, DATA = 3'd4, END = 3'd5;
    localparam [7:0] FULL = 8'd254;

    reg  [ 2:0] state;
    reg  [10:0] size, base, at; // of the payload; start of the block; byte being read
    reg         fresh;          // the data of that byte is there
    reg  [ 7:0] run;            // bytes of the block: found so far, or left to send
    reg         zero;           // a 0 ends the block
    reg  [31:0] crc;

    wire [31:0] crc_next;
    wire [ 7:0] stored;
    wire [ 1:0] behind = at[1:0] - size[1:0]; // byte of the checksum
    wire [ 7:0] sum = ~(behind == 2'd0 ? crc[7:0] : behind == 2'd1 ? crc[15:8] :
                        behind == 2'd2 ? crc[23:16] : crc[31:24]);
    wire [ 7:0] now = at < size ? stored : sum;
    wire [10:0] end_at = size + 11'd4;
    wire        over = at == end_at;
    wire        sent = out_valid && out_ready;

    knead_crc32 check (.crc(crc), .data(stored), .next(crc_next));
    knead_ram #(8, 10) reply (
        .clk(clk), .i_write(write), .i_write_address(write_address), .i_data(write_data), .i_address(at[9:0]),
        .o_data(stored)
    );

    assign busy      = state != IDLE;
    assign out_valid = state == CODE || (state == DATA && fresh && run != 8'd0) || state == END;
    assign out_data  = state == CODE ? run + 8'd1 : state == DATA ? now : 8'd0;

    always @(posedge clk) begin
        fresh <= 1'b1;
        case (state)
        IDLE: if (start) begin
            state <= SUM;
            size  <= {1'b0, length};
            at    <= 11'd0;
            fresh <= 1'b0;
            crc   <= 32'hffffffff;
        end
        SUM: if (at == size) begin
            state <= SCAN;
            base  <= 11'd0;
            at    <= 11'd0;
            fresh <= 1'b0;
            run   <= 8'd0;
        end else if (fresh) begin
            crc   <= crc_next;
            at    <= at + 11'd1;
            fresh <= 1'b0;
        end
        SCAN: if (over || run == FULL || (fresh && now == 8'd0)) begin
            state <= CODE;
            zero  <= !over && run != FULL;
            at    <= base;
            fresh <= 1'b0;
        end else if (fresh) begin
            run   <= run + 8'd1;
            at    <= at + 11'd1;
            fresh <= 1'b0;
        end
        CODE: if (sent) state <= DATA;
        DATA: if (run == 8'd0) begin
            state <= zero || !over ? SCAN : END;
            base  <= at + {10'd0, zero};
            at    <= at + {10'd0, zero};
            fresh <= 1'b0;
        end else if (sent) begin
            run   <= run - 8'd1;
            at    <= at + 11'd1;
            fresh <= 1'b0;
        end
        default: if (sent) state <= IDLE;
        endcase
        if (rst) state <= IDLE;
    end
endmodule
`default_nettype wire
