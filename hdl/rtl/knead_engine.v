`default_nettype none
// The lattice as a circuit: core/fixed.c bit for bit, an edge or a node per clock. The host's side is a bus of 32-bit
// words (hdl/registers.h). A transfer takes place in the clock in which valid and ready are both high. hdl/README.md
// draws the pipes and memories.
`include "knead_formats.vh"
`include "knead_phases.vh"
module knead_engine #(
    parameter LOG_NODES = 10,
    parameter LOG_EDGES = 13,
    parameter LOG_LIST = 6
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
    // width of a sum: as many edges as there may be never wrap it
    localparam ACC = LOG_EDGES + `KN_T + 1 > `KN_ACC ? LOG_EDGES + `KN_T + 1 : `KN_ACC;
    localparam F = `KN_T + 1; // width of an edge's force component
    localparam RECORD = 2*LOG_NODES + `KN_KV + `KN_IA; // ia, kv, j, i
    localparam LINE = 3*`KN_E + `KN_KV + `KN_T; // e, g, t0
    localparam X = 3*`KN_X;
    localparam U = 3*`KN_U;
    localparam T = 3*`KN_T;

    // --- control -----------------------------------------------------------------------------------------------------

    wire tick, rest, crc, crc_done, ticked, issue;
    wire [3:0] phase, step;
    wire [20:0] index;
    wire [4:0] iteration;
    wire [16:0] node_count;
    wire [20:0] edge_count;
    wire [10:0] bound_count;
    wire [3:0] passes;
    wire [5:0] iterations, kv_shift, beta_shift;
    wire [4:0] d_shift;
    wire [6:0] octave;
    wire [`KN_BETA-1:0] beta;
    wire [`KN_RELAX-1:0] relax;
    wire [`KN_OMEGA-1:0] omega;
    wire [`KN_ACC-1:0] residual;
    wire [31:0] state_crc;
    wire [6:0] flags;
    reg [31:0] window_data;
    wire act;
    wire idle = phase == `KN_PHASE_IDLE;

    knead_registers #(LOG_NODES, LOG_EDGES, LOG_LIST) registers (
        .clk(clk), .rst(rst), .i_bus_valid(bus_valid), .i_bus_write(bus_write), .i_bus_addr(bus_addr),
        .i_bus_wdata(bus_wdata), .o_bus_ready(bus_ready), .o_bus_rdata(bus_rdata), .o_bus_error(bus_error),
        .i_window_data(window_data), .o_act(act), .i_busy(!idle), .o_tick(tick), .o_rest(rest), .o_crc(crc),
        .i_ticked(ticked), .i_flags(flags), .i_residual(residual), .i_state_crc(state_crc), .o_node_count(node_count),
        .o_edge_count(edge_count), .o_passes(passes), .o_iterations(iterations), .o_d_shift(d_shift),
        .o_kv_shift(kv_shift), .o_octave(octave), .o_beta(beta), .o_beta_shift(beta_shift), .o_relax(relax),
        .o_bound_count(bound_count));

    knead_sequencer sequencer (
        .clk(clk), .rst(rst), .i_tick(tick), .i_rest(rest), .i_crc(crc), .i_crc_done(crc_done),
        .i_node_count(node_count), .i_edge_count(edge_count), .i_bound_count(bound_count), .i_passes(passes),
        .i_iterations(iterations), .o_phase(phase), .o_issue(issue), .o_index(index), .o_step(step),
        .o_iteration(iteration), .o_ticked(ticked));

    // Groups of phases that share a path.
    wire in_setup = phase == `KN_PHASE_SETUP;
    wire in_commit = phase == `KN_PHASE_EDGE_COMMIT;
    wire of_edges = in_setup || in_commit || phase == `KN_PHASE_EDGE;
    wire in_crc = phase == `KN_PHASE_CRC;
    wire of_list = phase == `KN_PHASE_BOUND || phase == `KN_PHASE_REACTION;
    wire in_rest_nodes = phase == `KN_PHASE_REST_NODES;

    // --- addresses: of the bus while idle, of the running phase otherwise --------------------------------------------

    wire [LOG_NODES-1:0] index_node = index[LOG_NODES-1:0];
    wire [LOG_EDGES-1:0] index_edge = index[LOG_EDGES-1:0];
    wire unused = &index[20:LOG_EDGES];
    wire [LOG_NODES-1:0] crc_node, list_node;
    wire [LOG_EDGES-1:0] crc_edge;
    wire to_rest = bus_addr[21];
    wire [LOG_NODES-1:0] bus_node = to_rest ? bus_addr[3 +: LOG_NODES] : bus_addr[4 +: LOG_NODES];
    wire [3:0] bus_word = bus_addr[23] || to_rest ? {1'b0, bus_addr[2:0]} : bus_addr[3:0];
    wire [LOG_NODES-1:0] node = idle ? bus_node : in_crc ? crc_node : of_list ? list_node : index_node;
    wire [LOG_EDGES-1:0] edge_ = idle ? bus_addr[3 +: LOG_EDGES] : in_crc ? crc_edge : index_edge;

    // The window that a bus write goes to, for the one clock in which the word is written.
    wire act_node = act && bus_addr[23:20] == 4'h1;
    wire act_rest = act && bus_addr[23:20] == 4'h2;
    wire act_edge = act && bus_addr[23];
    wire act_table = act && bus_addr[23:16] == 8'h01;
    wire act_list = act && bus_addr[23:16] == 8'h02;
    wire act_omega = act && bus_addr[23:16] == 8'h00;

    // Issued items and their addresses, clocks later. A phase may drain in fewer clocks than the next phase's pipe is
    // long, so each pipe has delays of its own.
    wire issue_setup = issue & in_setup;
    wire issue_edge = issue & of_edges & ~in_setup;
    wire issue_node = issue & ~of_edges;
    wire setup_2, setup_34, setup_40, edge_pipe_2, edge_pipe_11, edge_pipe_13, issue_1, issue_3, issue_11, issue_14;
    wire [LOG_NODES-1:0] node_1, node_3, node_11, node_14;
    wire [LOG_EDGES-1:0] edge_13, edge_34;
    wire [1:0] component_1, component_14;
    knead_delay #(1, 2) delay_setup_2 (.clk(clk), .i_value(issue_setup), .o_value(setup_2));
    knead_delay #(1, 32) delay_setup_34 (.clk(clk), .i_value(setup_2), .o_value(setup_34));
    knead_delay #(1, 6) delay_setup_40 (.clk(clk), .i_value(setup_34), .o_value(setup_40));
    knead_delay #(1, 2) delay_edge_2 (.clk(clk), .i_value(issue_edge), .o_value(edge_pipe_2));
    knead_delay #(1, 9) delay_edge_11 (.clk(clk), .i_value(edge_pipe_2), .o_value(edge_pipe_11));
    knead_delay #(1, 2) delay_edge_pipe_13 (.clk(clk), .i_value(edge_pipe_11), .o_value(edge_pipe_13));
    knead_delay #(1, 1) delay_issue_1 (.clk(clk), .i_value(issue_node), .o_value(issue_1));
    knead_delay #(1, 2) delay_issue_3 (.clk(clk), .i_value(issue_1), .o_value(issue_3));
    knead_delay #(1, 8) delay_issue_11 (.clk(clk), .i_value(issue_3), .o_value(issue_11));
    knead_delay #(1, 3) delay_issue_14 (.clk(clk), .i_value(issue_11), .o_value(issue_14));
    knead_delay #(LOG_NODES, 1) delay_node_1 (.clk(clk), .i_value(index_node), .o_value(node_1));
    knead_delay #(LOG_NODES, 2) delay_node_3 (.clk(clk), .i_value(node_1), .o_value(node_3));
    knead_delay #(LOG_NODES, 8) delay_node_11 (.clk(clk), .i_value(node_3), .o_value(node_11));
    knead_delay #(LOG_NODES, 3) delay_node_14 (.clk(clk), .i_value(node_11), .o_value(node_14));
    knead_delay #(LOG_EDGES, 13) delay_edge_13 (.clk(clk), .i_value(index_edge), .o_value(edge_13));
    knead_delay #(LOG_EDGES, 21) delay_edge_34 (.clk(clk), .i_value(edge_13), .o_value(edge_34));
    knead_delay #(2, 1) delay_component_1 (.clk(clk), .i_value(step[1:0]), .o_value(component_1));
    knead_delay #(2, 13) delay_component_14 (.clk(clk), .i_value(component_1), .o_value(component_14));

    // --- memories -------------------------------------------------------------------------------------------------

    wire [RECORD-1:0] record, record_new;
    wire [`KN_H-1:0] h, h_new;
    wire [LINE-1:0] line, line_new;
    wire [X-1:0] x, x_j, x_rest, x_word, x_moved;
    wire [U-1:0] u, u_j, u_word, u_bound, u_moved, last, last_moved;
    wire [T-1:0] load, load_image, load_word, load_bound;
    wire [2:0] held, held_image, held_word, held_bound;
    wire bound_write;
    wire signed [`KN_H-1:0] h_flown;

    // The record of an edge addresses the node memories in the clock in which it is read.
    wire [LOG_NODES-1:0] record_i = record[LOG_NODES-1:0];
    wire [LOG_NODES-1:0] record_j = record[2*LOG_NODES-1:LOG_NODES];
    wire [LOG_NODES-1:0] node_i = of_edges ? record_i : node;

    knead_ram #(RECORD, LOG_EDGES) ram_record (
        .clk(clk), .i_write(act_edge), .i_write_address(edge_), .i_data(record_new), .i_address(edge_),
        .o_data(record));
    wire rest_edge = phase == `KN_PHASE_REST_EDGES && issue;
    knead_ram #(`KN_H, LOG_EDGES) ram_h (
        .clk(clk), .i_write(act_edge | rest_edge | in_commit & edge_pipe_13),
        .i_write_address(in_commit ? edge_13 : edge_),
        .i_data(act_edge ? h_new : rest_edge ? {`KN_H{1'b0}} : h_flown), .i_address(edge_), .o_data(h));
    knead_ram #(LINE, LOG_EDGES) ram_line (
        .clk(clk), .i_write(setup_34), .i_write_address(edge_34), .i_data(line_new),
        .i_address(edge_), .o_data(line));

    // x and u are stored twice, so that both ends of an edge are read in one clock. The bus, rest and COMMIT write x.
    wire rest_node = in_rest_nodes & issue_1;
    wire commit_node = phase == `KN_PHASE_NODE_COMMIT & issue_3;
    wire x_write = act_node | rest_node | commit_node;
    wire [LOG_NODES-1:0] x_address = act_node ? node : rest_node ? node_1 : node_3;
    wire [X-1:0] x_new = act_node ? x_word : rest_node ? x_rest : x_moved;
    knead_ram #(X, LOG_NODES) ram_x (
        .clk(clk), .i_write(x_write), .i_write_address(x_address), .i_data(x_new), .i_address(node_i),
        .o_data(x));
    knead_ram #(X, LOG_NODES) ram_x_j (
        .clk(clk), .i_write(x_write), .i_write_address(x_address), .i_data(x_new), .i_address(record_j),
        .o_data(x_j));
    // The bus, rest, the boundary list and NODE write u.
    wire iterate_node = phase == `KN_PHASE_NODE & issue_11;
    wire u_write = act_node | rest_node | bound_write | iterate_node;
    wire [LOG_NODES-1:0] u_address = act_node | bound_write ? node : rest_node ? node_1 : node_11;
    wire [U-1:0] u_new = act_node ? u_word : rest_node ? {U{1'b0}} : bound_write ? u_bound : u_moved;
    knead_ram #(U, LOG_NODES) ram_u (
        .clk(clk), .i_write(u_write), .i_write_address(u_address), .i_data(u_new), .i_address(node_i),
        .o_data(u));
    knead_ram #(U, LOG_NODES) ram_u_j (
        .clk(clk), .i_write(u_write), .i_write_address(u_address), .i_data(u_new), .i_address(record_j),
        .o_data(u_j));
    knead_ram #(U, LOG_NODES) ram_last (
        .clk(clk), .i_write(iterate_node), .i_write_address(node_11), .i_data(last_moved), .i_address(node),
        .o_data(last));

    // The rest position and the image of load and held that the host wrote. BEGIN copies the image for the tick, and
    // the boundary list overwrites the copy.
    knead_ram #(X, LOG_NODES) ram_rest (
        .clk(clk), .i_write(act_rest), .i_write_address(node), .i_data(x_word), .i_address(node),
        .o_data(x_rest));
    knead_ram #(T+3, LOG_NODES) ram_image (
        .clk(clk), .i_write(act_node), .i_write_address(node), .i_data({held_word, load_word}),
        .i_address(node), .o_data({held_image, load_image}));
    wire begin_node = phase == `KN_PHASE_BEGIN & issue_1;
    knead_ram #(T+3, LOG_NODES) ram_tick (
        .clk(clk), .i_write(begin_node | bound_write), .i_write_address(bound_write ? node : node_1),
        .i_data(bound_write ? {held_bound, load_bound} : {held_image, load_image}), .i_address(node),
        .o_data({held, load}));

    // The table is stored twice, so that both ends of a segment are read in one clock.
    wire [9:0] table_address;
    wire [`KN_R-1:0] table_here, table_next;
    wire [9:0] table_read = idle ? bus_addr[9:0] : table_address;
    knead_ram #(`KN_R, 10) ram_table (
        .clk(clk), .i_write(act_table), .i_write_address(bus_addr[9:0]), .i_data(bus_wdata[`KN_R-1:0]),
        .i_address(table_read), .o_data(table_here));
    knead_ram #(`KN_R, 10) ram_table_next (
        .clk(clk), .i_write(act_table), .i_write_address(bus_addr[9:0]), .i_data(bus_wdata[`KN_R-1:0]),
        .i_address(table_read == 10'd`KN_SEGMENTS ? table_read : table_read + 10'd1), .o_data(table_next));

    knead_ram #(`KN_OMEGA, 5) ram_omega (
        .clk(clk), .i_write(act_omega), .i_write_address(bus_addr[4:0]), .i_data(bus_wdata[`KN_OMEGA-1:0]),
        .i_address(idle ? bus_addr[4:0] : iteration), .o_data(omega));

    // The boundary list of the host, and the reactions for it.
    wire [LOG_LIST+1:0] list_address;
    wire [31:0] list_word, result, result_word;
    wire result_write;
    wire [LOG_LIST+2:0] result_address;
    knead_ram #(32, LOG_LIST+2) ram_list (
        .clk(clk), .i_write(act_list), .i_write_address(bus_addr[LOG_LIST+1:0]), .i_data(bus_wdata),
        .i_address(idle ? bus_addr[LOG_LIST+1:0] : list_address), .o_data(list_word));
    knead_ram #(32, LOG_LIST+3) ram_result (
        .clk(clk), .i_write(result_write), .i_write_address(result_address), .i_data(result),
        .i_address(bus_addr[LOG_LIST+2:0]), .o_data(result_word));

    // --- windows: a memory's record as words of the bus --------------------------------------------------------------

    wire [31:0] node_word, edge_word;
    knead_windows #(LOG_NODES) windows (
        .i_word(bus_word), .i_data(bus_wdata), .i_rest(to_rest), .i_x(x), .i_x_rest(x_rest), .i_u(u),
        .i_load(load_image), .i_held(held_image), .i_edge(record), .i_h(h), .o_x(x_word), .o_u(u_word),
        .o_load(load_word), .o_held(held_word), .o_edge(record_new), .o_h(h_new), .o_node_word(node_word),
        .o_edge_word(edge_word));
    always @* begin
        casez (bus_addr[23:16])
            8'h00: window_data = {{(32-`KN_OMEGA){1'b0}}, omega};
            8'h01: window_data = {{(32-`KN_R){1'b0}}, table_here};
            8'h02: window_data = list_word;
            8'h03: window_data = result_word;
            8'h1?: window_data = node_word;
            8'h2?: window_data = bus_word >= 4'd6 ? 32'd0 : node_word;
            default: window_data = edge_word;
        endcase
    end

    // --- edges: the record is read 1 clock after issue, the data of its nodes 2 clocks after -------------------------

    wire [`KN_KV-1:0] kv_2;
    wire [`KN_IA-1:0] ia_2;
    wire [`KN_H-1:0] h_2;
    wire [LINE-1:0] line_2;
    wire [LOG_NODES-1:0] i_11, j_11, i_40, j_40;
    knead_delay #(`KN_KV+`KN_IA, 1) delay_record (
        .clk(clk), .i_value(record[RECORD-1:2*LOG_NODES]), .o_value({ia_2, kv_2}));
    knead_delay #(`KN_H, 1) delay_h (.clk(clk), .i_value(h), .o_value(h_2));
    knead_delay #(LINE, 1) delay_line (.clk(clk), .i_value(line), .o_value(line_2));
    knead_delay #(2*LOG_NODES, 10) delay_ends_11 (
        .clk(clk), .i_value({record_j, record_i}), .o_value({j_11, i_11}));
    knead_delay #(2*LOG_NODES, 29) delay_ends_40 (.clk(clk), .i_value({j_11, i_11}), .o_value({j_40, i_40}));

    // One 1/sqrt serves SETUP and INVERT, which never run together.
    wire [35:0] q_setup, q_invert;
    wire [17:0] r;
    wire [4:0] half;
    knead_rsqrt rsqrt (.clk(clk), .i_q(in_setup ? q_setup : q_invert), .o_r(r), .o_half(half));

    wire [3*F-1:0] share, pull;
    wire setup_sat_u, setup_sat_tension, setup_sat_direction;
    knead_setup setup (
        .clk(clk), .i_valid(setup_2), .i_d_shift(d_shift), .i_kv_shift(kv_shift),
        .i_octave(octave), .i_x_i(x), .i_x_j(x_j), .i_u_i(u), .i_u_j(u_j), .i_kv(kv_2), .i_ia(ia_2), .i_h(h_2),
        .o_q(q_setup), .i_r(r), .i_half(half), .o_table_address(table_address), .i_table_here(table_here),
        .i_table_next(table_next), .o_e(line_new[LINE-1 -: 3*`KN_E]), .o_g(line_new[`KN_T +: `KN_KV]),
        .o_t0(line_new[`KN_T-1:0]), .o_share(share), .o_sat_u(setup_sat_u), .o_sat_tension(setup_sat_tension),
        .o_sat_direction(setup_sat_direction));

    wire edge_sat_u, edge_sat_tension, edge_sat_spring;
    knead_edge edge_pipe (
        .clk(clk), .i_valid(edge_pipe_2), .i_commit(in_commit),
        .i_kv_shift(kv_shift), .i_beta(beta), .i_beta_shift(beta_shift), .i_u_i(u), .i_u_j(u_j),
        .i_e(line_2[LINE-1 -: 3*`KN_E]), .i_g(line_2[`KN_T +: `KN_KV]), .i_t0(line_2[`KN_T-1:0]), .i_h(h_2),
        .o_force(pull), .o_h(h_flown), .o_sat_u(edge_sat_u), .o_sat_tension(edge_sat_tension),
        .o_sat_spring(edge_sat_spring));

    // --- sums: force at i and minus force at j, or the share of D at both --------------------------------------------

    wire add_share = setup_40;
    wire add_force = edge_pipe_11;
    // BEGIN clears the sums. NODE takes the forces, INVERT takes D with the last of its three components.
    wire take = issue && (phase == `KN_PHASE_BEGIN || phase == `KN_PHASE_NODE
                          || phase == `KN_PHASE_INVERT && step[1:0] == 2'd2);
    wire [3*F-1:0] minus = {-pull[2*F +: F], -pull[F +: F], -pull[0 +: F]};
    wire [3*ACC-1:0] sum_i, sum_j;
    knead_accumulator #(ACC, F, LOG_NODES) accumulator_i (
        .clk(clk), .i_add(add_share | add_force), .i_take(take),
        .i_address(add_share ? i_40 : add_force ? i_11 : node), .i_value(add_share ? share : pull), .o_sum(sum_i));
    knead_accumulator #(ACC, F, LOG_NODES) accumulator_j (
        .clk(clk), .i_add(add_share | add_force), .i_take(take),
        .i_address(add_share ? j_40 : add_force ? j_11 : node), .i_value(add_share ? share : minus), .o_sum(sum_j));

    // --- nodes: the memories' data is there 1 clock after issue ------------------------------------------------------

    // D of one component a clock goes to INVERT, which gives relax/D back 13 clocks later.
    wire [35:0] d_i, d_j;
    assign d_i = component_1 == 2'd0 ? sum_i[0 +: 36] : component_1 == 2'd1 ? sum_i[ACC +: 36] : sum_i[2*ACC +: 36];
    assign d_j = component_1 == 2'd0 ? sum_j[0 +: 36] : component_1 == 2'd1 ? sum_j[ACC +: 36] : sum_j[2*ACC +: 36];
    wire [`KN_INV-1:0] inverse_14;
    wire [5:0] shift_14;
    knead_invert invert (
        .clk(clk), .i_kv_shift(kv_shift), .i_relax(relax), .i_d(d_i + d_j), .o_q(q_invert), .i_r(r),
        .i_half(half), .o_inverse(inverse_14), .o_shift(shift_14));

    wire [3*`KN_INV-1:0] inverse;
    wire [17:0] shift;
    genvar k;
    generate
        for (k = 0; k < 3; k = k + 1) begin : g_inverse
            knead_ram #(`KN_INV+6, LOG_NODES) ram_inverse (
                .clk(clk), .i_write(phase == `KN_PHASE_INVERT && issue_14 && component_14 == k[1:0]),
                .i_write_address(node_14), .i_data({shift_14, inverse_14}), .i_address(node),
                .o_data({shift[6*k +: 6], inverse[`KN_INV*k +: `KN_INV]}));
        end
    endgenerate

    wire [3*`KN_ACC-1:0] reaction;
    wire node_sat_u, node_sat_position, node_sat_residual, node_sat_reaction;
    knead_node #(ACC) node_pipe (
        .clk(clk), .i_iterate(phase == `KN_PHASE_NODE && issue_1),
        .i_commit(phase == `KN_PHASE_NODE_COMMIT && issue_1), .i_clear(phase == `KN_PHASE_BEGIN),
        .i_first(iteration == 5'd0), .i_omega(omega), .i_sum_i(sum_i), .i_sum_j(sum_j), .i_load(load), .i_held(held),
        .i_u(u), .i_last(last), .i_inverse(inverse), .i_shift(shift), .i_x(x), .o_reaction(reaction), .o_x(x_moved),
        .o_u(u_moved), .o_last(last_moved), .o_residual(residual), .o_sat_u(node_sat_u),
        .o_sat_position(node_sat_position), .o_sat_residual(node_sat_residual), .o_sat_reaction(node_sat_reaction));

    wire list_sat_u, list_sat_reaction;
    knead_boundary #(LOG_NODES, LOG_LIST) boundary (
        .clk(clk), .i_bound(phase == `KN_PHASE_BOUND && issue), .i_reaction(phase == `KN_PHASE_REACTION && issue),
        .i_record(index[LOG_LIST-1:0]), .i_step(step), .o_list_address(list_address), .i_list(list_word),
        .o_node(list_node), .i_load(load_image), .i_held(held_image), .i_u(u), .i_reaction_sum(reaction),
        .o_write(bound_write), .o_load(load_bound), .o_held(held_bound), .o_u(u_bound), .o_result_write(result_write),
        .o_result_address(result_address), .o_result(result), .o_sat_u(list_sat_u), .o_sat_reaction(list_sat_reaction));

    knead_checksum #(LOG_NODES, LOG_EDGES) checksum (
        .clk(clk), .i_run(in_crc), .i_node_count(node_count), .i_edge_count(edge_count), .o_node(crc_node),
        .o_edge(crc_edge), .i_x(x), .i_u(u), .i_h(h), .o_done(crc_done), .o_crc(state_crc));

    // The flags in the order of KN_FIXED_SAT_*.
    assign flags = {node_sat_reaction | list_sat_reaction, node_sat_residual, setup_sat_direction, node_sat_position,
                    edge_sat_spring, setup_sat_tension | edge_sat_tension,
                    setup_sat_u | edge_sat_u | node_sat_u | list_sat_u};
endmodule
`default_nettype wire
