`default_nettype none
// relax/D of a component as mantissa and shift, one per clock: z = r inverse / 2^shift. The 1/sqrt unit is shared with
// SETUP: q leaves one clock after D, r and half arrive 8 clocks after q, and the result is there 13 clocks after D.
`include "knead_formats.vh"
module knead_invert (
    input  wire                 clk,
    input  wire [5:0]           i_kv_shift,
    input  wire [`KN_RELAX-1:0] i_relax,
    input  wire [35:0]          i_d,
    output reg  [35:0]          o_q,
    input  wire [17:0]          i_r,
    input  wire [4:0]           i_half,
    output reg  [`KN_INV-1:0]   o_inverse,
    output reg  [5:0]           o_shift
);
    // 1/D is the square of 1/sqrt(D); relax multiplies its mantissa.
    wire signed [37:0] square_10;
    wire signed [22:0] mantissa_10;
    reg signed [19:0] mantissa_11;
    wire signed [37:0] product_12;
    wire signed [38-`KN_RELAX_FRACTION:0] inverse_12;
    knead_multiply #(19, 19) multiply_r (.clk(clk), .i_a($signed({1'b0, i_r})), .i_b($signed({1'b0, i_r})),
                                         .o_product(square_10));
    knead_round_by #(38, 16) round_mantissa (.i_value(square_10), .o_value(mantissa_10));
    knead_multiply #(20, `KN_RELAX+1) multiply_relax (.clk(clk), .i_a(mantissa_11),
                                                      .i_b($signed({1'b0, i_relax})), .o_product(product_12));
    knead_round_by #(38, `KN_RELAX_FRACTION) round_inverse (.i_value(product_12), .o_value(inverse_12));

    // The shift collects the exponents of r^2 and of kv; it stops at 0.
    reg signed [7:0] shift_10;
    reg [5:0] shift_11;
    wire [5:0] shift_12;
    knead_delay #(6, 1) delay_shift (.clk(clk), .i_value(shift_11), .o_value(shift_12));
    always @(posedge clk) begin
        o_q <= i_d;
        mantissa_11 <= mantissa_10[19:0]; // at most 2^18
        o_inverse <= inverse_12[`KN_INV-1:0];
        shift_10 <= 8'sd52 - $signed({2'd0, i_half, 1'b0}) - $signed({2'd0, i_kv_shift});
        shift_11 <= shift_10[7] ? 6'd0 : shift_10[5:0];
        o_shift <= shift_12;
    end
    wire unused = &{mantissa_10[22:20], inverse_12[38-`KN_RELAX_FRACTION:`KN_INV], shift_10[6]};
endmodule
`default_nettype wire
