`default_nettype none
// One edge in SETUP, one per clock: e at the middle of the tick, R at the trial force, g = R kv, t0 = R H, and the
// edge's share of D.
//
//     in  +3          +5      +13     +16         +19           +22             +30 +32     +38
//     x | d rounded | |d|^2 | 1/|d| | e clamped | dl = e.(du) | B = kv dl + H | R | g, t0 | share
//
// The 1/sqrt unit is shared with INVERT: q leaves at +5, r and half arrive 8 clocks later.
`include "knead_formats.vh"
module knead_setup (
    input  wire                  clk,
    input  wire                  i_valid,
    input  wire [4:0]            i_d_shift,
    input  wire [5:0]            i_kv_shift,
    input  wire [6:0]            i_octave,
    input  wire [3*`KN_X-1:0]    i_x_i,
    input  wire [3*`KN_X-1:0]    i_x_j,
    input  wire [3*`KN_U-1:0]    i_u_i,
    input  wire [3*`KN_U-1:0]    i_u_j,
    input  wire [`KN_KV-1:0]     i_kv,
    input  wire [`KN_IA-1:0]     i_ia,
    input  wire [`KN_H-1:0]      i_h,
    output reg  [35:0]           o_q,
    input  wire [17:0]           i_r,
    input  wire [4:0]            i_half,
    output wire [9:0]            o_table_address,
    input  wire [`KN_R-1:0]      i_table_here,
    input  wire [`KN_R-1:0]      i_table_next,
    output wire [3*`KN_E-1:0]    o_e, // 32 clocks later, as g and t0
    output reg  [`KN_KV-1:0]     o_g,
    output reg  signed [`KN_T-1:0] o_t0,
    output wire [3*(`KN_T+1)-1:0] o_share, // 38 clocks later
    output reg                   o_sat_u,
    output reg                   o_sat_tension,
    output reg                   o_sat_direction
);
    localparam W = `KN_X + 3; // width of 2 (x_j - x_i) + u_j - u_i
    reg [21:1] valid = 21'd0;
    always @(posedge clk) valid <= {valid[20:1], i_valid};

    wire [3*`KN_U-1:0] du_1, du_16;
    wire over_du_1, over_dl_19;
    knead_difference difference (.clk(clk), .i_from(i_u_i), .i_to(i_u_j), .o_d(du_1), .o_over(over_du_1));
    knead_delay #(3*`KN_U, 15) delay_du (.clk(clk), .i_value(du_1), .o_value(du_16));

    // +1 .. +4: d = x_j - x_i + (u_j - u_i)/2 and its square; +14 .. +16: e = d/|d|, clamped to 1
    wire [2:0] over_d_2;
    wire signed [35:0] square_4 [0:2];
    wire [3*`KN_E-1:0] e_16;
    wire [17:0] r_13 = i_r;
    reg [4:0] shift_14;
    always @(posedge clk) shift_14 <= 5'd18 - i_half;
    genvar k;
    generate
        for (k = 0; k < 3; k = k + 1) begin : g_component
            wire signed [`KN_X-1:0] x_i = $signed(i_x_i[k*`KN_X +: `KN_X]);
            wire signed [`KN_X-1:0] x_j = $signed(i_x_j[k*`KN_X +: `KN_X]);
            wire signed [`KN_U-1:0] u_i = $signed(i_u_i[k*`KN_U +: `KN_U]);
            wire signed [`KN_U-1:0] u_j = $signed(i_u_j[k*`KN_U +: `KN_U]);
            reg signed [W-1:0] twice_1, short_2;
            wire signed [W-1:0] rounded_1;
            wire signed [`KN_D-1:0] d_2;
            reg signed [`KN_D-1:0] d_3;
            knead_round #(W, 5) round_d (.i_value(twice_1), .i_shift(i_d_shift + 5'd1), .o_value(rounded_1));
            knead_saturate #(W, `KN_D) saturate_d (.i_value(short_2), .o_value(d_2), .o_over(over_d_2[k]));
            knead_multiply #(`KN_D, `KN_D) multiply_d (.clk(clk), .i_a(d_3), .i_b(d_3),
                                                       .o_product(square_4[k]));
            always @(posedge clk) begin
                twice_1 <= $signed({{2{x_j[`KN_X-1]}}, x_j, 1'b0}) - $signed({{2{x_i[`KN_X-1]}}, x_i, 1'b0})
                         + $signed({{(W-`KN_U){u_j[`KN_U-1]}}, u_j}) - $signed({{(W-`KN_U){u_i[`KN_U-1]}}, u_i});
                short_2 <= rounded_1;
                d_3 <= d_2;
            end

            wire signed [`KN_D-1:0] d_13;
            wire signed [`KN_D+18:0] product_14, rounded_14;
            reg signed [`KN_D+18:0] e_15;
            reg signed [`KN_E-1:0] one_16;
            knead_delay #(`KN_D, 10) delay_d (.clk(clk), .i_value(d_3), .o_value(d_13));
            knead_multiply #(`KN_D, 19) multiply_r (.clk(clk), .i_a(d_13), .i_b($signed({1'b0, r_13})),
                                                    .o_product(product_14));
            knead_round #(`KN_D+19, 5) round_e (.i_value(product_14), .i_shift(shift_14), .o_value(rounded_14));
            always @(posedge clk) begin
                e_15 <= rounded_14;
                one_16 <= e_15 > 37'sd65536 ? 18'sd65536 : e_15 < -37'sd65536 ? -18'sd65536
                        : $signed(e_15[`KN_E-1:0]);
            end
            assign e_16[k*`KN_E +: `KN_E] = one_16;
        end
    endgenerate
    reg over_d_3;
    always @(posedge clk) begin
        over_d_3 <= |over_d_2;
        o_q <= square_4[0] + square_4[1] + square_4[2]; // below 2^36
    end

    // +17 .. +22: the trial force B = kv dl + H
    localparam M = `KN_U + `KN_KV + 1;
    wire signed [`KN_U-1:0] dl_19;
    wire [`KN_KV-1:0] kv_19;
    wire signed [`KN_H-1:0] h_20;
    wire signed [`KN_T-1:0] spring_20;
    reg signed [`KN_T-1:0] spring_21;
    wire signed [M-1:0] stiff_20, shifted_20;
    reg signed [M-1:0] stiff_21;
    knead_dot dot (.clk(clk), .i_d(du_16), .i_e(e_16), .o_dl(dl_19), .o_over(over_dl_19));
    knead_delay #(`KN_KV, 19) delay_kv (.clk(clk), .i_value(i_kv), .o_value(kv_19));
    knead_delay #(`KN_H, 20) delay_h (.clk(clk), .i_value(i_h), .o_value(h_20));
    knead_round_by #(`KN_H, `KN_H_FRACTION) round_h (.i_value(h_20), .o_value(spring_20));
    knead_multiply #(`KN_U, `KN_KV+1) multiply_kv (.clk(clk), .i_a(dl_19), .i_b($signed({1'b0, kv_19})),
                                                   .o_product(stiff_20));
    knead_round #(M, 6) round_kv (.i_value(stiff_20), .i_shift(i_kv_shift), .o_value(shifted_20));
    wire signed [M:0] sum_21 = $signed({stiff_21[M-1], stiff_21})
                             + $signed({{(M+1-`KN_T){spring_21[`KN_T-1]}}, spring_21});
    wire signed [`KN_B-1:0] b_21;
    wire over_b_21;
    reg signed [`KN_B-1:0] b_22;
    knead_saturate #(M+1, `KN_B) saturate_b (.i_value(sum_21), .o_value(b_21), .o_over(over_b_21));
    always @(posedge clk) begin
        spring_21 <= spring_20;
        stiff_21 <= shifted_20;
        b_22 <= b_21;
    end

    // +30: R at the trial force
    wire [`KN_IA-1:0] ia_22;
    wire [`KN_R-1:0] r_30;
    knead_delay #(`KN_IA, 22) delay_ia (.clk(clk), .i_value(i_ia), .o_value(ia_22));
    knead_ratio ratio (.clk(clk), .i_octave(i_octave), .i_b(b_22), .i_ia(ia_22), .o_address(o_table_address),
                       .i_here(i_table_here), .i_next(i_table_next), .o_ratio(r_30));

    // +31, +32: g, t0
    wire [`KN_KV-1:0] kv_30;
    wire signed [`KN_T-1:0] spring_30;
    wire signed [`KN_KV+`KN_R+1:0] product_g_31;
    wire signed [`KN_KV+`KN_R+2-`KN_R_FRACTION:0] g_31;
    wire signed [`KN_T+`KN_R:0] product_t_31;
    wire signed [`KN_T+`KN_R+1-`KN_R_FRACTION:0] t0_31;
    knead_delay #(`KN_KV, 11) delay_kv_30 (.clk(clk), .i_value(kv_19), .o_value(kv_30));
    knead_delay #(`KN_T, 9) delay_spring (.clk(clk), .i_value(spring_21), .o_value(spring_30));
    knead_multiply #(`KN_KV+1, `KN_R+1) multiply_g (.clk(clk), .i_a($signed({1'b0, kv_30})),
                                                    .i_b($signed({1'b0, r_30})), .o_product(product_g_31));
    knead_multiply #(`KN_T, `KN_R+1) multiply_t (.clk(clk), .i_a(spring_30), .i_b($signed({1'b0, r_30})),
                                                 .o_product(product_t_31));
    knead_round_by #(`KN_KV+`KN_R+2, `KN_R_FRACTION) round_g (.i_value(product_g_31), .o_value(g_31));
    knead_round_by #(`KN_T+`KN_R+1, `KN_R_FRACTION) round_t (.i_value(product_t_31), .o_value(t0_31));
    always @(posedge clk) begin
        o_g <= g_31[`KN_KV-1:0]; // R is at most 1
        o_t0 <= t0_31[`KN_T-1:0];
    end
    knead_delay #(3*`KN_E, 16) delay_e (.clk(clk), .i_value(e_16), .o_value(o_e));
    wire unused_g = &{g_31[`KN_KV+`KN_R+2-`KN_R_FRACTION:`KN_KV], t0_31[`KN_T+`KN_R+1-`KN_R_FRACTION:`KN_T]};

    // +33 .. +38: the share of D, g |e|_1 |e_k|
    knead_share share (.clk(clk), .i_e(o_e), .i_g(o_g), .o_share(o_share));

    initial {o_sat_u, o_sat_tension, o_sat_direction} = 3'd0;
    always @(posedge clk) begin
        o_sat_u <= valid[1] & over_du_1 | valid[19] & over_dl_19;
        o_sat_tension <= valid[21] & over_b_21;
        o_sat_direction <= valid[3] & over_d_3;
    end
endmodule
`default_nettype wire
