`default_nettype none
// A shift register: o_value is i_value of STAGES clocks ago.
module knead_delay #(
    parameter WIDTH = 1,
    parameter STAGES = 1
) (
    input  wire             clk,
    input  wire [WIDTH-1:0] i_value,
    output wire [WIDTH-1:0] o_value
);
    reg [WIDTH-1:0] line [0:STAGES-1];
    integer k;
    always @(posedge clk) begin
        line[0] <= i_value;
        for (k = 1; k < STAGES; k = k + 1) line[k] <= line[k-1];
    end
    assign o_value = line[STAGES-1];
endmodule
`default_nettype wire
