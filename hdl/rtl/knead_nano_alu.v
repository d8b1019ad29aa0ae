`default_nettype none
// The small circuit's two registers and what is done to them; hdl/nano.c says what each operation is. i_execute is high
// from the clock in which the operand is there until o_done.
`include "knead_formats.vh"
`include "knead_nano.vh"
module knead_nano_alu (
    input  wire               clk,
    input  wire               i_execute,
    input  wire [4:0]         i_op,
    input  wire [3:0]         i_from,
    input  wire [5:0]         i_immediate,
    input  wire               i_unsigned,
    input  wire               i_pred,
    input  wire [35:0]        i_word, // of memory
    input  wire [18:0]        i_setting, // beta, relax
    input  wire [5:0]         i_kv_shift,
    input  wire [5:0]         i_beta_shift,
    input  wire [4:0]         i_d_shift,
    input  wire [6:0]         i_octave,
    input  wire               i_clear, // a tick begins
    output wire               o_done, // in this clock
    output wire [35:0]        o_stored,
    output wire               o_write,
    output wire [8:0]         o_seed, // of 1/sqrt
    output wire [9:0]         o_place, // in the table
    output reg  [6:0]         o_flags, // KN_FIXED_SAT_*
    output reg  [`KN_ACC-1:0] o_residual,
    output reg  [15:0]        o_ends,
    output reg  [7:0]         o_node, // of the boundary list's record
    output reg  [31:0]        o_crc,
    input  wire               i_crc_clear
);
    reg signed [47:0] a, b;
    reg [6:0] count;
    reg p, holds;
    reg [2:0] step;
    reg [9:0] place;
    reg [10:0] way;

    wire is_way = i_from == `KN_FROM_WAY;
    wire is_setting = i_from == `KN_FROM_BETA || i_from == `KN_FROM_RELAX;
    wire sign = i_word[35] && !i_unsigned;
    wire signed [47:0] m = $signed({{12{sign}}, i_word});
    wire here = !(i_pred && p);
    wire [3:0] bits = i_word[3:0];
    wire bit_ = bits[i_immediate[1:0]];

    // --- sums -----------------------------------------------------------------------------------------------------

    reg signed [47:0] left, right;
    reg minus;
    always @* begin
        left = a;
        right = m;
        minus = 1'b0;
        case (i_op)
            `KN_OP_LOAD: left = 48'sd0;
            `KN_OP_SUB: minus = 1'b1;
            `KN_OP_DOUBLE: right = a;
            `KN_OP_MAGNITUDE: begin left = 48'sd0; right = a; minus = a[47]; end
            `KN_OP_THREE: begin left = 48'sh0000c_0000_0000; right = a; minus = 1'b1; end
            `KN_OP_ADD_B: right = b;
            `KN_OP_SUB_B: begin right = b; minus = 1'b1; end
            `KN_OP_LOAD_B: begin left = 48'sd0; right = b; end
            default: ;
        endcase
    end
    wire signed [47:0] sum = left + (right ^ {48{minus}}) + $signed({47'd0, minus});

    // --- products -------------------------------------------------------------------------------------------------

    wire multiplies = i_op == `KN_OP_MULTIPLY;
    wire product_done;
    wire signed [47:0] product;
    wire signed [18:0] factor = $signed(is_way ? {8'd0, way} : is_setting ? i_setting : i_word[18:0]);
    knead_nano_multiply multiply (.clk(clk), .i_run(i_execute && multiplies && !product_done), .i_a(a[26:0]),
                                  .i_b(factor), .o_done(product_done), .o_product(product));

    // --- shifts ---------------------------------------------------------------------------------------------------

    reg [5:0] shift; // while the operand is fetched
    always @(posedge clk) begin
        case (i_from[2:0])
            3'd1: shift <= i_kv_shift;
            3'd2: shift <= i_beta_shift;
            3'd3: shift <= {1'b0, i_d_shift} + 6'd1;
            3'd4: shift <= count[5:0];
            3'd5: shift <= 6'd18 - {1'b0, count[5:1]};
            default: shift <= i_immediate;
        endcase
    end
    wire signed [48:0] floor = $signed({a, 1'b0}) >>> shift;
    wire signed [48:0] nearest = floor + $signed({48'd0, !i_unsigned});
    wire unused = nearest[0];

    // --- limits ---------------------------------------------------------------------------------------------------

    wire over_18 = a[47:17] != {31{a[47]}};
    wire over_25 = a[47:24] != {24{a[47]}};
    wire over_36 = a[47:35] != {13{a[47]}};
    wire over = i_from[1:0] == 2'd0 ? over_18 : i_from[1:0] == 2'd1 ? over_25 : over_36;
    reg signed [47:0] most;
    always @* begin
        most = 48'sh0000_0001_ffff;
        if (i_from[0]) most = 48'sh0000_00ff_ffff;
        if (i_from[1]) most = 48'sh0007_ffff_ffff;
    end
    wire [47:0] limit = most ^ {48{a[47]}};
    wire beyond_one = a > 48'sd65536 || a < -48'sd65536;

    // --- leading bits ---------------------------------------------------------------------------------------------

    wire norms = i_op == `KN_OP_NORM || i_op == `KN_OP_NORM2;
    wire [35:0] normed;
    wire [5:0] places;
    knead_nano_norm norm (.i_value(a[35:0]), .i_step(step), .i_even(i_op == `KN_OP_NORM2), .o_value(normed),
                          .o_places(places));
    wire begins = step == 3'd0 && (i_op == `KN_OP_NORM2 || i_immediate[0]);
    // the key's octave: 53 - count - i_octave
    wire signed [8:0] octave = 9'sd53 - $signed({2'd0, count}) - $signed({{2{i_octave[6]}}, i_octave});
    wire below = octave[8] || !a[35];
    wire above = !octave[8] && octave[7:4] != 4'd0;
    wire signed [7:0] inverse_shift = 8'sd52 - $signed({1'b0, count}) - $signed({2'd0, i_kv_shift});

    // --- checksum -------------------------------------------------------------------------------------------------

    wire sums = i_op == `KN_OP_CRC;
    wire [7:0] byte_ = a[7:0];
    wire [31:0] crc_next;
    knead_crc32 crc32 (.crc(o_crc), .data(byte_), .next(crc_next));

    assign o_done = i_execute && (multiplies ? product_done : norms ? step == 3'd5 : sums ? step == 3'd7 : 1'b1);
    assign o_seed = a[35:27];
    assign o_place = place + {9'd0, i_from == `KN_FROM_NEXT};
    assign o_write = i_execute && here && (i_op == `KN_OP_STORE || i_op == `KN_OP_FILL || i_op == `KN_OP_INVERSE);
    assign o_stored = i_op == `KN_OP_FILL ? {36{i_immediate[0]}}
                    : i_op == `KN_OP_INVERSE ? {11'd0, inverse_shift[7] ? 6'd0 : inverse_shift[5:0], 1'b0, a[17:0]}
                    : a[35:0];

    initial step = 3'd0;
    always @(posedge clk) begin
        step <= i_execute && (norms || sums) && !o_done ? step + 3'd1 : 3'd0;
        if (i_execute) case (i_op)
            `KN_OP_LOAD, `KN_OP_ADD, `KN_OP_SUB, `KN_OP_DOUBLE, `KN_OP_MAGNITUDE, `KN_OP_THREE, `KN_OP_ADD_B,
                `KN_OP_SUB_B, `KN_OP_LOAD_B: a <= sum;
            `KN_OP_MULTIPLY: if (product_done) a <= product;
            `KN_OP_ROUND: a <= nearest[48:1];
            `KN_OP_SATURATE: if (over) a <= $signed(limit);
            `KN_OP_CLAMP: if (beyond_one) a <= a[47] ? -48'sd65536 : 48'sd65536;
            `KN_OP_NORM, `KN_OP_NORM2: a <= $signed({12'd0, normed});
            `KN_OP_CRC: a <= a >>> 8;
            default: ;
        endcase
        if (i_execute && i_op == `KN_OP_KEEP) b <= a;
        if (i_execute && norms) count <= (begins ? 7'd0 : count) + {1'b0, places};
        if (i_execute && multiplies && i_from == `KN_FROM_NODE) count <= {1'b0, i_word[24:19]};
        if (i_execute && i_op == `KN_OP_TABLE) begin
            place <= below ? 10'd0 : above ? 10'd512 : {1'b0, octave[3:0], a[34:30]};
            way <= below || above ? 11'd0 : a[29:19];
        end
        if (i_execute && i_op == `KN_OP_ENDS) o_ends <= i_word[34:19];
        if (i_execute && i_op == `KN_OP_RECORD) {holds, o_node} <= {i_word[31], i_word[7:0]};
        if (i_execute && i_op == `KN_OP_PRED) case (i_immediate[3:2])
            2'd0: p <= bit_;
            2'd1: p <= holds;
            2'd2: p <= !holds;
            default: p <= !holds || bit_;
        endcase
        if (i_clear) o_residual <= {`KN_ACC{1'b0}};
        else if (i_execute && i_op == `KN_OP_RESIDUAL && here && a[`KN_ACC-1:0] > o_residual)
            o_residual <= a[`KN_ACC-1:0];
        if (i_crc_clear) o_crc <= 32'hffffffff;
        else if (i_execute && sums) o_crc <= crc_next;
        o_flags <= i_execute && i_op == `KN_OP_SATURATE && over && here ? 7'd1 << i_immediate[2:0] : 7'd0;
    end
    wire unused_shift = inverse_shift[6];
endmodule
`default_nettype wire
