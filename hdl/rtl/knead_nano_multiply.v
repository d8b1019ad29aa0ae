`default_nettype none
// a b in four clocks, without a multiplier of the device's: seven bits of b at a time, the upper ones first. The
// operands stay until o_done, with which the product comes.
module knead_nano_multiply (
    input  wire               clk,
    input  wire               i_run,
    input  wire signed [26:0] i_a,
    input  wire signed [18:0] i_b,
    output wire               o_done,
    output wire signed [47:0] o_product
);
    reg [1:0] step;
    reg signed [34:0] part;
    reg signed [40:0] sum; // of the parts before
    wire signed [7:0] digit = step == 2'd0 ? $signed({{3{i_b[18]}}, i_b[18:14]})
                            : step == 2'd1 ? $signed({1'b0, i_b[13:7]}) : $signed({1'b0, i_b[6:0]});
    wire signed [34:0] a = $signed({{8{i_a[26]}}, i_a});
    wire signed [34:0] b = $signed({{27{digit[7]}}, digit});
    assign o_product = $signed({sum, 7'd0}) + $signed({{13{part[34]}}, part});
    assign o_done = step == 2'd3;
    initial step = 2'd0;
    always @(posedge clk) begin
        step <= i_run ? step + 2'd1 : 2'd0;
        part <= a * b;
        sum <= step == 2'd0 ? 41'sd0 : o_product[40:0];
    end
endmodule
`default_nettype wire
