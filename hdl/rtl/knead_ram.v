`default_nettype none
// A memory with one write and one read port, both clocked. A read of the cell that is being written gives the old
// value.
module knead_ram #(
    parameter WIDTH = 32,
    parameter LOG_DEPTH = 10
) (
    input  wire                 clk,
    input  wire                 i_write,
    input  wire [LOG_DEPTH-1:0] i_write_address,
    input  wire [WIDTH-1:0]     i_data,
    input  wire [LOG_DEPTH-1:0] i_address,
    output reg  [WIDTH-1:0]     o_data
);
    reg [WIDTH-1:0] cells [0:(1<<LOG_DEPTH)-1];
    always @(posedge clk) begin
        if (i_write) cells[i_write_address] <= i_data;
        o_data <= cells[i_address];
    end
`ifdef FORMAL
    (* anyconst *) wire [LOG_DEPTH-1:0] watched;
    wire [WIDTH-1:0] held = cells[watched];
`endif
endmodule
`default_nettype wire
