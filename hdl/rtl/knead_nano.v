`default_nettype none
// The lattice as a small circuit: knead_engine's words, registers, formats and bits, by one operation after another of
// a program (hdl/nano.c) instead of an edge per clock. One adder, one multiplier of 27 x 7 bits, one shifter, two
// memories of 36 bits; no multiplier block.
//
//     program --> fetch: address --> nodes  32 words each --+
//       ^                            edges   8 words each --+--> m --> a, b: sum, product, shift, limit --> store
//       |                            seeds, table, omega  --+                  |
//       +---- next, loop, call <------------------------------ flags, residual, ends of the edge
//
// The boundary list, its reactions and the temporaries are in words that nodes leave, so LOG_LIST <= 4 and LOG_NODES
// is 5 to 8. A node's 36-bit sum holds 2^9 edges: LOG_EDGES <= 9.
`include "knead_formats.vh"
`include "knead_nano.vh"
module knead_nano #(
    parameter LOG_NODES = 5,
    parameter LOG_EDGES = 7,
    parameter LOG_LIST = 4
) (
    input  wire        clk,
    input  wire        rst,
    input  wire        bus_valid,
    input  wire        bus_write,
    input  wire [23:0] bus_addr,
    input  wire [31:0] bus_wdata,
    output wire        bus_ready,
    output wire [31:0] bus_rdata,
    output wire        bus_error
);
    localparam ITEM = (LOG_EDGES > LOG_NODES ? LOG_EDGES : LOG_NODES) + 1;
    localparam [4:0] SPARE = 5'd11, RESULT = 5'd15; // of a node, both: temporaries and reactions

    wire tick, rest, crc;
    reg ticked;
    wire [6:0] flags;
    wire [`KN_ACC-1:0] residual;
    wire [31:0] state_crc, crc_now;
    reg [31:0] window;
    wire act;
    reg busy;
    wire [16:0] node_count;
    wire [20:0] edge_count;
    wire [10:0] bound_count;
    wire [3:0] passes;
    wire [5:0] iterations, kv_shift, beta_shift;
    wire [4:0] d_shift;
    wire [6:0] octave;
    wire [`KN_BETA-1:0] beta;
    wire [`KN_RELAX-1:0] relax;
    knead_registers #(LOG_NODES, LOG_EDGES, LOG_LIST) registers (
        .clk(clk), .rst(rst), .i_bus_valid(bus_valid), .i_bus_write(bus_write), .i_bus_addr(bus_addr),
        .i_bus_wdata(bus_wdata), .o_bus_ready(bus_ready), .o_bus_rdata(bus_rdata), .o_bus_error(bus_error),
        .i_window_data(window), .o_act(act), .i_busy(busy), .o_tick(tick), .o_rest(rest), .o_crc(crc),
        .i_ticked(ticked), .i_flags(flags), .i_residual(residual), .i_state_crc(state_crc), .o_node_count(node_count),
        .o_edge_count(edge_count), .o_passes(passes), .o_iterations(iterations), .o_d_shift(d_shift),
        .o_kv_shift(kv_shift), .o_octave(octave), .o_beta(beta), .o_beta_shift(beta_shift), .o_relax(relax),
        .o_bound_count(bound_count));

    // --- the program ----------------------------------------------------------------------------------------------

    reg [8:0] pc, back;
    reg executing; // the operand is there
    reg crc_next; // asked for together with rest
    reg [ITEM-1:0] item;
    reg [5:0] iteration;
    reg [3:0] pass;
    wire [23:0] word;
    wire [4:0] op = word[23:19];
    wire [3:0] from = word[18:15];
    wire [4:0] field = word[14:10];
    wire [5:0] immediate = word[9:4];
    wire is_unsigned = word[3], is_pred = word[2], is_first = word[1];
    wire [8:0] target = word[12:4];
    wire done;

    wire [ITEM-1:0] after = item + {{(ITEM-1){1'b0}}, 1'b1};
    reg [ITEM-1:0] items;
    always @* begin
        case (from[1:0])
            2'd0: items = node_count[ITEM-1:0];
            2'd1: items = edge_count[ITEM-1:0];
            default: items = bound_count[ITEM-1:0];
        endcase
    end
    wire of_items = from < 4'd3;
    wire [5:0] iteration_after = iteration + 6'd1;
    wire [3:0] pass_after = pass + 4'd1;
    wire again = of_items ? after != items : from == 4'd3 ? iteration_after != iterations : pass_after != passes;
    wire leaps = op == `KN_OP_CALL || op == `KN_OP_RETURN || op == `KN_OP_LOOP && again
              || op == `KN_OP_EMPTY && items == {ITEM{1'b0}};
    wire ends = op == `KN_OP_END && done;
    wire ends_rest = from == 4'd1;
    wire [8:0] onward = ends ? `KN_AT_CRC : op == `KN_OP_RETURN ? back : leaps ? target : pc + 9'd1;
    wire [8:0] start = tick ? `KN_AT_TICK : rest ? `KN_AT_REST : `KN_AT_CRC;
    wire [8:0] next = !busy ? start : done ? onward : pc;
    knead_nano_program program_ (.clk(clk), .i_address(next), .o_word(word));

    initial busy = 1'b0;
    always @(posedge clk) begin
        pc <= next;
        executing <= busy && !done;
        ticked <= ends && from == 4'd0 && !rst;
        if (!busy) crc_next <= crc && rest;
        if (rst) busy <= 1'b0;
        else if (!busy) busy <= tick || rest || crc;
        else if (ends && !(ends_rest && crc_next)) busy <= 1'b0;
        if (done && op == `KN_OP_CALL) back <= pc + 9'd1;
        if (!busy) begin
            item <= {ITEM{1'b0}};
            iteration <= 6'd0;
            pass <= 4'd0;
        end else if (done && op == `KN_OP_LOOP) begin
            if (of_items) item <= again ? after : {ITEM{1'b0}};
            if (from == 4'd3) iteration <= again ? iteration_after : 6'd0;
            if (from == 4'd4) pass <= again ? pass_after : 4'd0;
        end
    end

    // --- memories -------------------------------------------------------------------------------------------------

    wire to_edge = bus_addr[23], to_rest = bus_addr[21], to_node = bus_addr[20];
    wire to_list = bus_addr[17:16] == 2'd2, to_result = bus_addr[17:16] == 2'd3;
    wire to_constants = !(to_edge || to_rest || to_node || bus_addr[17]);
    wire [15:0] ends_of;
    wire [7:0] listed;
    wire [9:0] place;
    wire [8:0] seed;
    wire [35:0] stored;
    wire write;

    // where: a field of a node, of the item's, of an edge's ends, ...
    // a reaction's place, by 3: the first 32 in RESULT, 16 more behind the temporaries
    wire [5:0] record = {2'd0, item[3:0]};
    wire [5:0] result = busy ? {record[4:0], 1'b0} + record + {1'b0, field} : bus_addr[6:1];
    wire [4:0] result_node = result[5] ? {1'b1, result[3:0]} : result[4:0];
    reg [LOG_NODES-1:0] node;
    reg [4:0] node_field;
    wire [3:0] w = bus_addr[3:0];
    always @* begin
        node = item[LOG_NODES-1:0];
        node_field = is_first && iteration == 6'd0 ? field ^ 5'd8 : field; // u is eight fields before last
        case (from)
            `KN_FROM_I: node = ends_of[LOG_NODES-1:0];
            `KN_FROM_J: node = ends_of[8 +: LOG_NODES];
            `KN_FROM_LISTED: node = listed[LOG_NODES-1:0];
            `KN_FROM_TEMP: begin node = {{(LOG_NODES-5){1'b0}}, field}; node_field = SPARE; end
            `KN_FROM_RESULT: begin
                node = {{(LOG_NODES-5){1'b0}}, result_node};
                node_field = result[5] ? SPARE : RESULT;
            end
            default: ;
        endcase
        if (!busy) begin
            node = bus_addr[4 +: LOG_NODES];
            node_field = w < 4'd6 ? {3'd0, w[2:1]} : w == 4'd6 ? 5'd3 : w < 4'd10 ? {1'b0, w - 4'd3} : {1'b0, w - 4'd2};
            if (to_rest) begin
                node = bus_addr[3 +: LOG_NODES];
                node_field = 5'd19 + {3'd0, w[2:1]};
            end else if (!to_node) begin
                node = to_list ? bus_addr[2 +: LOG_NODES] : {{(LOG_NODES-5){1'b0}}, result_node};
                node_field = to_list ? {3'b111, w[1:0]} : result[5] ? SPARE : RESULT;
            end
        end
    end
    wire [2:0] edge_word = w[2:0];
    wire [2:0] edge_field = busy ? field[2:0] : edge_word == 3'd1 ? 3'd1 : edge_word >= 3'd3 ? 3'd2 : 3'd0;
    wire [LOG_EDGES-1:0] edge_ = busy ? item[LOG_EDGES-1:0] : bus_addr[3 +: LOG_EDGES];
    wire in_edge = busy ? from == `KN_FROM_EDGE : to_edge;
    wire in_constants = busy ? from >= `KN_FROM_SEED : to_constants;

    reg [35:0] word_new;
    wire [35:0] node_read, edge_read;
    wire [17:0] constant;
    wire here = to_rest ? w[2:1] != 2'd3 : !to_edge || edge_word < 3'd5;
    wire kept = here && (!to_node || w < 4'd13);
    wire written = busy ? write : act && kept;
    knead_ram #(36, LOG_NODES+5) ram_nodes (
        .clk(clk), .i_write(written && !in_edge && !in_constants), .i_write_address({node, node_field}),
        .i_data(busy ? stored : word_new), .i_address({node, node_field}), .o_data(node_read));
    knead_ram #(36, LOG_EDGES+3) ram_edges (
        .clk(clk), .i_write(written && in_edge), .i_write_address({edge_, edge_field}),
        .i_data(busy ? stored : word_new), .i_address({edge_, edge_field}), .o_data(edge_read));
    wire to_table = bus_addr[16];
    wire [9:0] entry = busy ? place : bus_addr[9:0];
    wire [9:0] table_at = entry[9] ? 10'd64 : {1'b1, entry[8:0]};
    wire [9:0] omega_at = {5'd1, busy ? iteration[4:0] : bus_addr[4:0]};
    wire of_table = busy ? from == `KN_FROM_HERE || from == `KN_FROM_NEXT : to_table;
    wire [9:0] constant_at = of_table ? table_at : busy && from == `KN_FROM_SEED ? {1'b0, seed} : omega_at;
    knead_nano_constants constants (
        .clk(clk), .i_write(act && in_constants), .i_address(constant_at), .i_data(bus_wdata[17:0]),
        .o_data(constant));

    knead_nano_alu alu (
        .clk(clk), .i_execute(executing), .i_op(op), .i_from(from), .i_immediate(immediate),
        .i_unsigned(is_unsigned), .i_pred(is_pred),
        .i_word(in_constants ? {18'd0, constant} : in_edge ? edge_read : node_read),
        .i_setting(from == `KN_FROM_BETA ? {2'd0, beta} : {2'd0, relax}), .i_kv_shift(kv_shift),
        .i_beta_shift(beta_shift), .i_d_shift(d_shift), .i_octave(octave), .i_clear(tick), .o_done(done),
        .o_stored(stored), .o_write(write), .o_seed(seed), .o_place(place), .o_flags(flags), .o_residual(residual),
        .o_ends(ends_of), .o_node(listed), .o_crc(crc_now), .i_crc_clear(!busy && (rest || crc)));
    reg [31:0] crc_kept;
    assign state_crc = crc_kept;
    always @(posedge clk) if (ends && from == 4'd2) crc_kept <= ~crc_now;

    // --- windows: a word of what was read, and what was read with that word replaced ---------------------------------

    wire [35:0] read = to_edge ? edge_read : node_read;
    wire high = to_edge ? edge_word == 3'd4 : (to_rest || w < 4'd6 || to_result) && w[0] && !to_list;
    wire halves = to_edge ? edge_word >= 3'd3 : to_rest || to_node && w < 4'd6;
    wire [15-LOG_NODES:0] none = {(16-LOG_NODES){1'b0}};
    wire [31:0] ends_word = {none, read[27 +: LOG_NODES], none, read[19 +: LOG_NODES]};
    always @* begin
        word_new = {{4{bus_wdata[31]}}, bus_wdata}; // of the list
        if (to_node && w >= 4'd7) word_new = {{11{bus_wdata[24]}}, bus_wdata[24:0]};
        if (to_node && w == 4'd6) word_new = {33'd0, bus_wdata[2:0]};
        if (halves) word_new = high ? {bus_wdata[3:0], read[31:0]} : {read[35:32], bus_wdata};
        if (to_edge) case (edge_word)
            3'd0: word_new = {1'b0, bus_wdata[23:16], bus_wdata[7:0], read[18:0]};
            3'd1: word_new = {19'd0, bus_wdata[16:0]};
            3'd2: word_new = {read[35:19], 2'd0, bus_wdata[16:0]};
            default: ;
        endcase
        window = high ? {{28{read[35]}}, read[35:32]} : read[31:0];
        if (to_edge && edge_word == 3'd0) window = ends_word;
        if (to_edge && edge_word == 3'd2) window = {15'd0, read[16:0]};
        if (!kept) window = 32'd0;
        if (to_constants) window = {14'd0, constant};
    end
    wire unused = &{node_count, edge_count, bound_count, result[4], bus_addr, listed, ends_of, item, word[0]};
endmodule
`default_nettype wire
