`default_nettype none
// The bus and the reply's buffer, for any bytes of a payload, and for any answer of the bus at any time. By induction,
// from reset: a transfer that waits stays as it is, and the reply never outgrows its buffer.
module link_bus (
    input wire        clk, frame, busy, bus_ready, bus_error,
    input wire [10:0] length,
    input wire [ 7:0] read_data,
    input wire [31:0] bus_rdata
);
    reg         rst = 1'b1;
    wire        put, send, bus_valid, bus_write;
    wire [ 9:0] read_address, put_address, send_length;
    wire [ 7:0] put_data;
    wire [23:0] bus_addr;
    wire [31:0] bus_wdata;
    knead_link_exec exec (.*);

    wire [3:0] state, n; // peek: exec.state exec.n
    wire [9:0] end_at; // peek: exec.end_at
    wire [7:0] words, count, op; // peek: exec.words exec.count exec.op
    localparam [3:0] IDLE = 4'd0, ARGS = 4'd3, CHECK = 4'd4, WORD = 4'd5, BUS = 4'd6, TEST = 4'd7, PUT = 4'd8,
                     STATUS = 4'd9, SEND = 4'd10;
    wire [9:0] words_end = 10'd3 + {words, 2'b00};
    wire       asks = state == WORD || state == BUS || state == TEST || state == PUT;

    reg         waits = 1'b0; // a transfer waited in the last clock
    reg  [56:0] transfer = 57'd0;
    always @(posedge clk) begin
        rst      <= 1'b0;
        waits    <= !rst && bus_valid && !bus_ready;
        transfer <= {bus_write, bus_addr, bus_wdata};
        if (!rst) begin
            if (waits) assert (bus_valid && transfer == {bus_write, bus_addr, bus_wdata});
            assert (state <= SEND && (state == IDLE || end_at == words_end + (state == PUT ? {6'd0, n} : 10'd0)));
            if (asks || state == ARGS || state == CHECK) assert (op == 8'd1 || op == 8'd2 || op == 8'd3);
            if (asks) assert (count != 8'd0);
            if (asks && op != 8'd2) assert ({1'b0, words} + {1'b0, count} <= 9'd255);
            if (state == PUT || state == WORD) assert (n <= 4'd3);
            if (state == PUT || state == TEST) assert (op != 8'd2);
            if (state == TEST || (asks && op == 8'd3)) assert (op == 8'd3 && count == 8'd1);
            if (state == STATUS) assert (n <= 4'd2);
            if (put) assert (put_address < 10'd3 || state == PUT);
            if (state == PUT) assert (put_address >= 10'd3 && put_address <= 10'd1022);
            if (send) assert (send_length >= 10'd3 && send_length[1:0] == 2'd3);
        end
        cover (send && words == 8'd3);
    end
    initial assume (rst);
endmodule
`default_nettype wire
