`default_nettype none
// value / 2^shift to the nearest, halves up: round_shift of core/fixed.c. floor((v + 2^(s-1))/2^s) equals
// (floor(2 v/2^s) + 1)/2, which needs no wider sum and also holds for s = 0.
module knead_round #(
    parameter WIDTH = 43,
    parameter SHIFT = 6
) (
    input  wire signed [WIDTH-1:0] i_value,
    input  wire        [SHIFT-1:0] i_shift,
    output wire signed [WIDTH-1:0] o_value
);
    wire signed [WIDTH:0] floor = $signed({i_value, 1'b0}) >>> i_shift;
    wire signed [WIDTH:0] next = floor + $signed({{WIDTH{1'b0}}, 1'b1});
    assign o_value = next[WIDTH:1];
    wire unused = next[0];
endmodule
`default_nettype wire
