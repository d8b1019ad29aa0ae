`default_nettype none
// value / 2^BY to the nearest, halves up, for a constant BY: the floor plus the bit below it.
module knead_round_by #(
    parameter WIDTH = 43,
    parameter BY = 16
) (
    input  wire signed [WIDTH-1:0]  i_value,
    output wire signed [WIDTH-BY:0] o_value
);
    assign o_value = $signed({i_value[WIDTH-1], i_value[WIDTH-1:BY]}) + $signed({{(WIDTH-BY){1'b0}}, i_value[BY-1]});
    generate
        if (BY > 1) begin : g_low
            wire unused = &i_value[BY-2:0];
        end
    endgenerate
endmodule
`default_nettype wire
