`default_nettype none
// Signed product, one clock later.
module knead_multiply #(
    parameter A = 25,
    parameter B = 18
) (
    input  wire                    clk,
    input  wire signed [A-1:0]     i_a,
    input  wire signed [B-1:0]     i_b,
    output reg  signed [A+B-1:0]   o_product
);
    wire signed [A+B-1:0] a = $signed({{B{i_a[A-1]}}, i_a});
    wire signed [A+B-1:0] b = $signed({{A{i_b[B-1]}}, i_b});
    always @(posedge clk) o_product <= a * b;
endmodule
`default_nettype wire
