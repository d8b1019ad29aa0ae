`default_nettype none
// kn_fixed_rsqrt: 1/sqrt(q) = r 2^(half - 34), 8 clocks later; accepts one q per clock. For q = 0: r = 0, half = 0.
//     y = q 2^(2 half) in 2^34 .. 2^36;   r0 = seed[y's 9 leading bits];   r = r0 (3 - y r0^2)/2
module knead_rsqrt (
    input  wire        clk,
    input  wire [35:0] i_q,
    output reg  [17:0] o_r,
    output wire [4:0]  o_half
);
    // y: shift q left by an even number of bits
    wire [5:0] top;
    knead_top_bit #(36) find_top (.i_value(i_q), .o_top(top));
    wire [5:0] spare = 6'd35 - top;
    wire [5:0] n = {spare[5:1], 1'b0};
    reg [35:0] y_1;
    reg [4:0] half_1;
    reg any_1;
    always @(posedge clk) begin
        y_1 <= i_q << n;
        any_1 <= i_q != 36'd0;
        half_1 <= i_q != 36'd0 ? spare[5:1] : 5'd0;
    end
    wire unused = &{spare[0], y_1[17:0]};

    // r0: the seed of the leading bits
    reg [16:0] seed [0:511];
    initial begin
`include "knead_seeds.vh"
    end
    reg [16:0] r_2;
    always @(posedge clk) r_2 <= seed[y_1[35:27]];

    // rest = 3 - y r0^2; the last shift halves it
    wire signed [35:0] square_3;
    knead_multiply #(18, 18) multiply_square (.clk(clk), .i_a({1'b0, r_2}), .i_b({1'b0, r_2}),
                                              .o_product(square_3));
    wire signed [20:0] rounded_3;
    knead_round_by #(36, 16) round_square (.i_value(square_3), .o_value(rounded_3));
    reg signed [18:0] square_4;
    wire unused_square = &rounded_3[20:19]; // r0 < 2^17
    always @(posedge clk) square_4 <= $signed(rounded_3[18:0]);

    wire [17:0] y_4;
    knead_delay #(18, 3) delay_y (.clk(clk), .i_value(y_1[35:18]), .o_value(y_4));
    wire signed [37:0] product_5;
    knead_multiply #(19, 19) multiply_y (.clk(clk), .i_a($signed({1'b0, y_4})), .i_b(square_4),
                                         .o_product(product_5));
    wire signed [37:0] gap_5 = 38'sd51539607552 - product_5; // 3 2^34
    wire signed [21:0] rounded_5;
    knead_round_by #(38, 17) round_rest (.i_value(gap_5), .o_value(rounded_5));
    reg signed [21:0] rest_6;
    always @(posedge clk) rest_6 <= rounded_5;

    // r = r0 rest
    wire [16:0] r_6;
    knead_delay #(17, 4) delay_r (.clk(clk), .i_value(r_2), .o_value(r_6));
    wire signed [39:0] product_7;
    knead_multiply #(22, 18) multiply_r (.clk(clk), .i_a(rest_6), .i_b($signed({1'b0, r_6})),
                                         .o_product(product_7));
    wire signed [22:0] rounded_7;
    knead_round_by #(40, 18) round_r (.i_value(product_7), .o_value(rounded_7));
    wire unused_r = &rounded_7[22:18];
    wire any_7;
    knead_delay #(1, 6) delay_any (.clk(clk), .i_value(any_1), .o_value(any_7));
    always @(posedge clk) o_r <= any_7 ? rounded_7[17:0] : 18'd0;
    knead_delay #(5, 7) delay_half (.clk(clk), .i_value(half_1), .o_value(o_half));
endmodule
`default_nettype wire
