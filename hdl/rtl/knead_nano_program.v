`default_nettype none
// The small circuit's program, as hdl/nano.c lays it out.
module knead_nano_program (
    input  wire        clk,
    input  wire [8:0]  i_address,
    output reg  [23:0] o_word
);
    reg [23:0] word [0:511];
    initial begin
`include "knead_nano_program.vh"
    end
    always @(posedge clk) o_word <= word[i_address];
endmodule
`default_nettype wire
