`default_nettype none
// R(|B| ia) from a table of 16 octaves of 32 segments. The key's exponent and five bits choose the segment; eleven more
// bits interpolate along it; both ends clamp. The table is outside this module: its address leaves 4 clocks after B,
// and its two cells arrive a clock after that. 8 clocks in all.
`include "knead_formats.vh"
module knead_ratio (
    input  wire                      clk,
    input  wire [6:0]                i_octave,
    input  wire signed [`KN_B-1:0]   i_b,
    input  wire [`KN_IA-1:0]         i_ia, // in the clock of B
    output reg  [9:0]                o_address, // index of the segment
    input  wire [`KN_R-1:0]          i_here, // the segment's two ends, one clock after o_address
    input  wire [`KN_R-1:0]          i_next,
    output reg  [`KN_R-1:0]          o_ratio
);
    // +1: |B|
    reg [`KN_B-1:0] size_1;
    wire [`KN_IA-1:0] ia_2;
    knead_delay #(`KN_IA, 2) delay_ia (.clk(clk), .i_value(i_ia), .o_value(ia_2));
    always @(posedge clk) size_1 <= i_b[`KN_B-1] ? -i_b : i_b;

    // +2: the 18 leading bits of |B|
    wire [5:0] top_1;
    knead_top_bit #(`KN_B) find_size (.i_value(size_1), .o_top(top_1));
    wire [`KN_B-1:0] leading_1 = size_1 << (6'd35 - top_1);
    reg [17:0] mantissa_2;
    reg [5:0] top_2;
    reg zero_2;
    always @(posedge clk) begin
        mantissa_2 <= leading_1[`KN_B-1 -: 18];
        top_2 <= top_1;
        zero_2 <= size_1 == {`KN_B{1'b0}};
    end

    // +3: the key |B| ia
    wire signed [36:0] key_3;
    reg [5:0] top_3;
    reg zero_3;
    knead_multiply #(19, 18) multiply_ia (.clk(clk), .i_a($signed({1'b0, mantissa_2})),
                                          .i_b($signed({1'b0, ia_2})), .o_product(key_3));
    always @(posedge clk) begin
        top_3 <= top_2;
        zero_3 <= zero_2;
    end

    // +4: the segment, and the fraction along it
    wire [5:0] place_3;
    knead_top_bit #(35) find_key (.i_value(key_3[34:0]), .o_top(place_3));
    wire [34:0] fraction_3 = key_3[34:0] << (6'd34 - place_3);
    wire signed [8:0] octave_3 = $signed({3'd0, place_3}) + $signed({3'd0, top_3}) - 9'sd17
                               - $signed({{2{i_octave[6]}}, i_octave});
    wire below_3 = octave_3[8] | zero_3;
    wire above_3 = !octave_3[8] && octave_3[7:4] != 4'd0;
    reg [10:0] way_4;
    always @(posedge clk) begin
        o_address <= below_3 ? 10'd0 : above_3 ? 10'd512 : {1'b0, octave_3[3:0], fraction_3[33:29]};
        way_4 <= below_3 | above_3 ? 11'd0 : fraction_3[28:18];
    end

    // +6 .. +8: interpolate between the two ends
    wire signed [18:0] here_5 = $signed({1'b0, i_here});
    reg signed [18:0] slope_6;
    wire [10:0] way_6;
    wire signed [30:0] product_7;
    wire signed [20:0] rounded_7;
    wire [`KN_R-1:0] here_7;
    knead_delay #(11, 2) delay_way (.clk(clk), .i_value(way_4), .o_value(way_6));
    knead_delay #(`KN_R, 2) delay_here (.clk(clk), .i_value(i_here), .o_value(here_7));
    knead_multiply #(19, 12) multiply_way (.clk(clk), .i_a(slope_6), .i_b($signed({1'b0, way_6})),
                                           .o_product(product_7));
    knead_round_by #(31, 11) round_way (.i_value(product_7), .o_value(rounded_7));
    always @(posedge clk) begin
        slope_6 <= $signed({1'b0, i_next}) - here_5;
        o_ratio <= here_7 + rounded_7[`KN_R-1:0];
    end
    wire unused = &{leading_1[`KN_B-19:0], key_3[36:35], fraction_3[34], fraction_3[17:0], rounded_7[20:18]};
endmodule
`default_nettype wire
