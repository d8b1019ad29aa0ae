`default_nettype none
// The word bus (hdl/registers.h): registers, the doorbell, and the refusal of transfers. A transfer takes four clocks.
// For a window, its address first reads the memories; then o_act writes the record back with the word replaced.
`include "knead_formats.vh"
module knead_registers #(
    parameter LOG_NODES = 10,
    parameter LOG_EDGES = 13,
    parameter LOG_LIST = 6
) (
    input  wire                  clk,
    input  wire                  rst,
    // bus
    input  wire                  i_bus_valid,
    input  wire                  i_bus_write,
    input  wire [23:0]           i_bus_addr,
    input  wire [31:0]           i_bus_wdata,
    output reg                   o_bus_ready,
    output reg  [31:0]           o_bus_rdata,
    output reg                   o_bus_error,
    // windows
    input  wire [31:0]           i_window_data,
    output wire                  o_act, // write the word now
    // engine
    input  wire                  i_busy,
    output reg                   o_tick, // high for one clock, as o_rest and o_crc
    output reg                   o_rest,
    output reg                   o_crc,
    input  wire                  i_ticked,
    input  wire [6:0]            i_flags, // numbers that did not fit in this clock
    input  wire [`KN_ACC-1:0]    i_residual,
    input  wire [31:0]           i_state_crc,
    output reg  [16:0]           o_node_count,
    output reg  [20:0]           o_edge_count,
    output reg  [3:0]            o_passes,
    output reg  [5:0]            o_iterations,
    output reg  [4:0]            o_d_shift,
    output reg  [5:0]            o_kv_shift,
    output reg  [6:0]            o_octave,
    output reg  [`KN_BETA-1:0]   o_beta,
    output reg  [5:0]            o_beta_shift,
    output reg  [`KN_RELAX-1:0]  o_relax,
    output reg  [10:0]           o_bound_count
);
    reg loaded, wrong_seq, empty;
    reg [6:0] flags, result_flags;
    reg [31:0] scratch, tick, seq, cycles, cycles_last, cycles_max;
    reg [`KN_ACC-1:0] residual;

    // Decode the address.
    wire [6:0] at = i_bus_addr[6:0];
    wire is_omega = i_bus_addr[23:5] == 19'd2; // a memory, as a window is
    wire is_register = i_bus_addr[23:7] == 17'd0 && !is_omega;
    wire [15:0] node_beyond = {i_bus_addr[19:4]} >> LOG_NODES;
    wire [19:0] edge_beyond = i_bus_addr[22:3] >> LOG_EDGES;
    wire [15:0] rest_beyond = i_bus_addr[18:3] >> LOG_NODES;
    wire [15:0] list_beyond = i_bus_addr[15:0] >> (LOG_LIST + 2);
    localparam [15:0] RESULTS = 16'd6 << LOG_LIST;
    wire is_table = i_bus_addr[23:16] == 8'h01 && i_bus_addr[15:0] <= 16'd`KN_SEGMENTS;
    wire is_list = i_bus_addr[23:16] == 8'h02 && list_beyond == 16'd0;
    wire is_result = i_bus_addr[23:16] == 8'h03 && i_bus_addr[15:0] < RESULTS;
    wire is_node = i_bus_addr[23:20] == 4'h1 && node_beyond == 16'd0;
    wire is_rest = i_bus_addr[23:19] == 5'b00100 && rest_beyond == 16'd0;
    wire is_edge = i_bus_addr[23] && edge_beyond == 20'd0;
    wire is_window = is_omega | is_table | is_list | is_result | is_node | is_rest | is_edge;

    // For a register: its word, whether it may be written, whether the value fits, and whether a tick reads it
    // (config_).
    reg [31:0] read;
    reg known, writable, fits, config_;
    always @* begin
        read = 32'd0;
        known = 1'b1;
        writable = 1'b1;
        fits = 1'b1;
        config_ = 1'b1;
        case (at)
            `KN_REG_ID: begin read = `KN_ENGINE_ID; writable = 1'b0; end
            `KN_REG_VERSION: begin read = `KN_ENGINE_VERSION; writable = 1'b0; end
            `KN_REG_BUILD_HASH: begin read = `KN_BUILD_HASH; writable = 1'b0; end
            `KN_REG_CAPS: begin read = {8'd0, LOG_LIST[7:0], LOG_EDGES[7:0], LOG_NODES[7:0]}; writable = 1'b0; end
            `KN_REG_CONTROL: fits = ~|i_bus_wdata[31:`KN_BITS_CONTROL];
            `KN_REG_STATUS: begin
                read = {28'd0, empty, wrong_seq, loaded, i_busy};
                fits = ~|i_bus_wdata[31:`KN_BITS_STATUS];
                config_ = 1'b0;
            end
            `KN_REG_FLAGS: begin read = {25'd0, flags}; fits = ~|i_bus_wdata[31:`KN_BITS_FLAGS]; config_ = 1'b0; end
            `KN_REG_SCRATCH: begin read = scratch; config_ = 1'b0; end
            `KN_REG_TICK: begin read = tick; writable = 1'b0; end
            `KN_REG_STEP_SEQ: begin read = seq; config_ = i_bus_wdata == seq + 32'd1; end
            `KN_REG_CYCLES: begin read = cycles_last; writable = 1'b0; end
            `KN_REG_CYCLES_MAX: begin read = cycles_max; writable = 1'b0; end
            `KN_REG_STATE_CRC: begin read = i_state_crc; writable = 1'b0; end
            `KN_REG_RESIDUAL_LO: begin read = residual[31:0]; writable = 1'b0; end
            `KN_REG_RESIDUAL_HI: begin read = {{(64-`KN_ACC){1'b0}}, residual[`KN_ACC-1:32]}; writable = 1'b0; end
            `KN_REG_RESULT_FLAGS: begin read = {25'd0, result_flags}; writable = 1'b0; end
            `KN_REG_NODE_COUNT: begin read = {15'd0, o_node_count}; fits = i_bus_wdata <= 32'd1 << LOG_NODES; end
            `KN_REG_EDGE_COUNT: begin read = {11'd0, o_edge_count}; fits = i_bus_wdata <= 32'd1 << LOG_EDGES; end
            `KN_REG_PASSES: begin read = {28'd0, o_passes}; fits = ~|i_bus_wdata[31:`KN_BITS_PASSES]; end
            `KN_REG_ITERATIONS: begin read = {26'd0, o_iterations}; fits = ~|i_bus_wdata[31:`KN_BITS_ITERATIONS]; end
            `KN_REG_D_SHIFT: begin read = {27'd0, o_d_shift}; fits = ~|i_bus_wdata[31:`KN_BITS_D_SHIFT]; end
            `KN_REG_KV_SHIFT: begin read = {26'd0, o_kv_shift}; fits = ~|i_bus_wdata[31:`KN_BITS_KV_SHIFT]; end
            `KN_REG_OCTAVE: begin read = {25'd0, o_octave}; fits = ~|i_bus_wdata[31:`KN_BITS_OCTAVE]; end
            `KN_REG_BETA: begin read = {15'd0, o_beta}; fits = ~|i_bus_wdata[31:`KN_BITS_BETA]; end
            `KN_REG_BETA_SHIFT: begin read = {26'd0, o_beta_shift}; fits = ~|i_bus_wdata[31:`KN_BITS_BETA_SHIFT]; end
            `KN_REG_RELAX: begin read = {15'd0, o_relax}; fits = ~|i_bus_wdata[31:`KN_BITS_RELAX]; end
            `KN_REG_BOUND_COUNT: begin read = {21'd0, o_bound_count}; fits = i_bus_wdata < 32'd1 << LOG_LIST; end
            default: known = 1'b0;
        endcase
    end
    // The node numbers in an edge and in a boundary record must be nodes.
    wire [15:0] i_beyond = i_bus_wdata[15:0] >> LOG_NODES;
    wire [15:0] j_beyond = i_bus_wdata[31:16] >> LOG_NODES;
    wire edge_fits = i_bus_addr[2:0] != 3'd0 || (i_beyond | j_beyond) == 16'd0;
    wire list_fits = i_bus_addr[1:0] != 2'd0 || (i_bus_wdata[30:0] >> LOG_NODES) == 31'd0;
    wire omega_fits = ~|i_bus_wdata[31:`KN_BITS_OMEGA];

    // Settings with which a step may run. A proof leaves sane free, since loading all settings takes too many clocks
    // there.
`ifdef FORMAL
    (* anyseq *) wire sane;
`else
    wire sane = o_node_count != 17'd0 && o_passes != 4'd0 && o_iterations != 6'd0 && o_iterations <= 6'd32
             && o_d_shift <= 5'd18 && o_kv_shift <= 6'd40 && o_beta_shift <= 6'd40 && o_relax != {`KN_RELAX{1'b0}};
`endif

    reg [1:0] step;
    reg busy_seen; // busy since the transfer began: the engine had the memories' addresses
    // Refuse while the engine is busy: any window, and writing a setting that a tick reads.
    wire refuse_register = !known || i_bus_write && (!writable || !fits || config_ && i_busy);
    wire refuse_window = !is_window || i_busy || busy_seen || i_bus_write && (is_result || is_edge && !edge_fits
                         || is_list && !list_fits || is_omega && !omega_fits);
    wire refuse = is_register ? refuse_register : refuse_window;
    wire done = i_bus_valid && !o_bus_ready && step == 2'd2;
    wire write = done && i_bus_write && !refuse && is_register;
    assign o_act = done && i_bus_write && !refuse && is_window;

    always @(posedge clk) begin
        o_bus_ready <= done && !rst;
        o_bus_error <= refuse;
        o_bus_rdata <= refuse ? 32'd0 : is_register ? read : i_window_data;
        step <= !i_bus_valid || o_bus_ready || done || rst ? 2'd0 : step + 2'd1;
        busy_seen <= i_bus_valid && !o_bus_ready && !rst && (i_busy || busy_seen && step != 2'd0);
    end

    // The doorbell: STEP_SEQ + 1 starts a tick if a sane state is loaded; the number that it has changes nothing.
    wire knock = write && at == `KN_REG_STEP_SEQ;
    wire next_seq = i_bus_wdata == seq + 32'd1;
    wire control = write && at == `KN_REG_CONTROL;
    wire is_config = at >= `KN_REG_NODE_COUNT && at <= `KN_REG_RELAX;
    always @(posedge clk) begin
        o_tick <= knock && next_seq && loaded && !rst;
        o_rest <= control && i_bus_wdata[0] && !rst;
        o_crc <= control && i_bus_wdata[2] && !rst;
        if (rst) begin
            seq <= 32'd0;
            {loaded, wrong_seq, empty} <= 3'd0;
        end else begin
            if (knock && next_seq && loaded) seq <= i_bus_wdata;
            if (control && i_bus_wdata[3]) loaded <= sane;
            else if (write && is_config || o_act && is_omega) loaded <= 1'b0;
            if (write && at == `KN_REG_STATUS) {empty, wrong_seq} <= {empty, wrong_seq} & ~i_bus_wdata[3:2];
            if (knock && next_seq && !loaded) empty <= 1'b1;
            if (knock && !next_seq && i_bus_wdata != seq) wrong_seq <= 1'b1;
        end
    end

    // Results of the ticks: flags, tick number, clocks, residual.
    wire fresh = control && (i_bus_wdata[0] || i_bus_wdata[3]);
    wire clear = control && i_bus_wdata[1];
    always @(posedge clk) begin
        if (rst || clear) flags <= 7'd0;
        else flags <= flags & ~(write && at == `KN_REG_FLAGS ? i_bus_wdata[6:0] : 7'd0) | i_flags;
        if (rst || fresh) tick <= 32'd0;
        else if (i_ticked) tick <= tick + 32'd1;
        cycles <= o_tick ? 32'd0 : cycles + 32'd1;
        if (rst || clear) cycles_max <= 32'd0;
        else if (i_ticked && cycles > cycles_max) cycles_max <= cycles;
        if (rst) {cycles_last, residual, result_flags} <= {(39+`KN_ACC){1'b0}};
        else if (i_ticked) begin
            cycles_last <= cycles;
            residual <= i_residual;
            result_flags <= flags | i_flags;
        end
    end

    always @(posedge clk) begin
        if (rst) begin
            scratch <= 32'd0;
            {o_node_count, o_passes, o_iterations} <= 27'd0;
            {o_edge_count, o_bound_count, o_d_shift, o_kv_shift, o_octave, o_beta_shift} <= 56'd0;
            {o_beta, o_relax} <= {(`KN_BETA+`KN_RELAX){1'b0}};
        end else if (write) case (at)
            `KN_REG_SCRATCH: scratch <= i_bus_wdata;
            `KN_REG_NODE_COUNT: o_node_count <= i_bus_wdata[16:0];
            `KN_REG_EDGE_COUNT: o_edge_count <= i_bus_wdata[20:0];
            `KN_REG_PASSES: o_passes <= i_bus_wdata[3:0];
            `KN_REG_ITERATIONS: o_iterations <= i_bus_wdata[5:0];
            `KN_REG_D_SHIFT: o_d_shift <= i_bus_wdata[4:0];
            `KN_REG_KV_SHIFT: o_kv_shift <= i_bus_wdata[5:0];
            `KN_REG_OCTAVE: o_octave <= i_bus_wdata[6:0];
            `KN_REG_BETA: o_beta <= i_bus_wdata[`KN_BETA-1:0];
            `KN_REG_BETA_SHIFT: o_beta_shift <= i_bus_wdata[5:0];
            `KN_REG_RELAX: o_relax <= i_bus_wdata[`KN_RELAX-1:0];
            `KN_REG_BOUND_COUNT: o_bound_count <= i_bus_wdata[10:0];
            default: ;
        endcase
    end
endmodule
`default_nettype wire
