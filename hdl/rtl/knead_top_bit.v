`default_nettype none
// Index of the highest bit that is set; 0 if none is.
module knead_top_bit #(
    parameter WIDTH = 36 // 64 at most
) (
    input  wire [WIDTH-1:0] i_value,
    output reg  [5:0]       o_top
);
    integer k;
    always @* begin
        o_top = 6'd0;
        for (k = 1; k < WIDTH; k = k + 1) if (i_value[k]) o_top = k[5:0];
    end
endmodule
`default_nettype wire
