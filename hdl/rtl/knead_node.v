`default_nettype none
// One node in NODE and COMMIT, one per clock: its three components, their flags, and the largest residual of a tick.
`include "knead_formats.vh"
module knead_node #(
    parameter WIDTH = 36
) (
    input  wire                 clk,
    input  wire                 i_iterate, // a node in NODE enters
    input  wire                 i_commit, // a node in COMMIT enters
    input  wire                 i_clear, // high when a tick begins
    input  wire                 i_first,
    input  wire [`KN_OMEGA-1:0] i_omega,
    input  wire [3*WIDTH-1:0]   i_sum_i,
    input  wire [3*WIDTH-1:0]   i_sum_j,
    input  wire [3*`KN_T-1:0]   i_load,
    input  wire [2:0]           i_held,
    input  wire [3*`KN_U-1:0]   i_u,
    input  wire [3*`KN_U-1:0]   i_last,
    input  wire [3*`KN_INV-1:0] i_inverse,
    input  wire [17:0]          i_shift,
    input  wire [3*`KN_X-1:0]   i_x,
    output wire [3*`KN_ACC-1:0] o_reaction, // 2 clocks later
    output wire [3*`KN_X-1:0]   o_x, // 2 clocks later
    output wire [3*`KN_U-1:0]   o_u, // 10 clocks later
    output wire [3*`KN_U-1:0]   o_last, // 10 clocks later
    output reg  [`KN_ACC-1:0]   o_residual,
    output reg                  o_sat_u,
    output reg                  o_sat_position,
    output reg                  o_sat_residual,
    output reg                  o_sat_reaction
);
    reg [10:1] iterate = 10'd0;
    reg [3:1] commit = 3'd0;
    always @(posedge clk) begin
        iterate <= {iterate[9:1], i_iterate};
        commit <= {commit[2:1], i_commit};
    end

    // Held components raise no flag in NODE: mask the flags with ~i_held, delayed as the values are.
    wire [2:0] over_sum_2, over_x_2, over_r_3, over_z_6, over_u_10;
    wire [2:0] free_2, free_3, free_6, free_10;
    knead_delay #(3, 2) delay_free_2 (.clk(clk), .i_value(~i_held), .o_value(free_2));
    knead_delay #(3, 1) delay_free_3 (.clk(clk), .i_value(free_2), .o_value(free_3));
    knead_delay #(3, 3) delay_free_6 (.clk(clk), .i_value(free_3), .o_value(free_6));
    knead_delay #(3, 4) delay_free_10 (.clk(clk), .i_value(free_6), .o_value(free_10));
    reg [`KN_ACC-1:0] size_3 [0:2];
    genvar k;
    generate
        for (k = 0; k < 3; k = k + 1) begin : g_component
            wire signed [`KN_ACC-1:0] residual_2;
            assign o_reaction[k*`KN_ACC +: `KN_ACC] = residual_2;
            always @(posedge clk)
                size_3[k] <= !free_2[k] ? {`KN_ACC{1'b0}} : residual_2[`KN_ACC-1] ? -residual_2 : residual_2;
            knead_component #(WIDTH) component (
                .clk(clk), .i_first(i_first), .i_omega(i_omega),
                .i_sum_i(i_sum_i[k*WIDTH +: WIDTH]), .i_sum_j(i_sum_j[k*WIDTH +: WIDTH]),
                .i_load(i_load[k*`KN_T +: `KN_T]), .i_held(i_held[k]),
                .i_u($signed(i_u[k*`KN_U +: `KN_U])), .i_last($signed(i_last[k*`KN_U +: `KN_U])),
                .i_inverse(i_inverse[k*`KN_INV +: `KN_INV]), .i_shift(i_shift[k*6 +: 6]),
                .i_x($signed(i_x[k*`KN_X +: `KN_X])),
                .o_residual(residual_2), .o_sat_residual(over_sum_2[k]),
                .o_x(o_x[k*`KN_X +: `KN_X]), .o_sat_x(over_x_2[k]), .o_sat_r(over_r_3[k]), .o_sat_z(over_z_6[k]),
                .o_u(o_u[k*`KN_U +: `KN_U]), .o_last(o_last[k*`KN_U +: `KN_U]), .o_sat_u(over_u_10[k]));
        end
    endgenerate

    // The largest |r| on a free component since i_clear. |-2^35| is 2^35, which 36 unsigned bits hold.
    reg [`KN_ACC-1:0] most_4, third_4;
    reg commit_4;
    initial commit_4 = 1'b0;
    always @(posedge clk) begin
        most_4 <= size_3[0] > size_3[1] ? size_3[0] : size_3[1];
        third_4 <= size_3[2];
        commit_4 <= commit[3];
        if (i_clear) o_residual <= {`KN_ACC{1'b0}};
        else if (commit_4 && (most_4 > o_residual || third_4 > o_residual))
            o_residual <= most_4 > third_4 ? most_4 : third_4;
    end

    initial {o_sat_u, o_sat_position, o_sat_residual, o_sat_reaction} = 4'd0;
    always @(posedge clk) begin
        o_sat_reaction <= iterate[2] & |(over_sum_2 & free_2) | commit[2] & |over_sum_2;
        o_sat_position <= commit[2] & |over_x_2;
        o_sat_residual <= iterate[3] & |(over_r_3 & free_3);
        o_sat_u <= iterate[6] & |(over_z_6 & free_6) | iterate[10] & |(over_u_10 & free_10);
    end
endmodule
`default_nettype wire
