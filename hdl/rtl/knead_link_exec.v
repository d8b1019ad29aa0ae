`default_nettype none
// Execute the operations of a checked payload on the word bus and write the reply. server/backend/frame.h defines the
// operations; kn_request_execute is the same in C. A byte is read every other clock.
//
//     TAG -> OP -> ARGS -> CHECK -+-> WORD -> BUS  (WRITE)  -+
//             ^                   +-> BUS -> PUT   (READ)    +-> OP ... -> STATUS -> SEND
//             |                   +-> BUS -> TEST -> PUT (WAIT)
//
// CHECK knows the whole operation, so no part of a malformed one reaches the bus. A transfer is one clock of bus_valid
// && bus_ready. Until then bus_valid, address, direction and data stay as they are. Every transfer must be answered.
module knead_link_exec (
    input  wire        clk,
    input  wire        rst,
    // the payload
    input  wire        frame,
    input  wire [10:0] length,
    output wire [ 9:0] read_address,
    input  wire [ 7:0] read_data,
    // the reply
    input  wire        busy,
    output wire        put,
    output wire [ 9:0] put_address,
    output wire [ 7:0] put_data,
    output wire        send, // the reply is complete, and the payload is no longer needed
    output wire [ 9:0] send_length,
    // the bus
    output wire        bus_valid,
    output wire        bus_write,
    output wire [23:0] bus_addr,
    output wire [31:0] bus_wdata,
    input  wire        bus_ready,
    input  wire [31:0] bus_rdata,
    input  wire        bus_error
);
    localparam [3:0] IDLE = 4'd0, TAG = 4'd1, OP = 4'd2, ARGS = 4'd3, CHECK = 4'd4, WORD = 4'd5, BUS = 4'd6,
                     TEST = 4'd7, PUT = 4'd8, STATUS = 4'd9, SEND = 4'd10;
    localparam [7:0] READ = 8'd1, WRITE = 8'd2, WAIT = 8'd3;
    localparam [1:0] OK = 2'd0, MALFORMED = 2'd1, BUS_ERROR = 2'd2, TIMEOUT = 2'd3;
    localparam [9:0] HEAD = 10'd3; // bytes of a reply before its words

    reg  [  3:0] state;
    reg  [ 10:0] at;     // address of the byte being read
    reg          fresh;  // the data of that byte is there
    reg  [  3:0] n;      // bytes of this state so far
    reg  [ 15:0] tag;
    reg  [  7:0] op;
    reg  [103:0] args;   // shifted in from the top
    reg  [ 23:0] address, polls; // polls: reads that a WAIT may still make after this one
    reg  [  7:0] count;  // words of this operation that are left
    reg  [ 31:0] word;
    reg          missed; // the WAIT has run out of polls
    reg  [  9:0] end_at; // end of the reply
    reg  [  7:0] words;  // words in the reply
    reg  [  1:0] status;

    // The arguments by operation: WAIT has address, mask, value and limit, READ and WRITE have address and count.
    wire         waits  = op == WAIT;
    wire [ 31:0] mask   = args[55:24], value = args[87:56];
    wire [ 15:0] limit  = args[103:88];
    wire [ 23:0] first  = waits ? args[23:0] : args[95:72];
    wire [  7:0] asked  = waits ? 8'd1 : args[103:96];
    wire [ 10:0] rest   = length - at; // bytes from the one being read to the end
    wire         over   = at == length;
    wire [  3:0] needed = read_data == WAIT ? 4'd13 : 4'd4; // bytes that follow this op
    wire         known  = read_data == READ || read_data == WRITE || read_data == WAIT;
    wire         whole  = known && rest > {7'd0, needed};
    wire         fits   = op == WRITE ? rest >= {1'b0, asked, 2'b00} : asked <= ~words;
    wire         last_arg = n == (waits ? 4'd12 : 4'd3);
    wire         takes  = fresh && (state == TAG || (state == OP && !over) || state == ARGS || state == WORD);

    assign read_address  = at[9:0];
    assign bus_valid     = state == BUS;
    assign bus_write     = op == WRITE;
    assign bus_addr      = address;
    assign bus_wdata     = word;
    assign put           = state == PUT || state == STATUS;
    assign put_address   = state == PUT ? end_at : {6'd0, n};
    assign put_data      = state == PUT ? word[7:0] : n == 4'd0 ? tag[7:0] : n == 4'd1 ? tag[15:8] : {6'd0, status};
    assign send          = state == SEND;
    assign send_length   = end_at;

    always @(posedge clk) begin
        fresh <= !(takes || state == IDLE);
        if (takes) at <= at + 11'd1;
        if (takes || state == PUT || state == STATUS) n <= n + 4'd1;
        case (state)
        IDLE: if (frame && !busy) begin
            state  <= TAG;
            at     <= 11'd0;
            n      <= 4'd0;
            tag    <= 16'd0;
            end_at <= HEAD;
            words  <= 8'd0;
        end
        TAG: if (over) begin
            state  <= STATUS;
            status <= MALFORMED;
            n      <= 4'd0;
        end else if (n == 4'd2) state <= OP;
        else if (fresh) begin
            if (n == 4'd0) tag[7:0] <= read_data;
            else tag[15:8] <= read_data;
        end
        OP: begin
            op <= read_data;
            n  <= 4'd0;
            if (over) begin
                state  <= STATUS;
                status <= OK;
            end else if (fresh) begin
                state  <= whole ? ARGS : STATUS;
                status <= MALFORMED;
            end
        end
        ARGS: if (fresh) begin
            args <= {read_data, args[103:8]};
            if (last_arg) state <= CHECK;
        end
        CHECK: begin
            n       <= 4'd0;
            address <= first;
            count   <= asked;
            polls   <= limit == 16'd0 ? 24'd0 : {limit, 8'd0} - 24'd1;
            state   <= asked == 8'd0 || !fits ? STATUS : op == WRITE ? WORD : BUS;
            status  <= MALFORMED;
        end
        WORD: if (fresh) begin
            word <= {read_data, word[31:8]};
            if (n == 4'd3) state <= BUS;
        end
        BUS: if (bus_ready) begin
            n <= 4'd0;
            if (op != WRITE) word <= bus_rdata;
            if (!waits) address <= address + 24'd1;
            if (op == WRITE) count <= count - 8'd1;
            state  <= bus_error ? STATUS : waits ? TEST : op == READ ? PUT : count == 8'd1 ? OP : WORD;
            status <= BUS_ERROR;
        end
        TEST: begin
            missed <= (word & mask) != value;
            polls  <= polls - 24'd1;
            state  <= (word & mask) == value || polls == 24'd0 ? PUT : BUS;
        end
        PUT: begin
            word   <= {8'd0, word[31:8]};
            end_at <= end_at + 10'd1;
            if (n == 4'd3) begin
                n      <= 4'd0;
                words  <= words + 8'd1;
                count  <= count - 8'd1;
                state  <= waits && missed ? STATUS : count == 8'd1 ? OP : BUS;
                status <= TIMEOUT;
            end
        end
        STATUS: if (n == 4'd2) state <= SEND;
        default: state <= IDLE;
        endcase
        if (rst) state <= IDLE;
    end
endmodule
`default_nettype wire
