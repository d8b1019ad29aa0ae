`default_nettype none
// One edge in EDGE and COMMIT, one per clock: t = g dl + t0, the force t e on i (on j: minus it), and in COMMIT
// H += beta (t - H). This is equation (1) of core/fixed.h, with g = R kv and t0 = R H as SETUP froze them.
//
//     in     +1        +2       +3    +4      +5      +6      +7      +8      +9
//     u, e | u_j-u_i | e_k d_k | sum | dl  | g dl  | shift | t     | t e_k | round -> o_force
//                                                             +8: t - H  +9: beta  +10: shift  +11: -> o_h
`include "knead_formats.vh"
module knead_edge (
    input  wire                  clk,
    input  wire                  i_valid,
    input  wire                  i_commit, // constant while edges are in the pipe
    input  wire [5:0]            i_kv_shift,
    input  wire [`KN_BETA-1:0]   i_beta,
    input  wire [5:0]            i_beta_shift,
    input  wire [3*`KN_U-1:0]    i_u_i,
    input  wire [3*`KN_U-1:0]    i_u_j,
    input  wire [3*`KN_E-1:0]    i_e,
    input  wire [`KN_KV-1:0]     i_g,
    input  wire [`KN_T-1:0]      i_t0,
    input  wire [`KN_H-1:0]      i_h,
    output reg  [3*(`KN_T+1)-1:0] o_force, // 9 clocks later
    output reg  signed [`KN_H-1:0] o_h, // 11 clocks later
    output reg                   o_sat_u,
    output reg                   o_sat_tension,
    output reg                   o_sat_spring
);
    localparam M = `KN_U + `KN_KV + 1; // width of g dl
    reg [10:1] valid = 10'd0;
    always @(posedge clk) valid <= {valid[9:1], i_valid};

    // +1 .. +4: dl = e.(u_j - u_i)
    wire [3*`KN_U-1:0] d_1;
    wire over_d_1, over_dl_4;
    wire [3*`KN_E-1:0] e_1, e_7;
    wire signed [`KN_U-1:0] dl_4;
    knead_difference difference (.clk(clk), .i_from(i_u_i), .i_to(i_u_j), .o_d(d_1), .o_over(over_d_1));
    knead_delay #(3*`KN_E, 1) delay_e_1 (.clk(clk), .i_value(i_e), .o_value(e_1));
    knead_delay #(3*`KN_E, 6) delay_e_7 (.clk(clk), .i_value(e_1), .o_value(e_7));
    knead_dot dot (.clk(clk), .i_d(d_1), .i_e(e_1), .o_dl(dl_4), .o_over(over_dl_4));

    // +5 .. +7: the tension t = g dl + t0
    wire [`KN_KV-1:0] g_4;
    wire signed [`KN_T-1:0] t0_6;
    wire signed [M-1:0] stiff_5, shifted_5;
    reg signed [M-1:0] stiff_6;
    knead_delay #(`KN_KV, 4) delay_g (.clk(clk), .i_value(i_g), .o_value(g_4));
    knead_delay #(`KN_T, 6) delay_t0 (.clk(clk), .i_value(i_t0), .o_value(t0_6));
    knead_multiply #(`KN_U, `KN_KV+1) multiply_g (.clk(clk), .i_a(dl_4), .i_b($signed({1'b0, g_4})),
                                                  .o_product(stiff_5));
    knead_round #(M, 6) round_g (.i_value(stiff_5), .i_shift(i_kv_shift), .o_value(shifted_5));
    wire signed [M:0] sum_6 = $signed({stiff_6[M-1], stiff_6}) + $signed({{(M+1-`KN_T){t0_6[`KN_T-1]}}, t0_6});
    wire signed [`KN_T-1:0] t_6;
    wire over_t_6;
    reg signed [`KN_T-1:0] t_7;
    knead_saturate #(M+1, `KN_T) saturate_t (.i_value(sum_6), .o_value(t_6), .o_over(over_t_6));
    always @(posedge clk) begin
        stiff_6 <= shifted_5;
        t_7 <= t_6;
    end

    // +8, +9: the force t e_k of each component; |t e_k| is at most 2^24
    genvar k;
    generate
        for (k = 0; k < 3; k = k + 1) begin : g_component
            wire signed [`KN_T+`KN_E-1:0] product_8;
            wire signed [`KN_T+`KN_E-`KN_E_FRACTION:0] force_8;
            knead_multiply #(`KN_T, `KN_E) multiply_e (.clk(clk), .i_a(t_7),
                                                       .i_b($signed(e_7[k*`KN_E +: `KN_E])), .o_product(product_8));
            knead_round_by #(`KN_T+`KN_E, `KN_E_FRACTION) round_e (.i_value(product_8), .o_value(force_8));
            always @(posedge clk) o_force[k*(`KN_T+1) +: `KN_T+1] <= force_8[`KN_T:0];
            wire unused = &force_8[`KN_T+`KN_E-`KN_E_FRACTION:`KN_T+1];
        end
    endgenerate

    // H rounded to whole phi; 25 bits always hold it
    wire signed [`KN_H-1:0] h_6, h_10;
    wire signed [`KN_T-1:0] spring_6;
    reg signed [`KN_T-1:0] spring_7;
    knead_delay #(`KN_H, 6) delay_h_6 (.clk(clk), .i_value(i_h), .o_value(h_6));
    knead_delay #(`KN_H, 4) delay_h_10 (.clk(clk), .i_value(h_6), .o_value(h_10));
    knead_round_by #(`KN_H, `KN_H_FRACTION) round_h (.i_value(h_6), .o_value(spring_6));
    always @(posedge clk) spring_7 <= spring_6;

    // +8 .. +11: the new H = H + beta (t - H)
    localparam G = `KN_T + `KN_BETA + 1; // width of beta (t - H)
    wire signed [`KN_T:0] wide_7 = $signed({t_7[`KN_T-1], t_7}) - $signed({spring_7[`KN_T-1], spring_7});
    wire signed [`KN_T-1:0] gap_7;
    wire over_gap_7;
    reg signed [`KN_T-1:0] gap_8;
    reg over_gap_8;
    wire signed [G-1:0] flow_9, shifted_9;
    reg signed [G-1:0] flow_10;
    knead_saturate #(`KN_T+1, `KN_T) saturate_gap (.i_value(wide_7), .o_value(gap_7), .o_over(over_gap_7));
    knead_multiply #(`KN_T, `KN_BETA+1) multiply_beta (.clk(clk), .i_a(gap_8), .i_b($signed({1'b0, i_beta})),
                                                       .o_product(flow_9));
    knead_round #(G, 6) round_beta (.i_value(flow_9), .i_shift(i_beta_shift), .o_value(shifted_9));
    wire signed [G:0] sum_10 = $signed({flow_10[G-1], flow_10}) + $signed({{(G+1-`KN_H){h_10[`KN_H-1]}}, h_10});
    wire signed [`KN_H-1:0] new_10;
    wire over_h_10;
    knead_saturate #(G+1, `KN_H) saturate_h (.i_value(sum_10), .o_value(new_10), .o_over(over_h_10));
    always @(posedge clk) begin
        gap_8 <= gap_7;
        over_gap_8 <= over_gap_7;
        flow_10 <= shifted_9;
        o_h <= new_10;
    end

    // Flags count only for valid edges, and those of H only in COMMIT.
    initial {o_sat_u, o_sat_tension, o_sat_spring} = 3'd0;
    always @(posedge clk) begin
        o_sat_u <= valid[1] & over_d_1 | valid[4] & over_dl_4;
        o_sat_tension <= valid[6] & over_t_6 | valid[8] & over_gap_8 & i_commit;
        o_sat_spring <= valid[10] & over_h_10 & i_commit;
    end
endmodule
`default_nettype wire
