`default_nettype none
// What the small circuit looks up, one memory: at 0 nothing, OMEGA at 32, the table's last entry at 64, the seeds of
// 1/sqrt at 128 to 511, the table at 512.
module knead_nano_constants (
    input  wire        clk,
    input  wire        i_write,
    input  wire [9:0]  i_address,
    input  wire [17:0] i_data,
    output reg  [17:0] o_data
);
    reg [17:0] cells [0:1023];
    initial begin
`include "knead_nano_constants.vh"
    end
    always @(posedge clk) begin
        if (i_write) cells[i_address] <= i_data;
        o_data <= cells[i_address];
    end
endmodule
`default_nettype wire
