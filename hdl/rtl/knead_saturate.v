`default_nettype none
// The nearest number that OUT bits hold; o_over says that it differs from i_value.
module knead_saturate #(
    parameter IN = 43,
    parameter OUT = 25
) (
    input  wire signed [IN-1:0]  i_value,
    output wire signed [OUT-1:0] o_value,
    output wire                  o_over
);
    wire sign = i_value[IN-1];
    assign o_over = i_value[IN-1:OUT-1] != {(IN-OUT+1){sign}};
    assign o_value = o_over ? $signed({sign, {(OUT-1){~sign}}}) : $signed(i_value[OUT-1:0]);
endmodule
`default_nettype wire
