`default_nettype none
// Change of length dl = e.d: three products, their sum, rounded and saturated. 3 clocks later; accepts one edge per
// clock.
`include "knead_formats.vh"
module knead_dot (
    input  wire                     clk,
    input  wire [3*`KN_U-1:0]       i_d,
    input  wire [3*`KN_E-1:0]       i_e,
    output reg  signed [`KN_U-1:0]  o_dl,
    output reg                      o_over
);
    localparam P = `KN_U + `KN_E;
    wire signed [P-1:0] product [0:2];
    genvar k;
    generate
        for (k = 0; k < 3; k = k + 1) begin : g_component
            knead_multiply #(`KN_U, `KN_E) multiply (.clk(clk), .i_a($signed(i_d[k*`KN_U +: `KN_U])),
                                                     .i_b($signed(i_e[k*`KN_E +: `KN_E])), .o_product(product[k]));
        end
    endgenerate
    reg signed [P+1:0] sum;
    always @(posedge clk)
        sum <= $signed({{2{product[0][P-1]}}, product[0]}) + $signed({{2{product[1][P-1]}}, product[1]})
             + $signed({{2{product[2][P-1]}}, product[2]});

    wire signed [P+2-`KN_E_FRACTION:0] rounded;
    wire signed [`KN_U-1:0] dl;
    wire over;
    knead_round_by #(P+2, `KN_E_FRACTION) round (.i_value(sum), .o_value(rounded));
    knead_saturate #(P+3-`KN_E_FRACTION, `KN_U) saturate (.i_value(rounded), .o_value(dl), .o_over(over));
    always @(posedge clk) begin
        o_dl <= dl;
        o_over <= over;
    end
endmodule
`default_nettype wire
