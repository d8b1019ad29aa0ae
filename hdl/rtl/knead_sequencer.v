`default_nettype none
// The order of a tick, as in the drawing of core/fixed.h. Each phase issues an item (node, edge, record of the boundary
// list) per clock, or one per `steps` clocks. Then the phase drains, until its last write is done.
`include "knead_formats.vh"
`include "knead_phases.vh"
module knead_sequencer (
    input  wire        clk,
    input  wire        rst,
    input  wire        i_tick, // high for one clock, in IDLE
    input  wire        i_rest,
    input  wire        i_crc,
    input  wire        i_crc_done,
    input  wire [16:0] i_node_count,
    input  wire [20:0] i_edge_count,
    input  wire [10:0] i_bound_count,
    input  wire [3:0]  i_passes,
    input  wire [5:0]  i_iterations,
    output reg  [3:0]  o_phase,
    output wire        o_issue, // item o_index begins, or is at o_step
    output reg  [20:0] o_index,
    output reg  [3:0]  o_step,
    output reg  [4:0]  o_iteration,
    output reg         o_ticked // high in the clock after a tick
);
    reg [20:0] count;
    reg [3:0] steps; // clocks of an item
    reg [5:0] drain; // clocks of the drain
    reg [3:0] next;
    reg [5:0] drained;
    reg [3:0] pass;
    reg crc_next; // CRC was asked for together with rest

    wire [5:0] iteration_after = {1'b0, o_iteration} + 6'd1;
    wire [4:0] pass_after = {1'b0, pass} + 5'd1;
    wire again = iteration_after < i_iterations;
    wire more = pass_after < {1'b0, i_passes};
    wire [20:0] nodes = {4'd0, i_node_count};
    wire [20:0] bounds = {10'd0, i_bound_count};

    // Items, clocks an item, drain and successor of each phase.
    always @* begin
        count = nodes;
        steps = 4'd1;
        drain = 6'd1;
        next = `KN_PHASE_IDLE;
        case (o_phase)
            `KN_PHASE_BEGIN: begin drain = 6'd`KN_CYCLES_BEGIN; next = `KN_PHASE_BOUND; end
            `KN_PHASE_BOUND: begin
                count = bounds; steps = 4'd`KN_CYCLES_BOUND; drain = 6'd0; next = `KN_PHASE_SETUP;
            end
            `KN_PHASE_SETUP: begin count = i_edge_count; drain = 6'd`KN_CYCLES_SETUP; next = `KN_PHASE_INVERT; end
            `KN_PHASE_INVERT: begin steps = 4'd3; drain = 6'd`KN_CYCLES_INVERT; next = `KN_PHASE_EDGE; end
            `KN_PHASE_EDGE: begin count = i_edge_count; drain = 6'd`KN_CYCLES_EDGE; next = `KN_PHASE_NODE; end
            `KN_PHASE_NODE: begin
                drain = 6'd`KN_CYCLES_NODE;
                next = again ? `KN_PHASE_EDGE : more ? `KN_PHASE_SETUP : `KN_PHASE_EDGE_COMMIT;
            end
            `KN_PHASE_EDGE_COMMIT: begin
                count = i_edge_count; drain = 6'd`KN_CYCLES_EDGE_COMMIT; next = `KN_PHASE_NODE_COMMIT;
            end
            `KN_PHASE_NODE_COMMIT: begin drain = 6'd`KN_CYCLES_NODE_COMMIT; next = `KN_PHASE_REACTION; end
            `KN_PHASE_REACTION: begin count = bounds; steps = 4'd`KN_CYCLES_REACTION; drain = 6'd0; end
            `KN_PHASE_REST_NODES: next = `KN_PHASE_REST_EDGES;
            `KN_PHASE_REST_EDGES: begin count = i_edge_count; next = crc_next ? `KN_PHASE_CRC : `KN_PHASE_IDLE; end
            default: ;
        endcase
    end

    // A phase without drain and without items takes no clock, so skip it: BOUND and REACTION of an empty list.
    wire unlisted = i_bound_count == 11'd0;
    wire [3:0] after = unlisted && next == `KN_PHASE_BOUND ? `KN_PHASE_SETUP
                     : unlisted && next == `KN_PHASE_REACTION ? `KN_PHASE_IDLE : next;

    assign o_issue = o_phase != `KN_PHASE_IDLE && o_phase != `KN_PHASE_CRC && o_index < count;
    wire item_ends = o_issue && o_step + 4'd1 == steps;
    wire last = item_ends && o_index + 21'd1 == count;
    wire ends = drain == 6'd0 ? last : !o_issue && drained + 6'd1 == drain;

    always @(posedge clk) begin
        o_ticked <= 1'b0;
        if (o_phase == `KN_PHASE_IDLE) crc_next <= i_crc;
        if (rst) o_phase <= `KN_PHASE_IDLE;
        else if (o_phase == `KN_PHASE_IDLE) begin
            if (i_tick) o_phase <= `KN_PHASE_BEGIN;
            else if (i_rest) o_phase <= `KN_PHASE_REST_NODES;
            else if (i_crc) o_phase <= `KN_PHASE_CRC;
        end else if (o_phase == `KN_PHASE_CRC) begin
            if (i_crc_done) o_phase <= `KN_PHASE_IDLE;
        end else if (ends) begin
            o_phase <= after;
            o_ticked <= after == `KN_PHASE_IDLE && o_phase != `KN_PHASE_REST_EDGES;
        end

        if (o_phase == `KN_PHASE_IDLE || ends) begin
            o_index <= 21'd0;
            o_step <= 4'd0;
            drained <= 6'd0;
        end else if (o_issue) begin
            o_step <= item_ends ? 4'd0 : o_step + 4'd1;
            if (item_ends) o_index <= o_index + 21'd1;
        end else drained <= drained + 6'd1;

        if (o_phase == `KN_PHASE_IDLE) pass <= 4'd0;
        else if (ends && o_phase == `KN_PHASE_NODE && !again) pass <= pass_after[3:0];
        if (o_phase == `KN_PHASE_SETUP) o_iteration <= 5'd0;
        else if (ends && o_phase == `KN_PHASE_NODE) o_iteration <= iteration_after[4:0];
    end
endmodule
`default_nettype wire
