`default_nettype none
// The engine makes as many steps as STEP_SEQ says. It makes none for a number that it has had, and starts none while it
// is busy. While it is busy no window is written, and nothing changes that a tick reads. LOADED is set only for a sane
// configuration, and it is cleared once a setting changes. Every transfer is answered within four clocks.
module doorbell (
    input wire        clk, rst, valid, write, busy, ticked,
    input wire [23:0] address,
    input wire [31:0] data
);
    wire        ready, act, tick, rest, crc;
    wire [16:0] o_node_count, o_beta, o_relax;
    wire [20:0] o_edge_count;
    wire [ 3:0] o_passes;
    wire [ 5:0] o_iterations, o_kv_shift, o_beta_shift;
    wire [ 4:0] o_d_shift;
    wire [ 6:0] o_octave;
    wire [10:0] o_bound_count;
    knead_registers #(.LOG_NODES(3), .LOG_EDGES(4), .LOG_LIST(2)) dut (
        .i_bus_valid(valid), .i_bus_write(write), .i_bus_addr(address), .i_bus_wdata(data), .o_bus_ready(ready),
        .o_bus_rdata(), .o_bus_error(), .i_window_data(32'd0), .o_act(act), .i_busy(busy), .i_ticked(ticked),
        .o_tick(tick), .o_rest(rest), .o_crc(crc), .i_flags(7'd0), .i_residual(36'd0), .i_state_crc(32'd0), .*);

    wire [31:0] seq; // peek: dut.seq
    wire [ 1:0] step; // peek: dut.step
    wire        loaded, sane; // peek: dut.loaded dut.sane

    reg         begun, valid_r, ready_r, write_r, busy_r, told_r, tick_r, rst_r, loaded_r, sane_r;
    reg  [23:0] address_r;
    reg  [31:0] data_r, steps, seq_r;
    reg  [ 2:0] waited;
    reg  [105:0] settings_r;
    reg  [ 10:0] bound_count_r;
    wire [105:0] settings = {o_node_count, o_edge_count, o_passes, o_iterations, o_d_shift, o_kv_shift, o_octave,
                             o_beta, o_beta_shift, o_relax};
    initial begun = 1'b0;
    always @(posedge clk) begin
        begun <= 1'b1;
        {valid_r, ready_r, write_r, busy_r, tick_r} <= {valid, ready, write, busy, tick};
        told_r <= rest | crc;
        address_r <= address;
        data_r <= data;
        seq_r <= seq;
        settings_r <= settings;
        bound_count_r <= o_bound_count;
        {rst_r, loaded_r, sane_r} <= {rst, loaded, sane};
        steps <= rst ? 32'd0 : steps + {31'd0, tick};
        waited <= rst || !valid || ready ? 3'd0 : waited + 3'd1;
    end

    always @* if (!begun) assume (rst);
    always @* if (begun) begin
        // A master keeps its request until it is answered. The engine is busy in the clock after it was told to work.
        if (valid_r && !ready_r && !rst) assume (valid && write == write_r && address == address_r && data == data_r);
        if (tick_r || told_r) assume (busy);
        else if (!busy_r) assume (!busy);
    end
    always @* if (begun && !rst) begin
        assert (steps + {31'd0, tick} == seq);
        assert (seq == seq_r || tick && seq == seq_r + 32'd1 || seq == 32'd0);
        if (tick) assert (seq == data_r && write_r && !busy_r && loaded);
        if (act) assert (!busy && write && valid);
        if (busy_r && !rst_r) assert (settings == settings_r && o_bound_count == bound_count_r);
        if (loaded && !rst_r) assert (settings == settings_r && (loaded_r || sane_r && write_r && data_r[3]));
        assert (waited <= 3'd3);
        assert (ready || step == waited[1:0]);
    end
    always @(posedge clk) cover (begun && tick && seq == 32'd2);
endmodule
`default_nettype wire
