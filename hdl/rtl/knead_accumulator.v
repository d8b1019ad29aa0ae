`default_nettype none
// Sums of edge forces at one end of the edges: three components a node, one addition per clock to any node. Two
// additions in a row may go to the same node, because the sum just written is passed on to the next one. WIDTH is
// chosen so that no list of edges wraps a sum.
//
//     clock t      i_add or i_take, i_address, i_value
//     clock t+1    o_sum: the sum before the addition; cell := o_sum + value, or 0 if taken
module knead_accumulator #(
    parameter WIDTH = 36, // of a component of a sum
    // width of a component of an addend
    parameter VALUE = 26,
    parameter LOG_DEPTH = 10
) (
    input  wire                 clk,
    input  wire                 i_add,
    input  wire                 i_take,
    input  wire [LOG_DEPTH-1:0] i_address,
    input  wire [3*VALUE-1:0]   i_value,
    output wire [3*WIDTH-1:0]   o_sum
);
    reg write_r = 1'b0;
    reg take_r, forward_r;
    reg [LOG_DEPTH-1:0] address_r;
    reg [3*VALUE-1:0] value_r;
    reg [3*WIDTH-1:0] written_r;
    wire [3*WIDTH-1:0] cell_r;
    wire [3*WIDTH-1:0] next;

    knead_ram #(3*WIDTH, LOG_DEPTH) ram (
        .clk(clk), .i_write(write_r), .i_write_address(address_r), .i_data(next), .i_address(i_address),
        .o_data(cell_r));

    // The memory has not yet given back a sum written in the last clock: take the written value instead.
    assign o_sum = forward_r ? written_r : cell_r;
    genvar k;
    generate
        for (k = 0; k < 3; k = k + 1) begin : g_component
            wire [VALUE-1:0] value = value_r[k*VALUE +: VALUE];
            assign next[k*WIDTH +: WIDTH] = take_r ? {WIDTH{1'b0}}
                : o_sum[k*WIDTH +: WIDTH] + {{(WIDTH-VALUE){value[VALUE-1]}}, value};
        end
    endgenerate

    // Stage 1 registers: what is to be written, and whether the next read meets the cell that is written now.
    always @(posedge clk) begin
        write_r <= i_add | i_take;
        take_r <= i_take;
        address_r <= i_address;
        value_r <= i_value;
        written_r <= next;
        forward_r <= write_r && address_r == i_address;
    end
endmodule
`default_nettype wire
