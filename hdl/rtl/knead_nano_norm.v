`default_nettype none
// A clock of six of NORM: by 32, 16, .. 1 places to the left if nothing is lost, so that bit 35 is set in the end, or
// (i_even) one of 35 and 34 by an even count.
module knead_nano_norm (
    input  wire [35:0] i_value,
    input  wire [2:0]  i_step, // 0: by 32
    input  wire        i_even,
    output reg  [35:0] o_value,
    output wire [5:0]  o_places
);
    wire [5:0] places = 6'd32 >> i_step;
    reg spare;
    always @* begin
        case (i_step)
            3'd0: spare = i_value[35:4] == 32'd0;
            3'd1: spare = i_value[35:20] == 16'd0;
            3'd2: spare = i_value[35:28] == 8'd0;
            3'd3: spare = i_value[35:32] == 4'd0;
            3'd4: spare = i_value[35:34] == 2'd0;
            default: spare = !i_value[35] && !i_even;
        endcase
        o_value = i_value;
        if (spare) case (i_step)
            3'd0: o_value = {i_value[3:0], 32'd0};
            3'd1: o_value = {i_value[19:0], 16'd0};
            3'd2: o_value = {i_value[27:0], 8'd0};
            3'd3: o_value = {i_value[31:0], 4'd0};
            3'd4: o_value = {i_value[33:0], 2'd0};
            default: o_value = {i_value[34:0], 1'd0};
        endcase
    end
    assign o_places = spare ? places : 6'd0;
endmodule
`default_nettype wire
