`default_nettype none
// Three components of d = u_j - u_i, saturated, one clock later.
`include "knead_formats.vh"
module knead_difference (
    input  wire               clk,
    input  wire [3*`KN_U-1:0] i_from,
    input  wire [3*`KN_U-1:0] i_to,
    output reg  [3*`KN_U-1:0] o_d,
    output reg                o_over
);
    wire [3*`KN_U-1:0] d;
    wire [2:0] over;
    genvar k;
    generate
        for (k = 0; k < 3; k = k + 1) begin : g_component
            wire [`KN_U-1:0] from = i_from[k*`KN_U +: `KN_U];
            wire [`KN_U-1:0] to = i_to[k*`KN_U +: `KN_U];
            wire signed [`KN_U:0] wide = $signed({to[`KN_U-1], to}) - $signed({from[`KN_U-1], from});
            knead_saturate #(`KN_U+1, `KN_U) saturate (.i_value(wide), .o_value(d[k*`KN_U +: `KN_U]),
                                                       .o_over(over[k]));
        end
    endgenerate
    always @(posedge clk) begin
        o_d <= d;
        o_over <= |over;
    end
endmodule
`default_nettype wire
