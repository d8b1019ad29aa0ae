`default_nettype none
// One component of a node, one per clock. In NODE it takes a Jacobi step with Chebyshev's weight, equation (2) of
// core/fixed.h; in COMMIT it gives its residual and x + u.
//
//     in       +1    +2        +3    +4      +5      +6  +7           +8      +9     +10
//     sums | total | r (36) | r (25) | r inverse | shift | z | u + z - u_ | omega | round | u_ + .. -> o_u
//                     +2: o_residual, o_x
`include "knead_formats.vh"
module knead_component #(
    parameter WIDTH = 36
) (
    input  wire                     clk,
    input  wire                     i_first, // first of K iterations: u_ is u
    input  wire [`KN_OMEGA-1:0]     i_omega,
    input  wire [WIDTH-1:0]         i_sum_i,
    input  wire [WIDTH-1:0]         i_sum_j,
    input  wire [`KN_T-1:0]         i_load,
    input  wire                     i_held,
    input  wire signed [`KN_U-1:0]  i_u,
    input  wire signed [`KN_U-1:0]  i_last,
    input  wire [`KN_INV-1:0]       i_inverse,
    input  wire [5:0]               i_shift,
    input  wire signed [`KN_X-1:0]  i_x,
    output reg  signed [`KN_ACC-1:0] o_residual, // 2 clocks later
    output reg                      o_sat_residual, // the residual is beyond 36 bits; with o_residual
    output reg  signed [`KN_X-1:0]  o_x, // 2 clocks later
    output reg                      o_sat_x,
    output reg                      o_sat_r, // 3 clocks later: r is beyond 25 bits
    output reg                      o_sat_z, // 6 clocks later: z is beyond 25 bits
    output reg  signed [`KN_U-1:0]  o_u, // 10 clocks later
    output wire signed [`KN_U-1:0]  o_last, // u before the step, with o_u
    output reg                      o_sat_u
);
    localparam M = `KN_T + `KN_INV + 1;
    localparam V = `KN_U + 2; // u + z - u_
    localparam Q = V + `KN_OMEGA + 1;
    localparam S = Q - `KN_OMEGA_FRACTION + 2;

    // +1, +2: r, the sum of both ends' forces and the load; and x + u
    reg signed [WIDTH+1:0] total_1;
    reg signed [`KN_X:0] moved_1;
    wire signed [`KN_ACC-1:0] r_1;
    wire signed [`KN_X-1:0] x_1;
    wire over_r_1, over_x_1;
    knead_saturate #(WIDTH+2, `KN_ACC) saturate_sum (.i_value(total_1), .o_value(r_1), .o_over(over_r_1));
    knead_saturate #(`KN_X+1, `KN_X) saturate_x (.i_value(moved_1), .o_value(x_1), .o_over(over_x_1));
    always @(posedge clk) begin
        total_1 <= $signed({{2{i_sum_i[WIDTH-1]}}, i_sum_i}) + $signed({{2{i_sum_j[WIDTH-1]}}, i_sum_j})
                 + $signed({{(WIDTH+2-`KN_T){i_load[`KN_T-1]}}, i_load});
        moved_1 <= $signed({i_x[`KN_X-1], i_x}) + $signed({{(`KN_X+1-`KN_U){i_u[`KN_U-1]}}, i_u});
        o_residual <= r_1;
        o_sat_residual <= over_r_1;
        o_x <= x_1;
        o_sat_x <= over_x_1;
    end

    // +3 .. +6: z = r inverse / 2^shift
    wire signed [`KN_T-1:0] r_2;
    wire over_2;
    reg signed [`KN_T-1:0] r_3;
    wire [`KN_INV-1:0] inverse_3;
    wire [5:0] shift_4;
    wire signed [M-1:0] product_4, shifted_4;
    reg signed [M-1:0] shifted_5;
    wire signed [`KN_U-1:0] z_5;
    wire over_z_5;
    reg signed [`KN_U-1:0] z_6;
    knead_saturate #(`KN_ACC, `KN_T) saturate_r (.i_value(o_residual), .o_value(r_2), .o_over(over_2));
    knead_delay #(`KN_INV, 3) delay_inverse (.clk(clk), .i_value(i_inverse), .o_value(inverse_3));
    knead_delay #(6, 4) delay_shift (.clk(clk), .i_value(i_shift), .o_value(shift_4));
    knead_multiply #(`KN_T, `KN_INV+1) multiply_inverse (.clk(clk), .i_a(r_3),
                                                         .i_b($signed({1'b0, inverse_3})), .o_product(product_4));
    knead_round #(M, 6) round_z (.i_value(product_4), .i_shift(shift_4), .o_value(shifted_4));
    knead_saturate #(M, `KN_U) saturate_z (.i_value(shifted_5), .o_value(z_5), .o_over(over_z_5));
    always @(posedge clk) begin
        r_3 <= r_2;
        o_sat_r <= over_2;
        shifted_5 <= shifted_4;
        z_6 <= z_5;
        o_sat_z <= over_z_5;
    end

    // +7 .. +10: the new u = u_ + omega (u + z - u_); a held component keeps the old one
    wire signed [`KN_U-1:0] u_6, last_6, last_8;
    wire held_9;
    reg signed [V-1:0] way_7;
    wire signed [Q-1:0] product_8;
    wire signed [Q-`KN_OMEGA_FRACTION:0] rounded_8;
    reg signed [S-1:0] wide_9;
    wire signed [`KN_U-1:0] u_9, old_9;
    wire over_u_9;
    knead_delay #(`KN_U, 6) delay_u_6 (.clk(clk), .i_value(i_u), .o_value(u_6));
    knead_delay #(`KN_U, 3) delay_u_9 (.clk(clk), .i_value(u_6), .o_value(old_9));
    knead_delay #(`KN_U, 1) delay_u_10 (.clk(clk), .i_value(old_9), .o_value(o_last));
    knead_delay #(`KN_U, 6) delay_last_6 (.clk(clk), .i_value(i_first ? i_u : i_last), .o_value(last_6));
    knead_delay #(`KN_U, 2) delay_last_8 (.clk(clk), .i_value(last_6), .o_value(last_8));
    knead_delay #(1, 9) delay_held (.clk(clk), .i_value(i_held), .o_value(held_9));
    knead_multiply #(V, `KN_OMEGA+1) multiply_omega (.clk(clk), .i_a(way_7), .i_b($signed({1'b0, i_omega})),
                                                     .o_product(product_8));
    knead_round_by #(Q, `KN_OMEGA_FRACTION) round_way (.i_value(product_8), .o_value(rounded_8));
    knead_saturate #(S, `KN_U) saturate_u (.i_value(wide_9), .o_value(u_9), .o_over(over_u_9));
    always @(posedge clk) begin
        way_7 <= $signed({{2{u_6[`KN_U-1]}}, u_6}) + $signed({{2{z_6[`KN_U-1]}}, z_6})
               - $signed({{2{last_6[`KN_U-1]}}, last_6});
        wide_9 <= $signed({rounded_8[Q-`KN_OMEGA_FRACTION], rounded_8})
                + $signed({{(S-`KN_U){last_8[`KN_U-1]}}, last_8});
        o_u <= held_9 ? old_9 : u_9;
        o_sat_u <= over_u_9;
    end
endmodule
`default_nettype wire
