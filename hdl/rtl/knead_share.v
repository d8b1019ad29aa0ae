`default_nettype none
// An edge's share of D: g |e|_1 |e_k|, 6 clocks later. |e_k| is at most 1 and |e|_1 is below 2, so 19 bits hold it.
`include "knead_formats.vh"
module knead_share (
    input  wire                   clk,
    input  wire [3*`KN_E-1:0]     i_e,
    input  wire [`KN_KV-1:0]      i_g,
    output reg  [3*(`KN_T+1)-1:0] o_share
);
    reg [3*`KN_E-1:0] size_1;
    reg [`KN_KV-1:0] g_1, g_2;
    reg [`KN_E+1:0] sum_2;
    integer n;
    always @(posedge clk) begin
        for (n = 0; n < 3; n = n + 1)
            size_1[n*`KN_E +: `KN_E] <= i_e[n*`KN_E + `KN_E - 1] ? -i_e[n*`KN_E +: `KN_E] : i_e[n*`KN_E +: `KN_E];
        sum_2 <= {2'd0, size_1[0 +: `KN_E]} + {2'd0, size_1[`KN_E +: `KN_E]} + {2'd0, size_1[2*`KN_E +: `KN_E]};
        g_1 <= i_g;
        g_2 <= g_1;
    end

    // g |e|_1, rounded to whole units, then times |e_k| of each component.
    localparam P = `KN_KV + `KN_E + 4;
    wire signed [P-1:0] product_3;
    wire signed [P-`KN_E_FRACTION:0] whole_3;
    reg signed [21:0] whole_4;
    wire [3*`KN_E-1:0] size_4;
    knead_multiply #(`KN_KV+1, `KN_E+3) multiply_sum (.clk(clk), .i_a($signed({1'b0, g_2})),
                                                      .i_b($signed({1'b0, sum_2})), .o_product(product_3));
    knead_round_by #(P, `KN_E_FRACTION) round_sum (.i_value(product_3), .o_value(whole_3));
    knead_delay #(3*`KN_E, 3) delay_size (.clk(clk), .i_value(size_1), .o_value(size_4));
    always @(posedge clk) whole_4 <= whole_3[21:0];
    wire unused = &whole_3[P-`KN_E_FRACTION:22];

    genvar k;
    generate
        for (k = 0; k < 3; k = k + 1) begin : g_component
            wire signed [21+`KN_E:0] product_5;
            wire signed [22+`KN_E-`KN_E_FRACTION:0] share_5;
            knead_multiply #(22, `KN_E) multiply_size (.clk(clk), .i_a(whole_4),
                                                       .i_b($signed(size_4[k*`KN_E +: `KN_E])), .o_product(product_5));
            knead_round_by #(22+`KN_E, `KN_E_FRACTION) round_share (.i_value(product_5), .o_value(share_5));
            always @(posedge clk)
                o_share[k*(`KN_T+1) +: `KN_T+1] <= {
                    {(`KN_T-22-`KN_E+`KN_E_FRACTION){share_5[22+`KN_E-`KN_E_FRACTION]}}, share_5};
        end
    endgenerate
endmodule
`default_nettype wire
