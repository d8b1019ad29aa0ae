`default_nettype none
// The boundary list. BOUND takes seven clocks a record: it holds a node and moves it, or pushes it with a force.
// REACTION takes twelve clocks a record: it writes the force of the lattice on a held node as six words.
//
//     step    0     1       2       3       4       5       6 .. 11
//     list  | ask | node  | x     | y     | z     |       |
//     BOUND                         at node         clamp | write
//     REACTION                at node | sums |+1  |+2     | words 0 .. 5
`include "knead_formats.vh"
module knead_boundary #(
    parameter LOG_NODES = 10,
    parameter LOG_LIST = 6
) (
    input  wire                  clk,
    input  wire                  i_bound, // high while a record is in BOUND
    // high while a record is in REACTION
    input  wire                  i_reaction,
    input  wire [LOG_LIST-1:0]   i_record,
    input  wire [3:0]            i_step,
    output wire [LOG_LIST+1:0]   o_list_address,
    input  wire [31:0]           i_list,
    output reg  [LOG_NODES-1:0]  o_node,
    input  wire [3*`KN_T-1:0]    i_load, // the load that the host wrote
    input  wire [2:0]            i_held,
    input  wire [3*`KN_U-1:0]    i_u,
    input  wire [3*`KN_ACC-1:0]  i_reaction_sum,
    output wire                  o_write,
    output reg  [3*`KN_T-1:0]    o_load,
    output reg  [2:0]            o_held,
    output reg  [3*`KN_U-1:0]    o_u,
    output wire                  o_result_write,
    output wire [LOG_LIST+2:0]   o_result_address,
    output wire [31:0]           o_result,
    output wire                  o_sat_u,
    output wire                  o_sat_reaction
);
    // The record: node and holds bit are read in step 1, the three values in steps 2 to 4.
    reg holds;
    assign o_list_address = {i_record, i_step[1:0]};
    always @(posedge clk) if (i_step == 4'd1) {holds, o_node} <= {i_list[31], i_list[LOG_NODES-1:0]};

    // The value is an added load of a free node, or the displacement of a held one; both saturate. Components that the
    // node's own `held` names stay where they are.
    wire [2:0] over_load, over_u;
    genvar k;
    generate
        for (k = 0; k < 3; k = k + 1) begin : g_component
            wire [`KN_T-1:0] old_load = i_load[k*`KN_T +: `KN_T];
            reg signed [31:0] value;
            always @(posedge clk) if (i_step == k[3:0] + 4'd2) value <= i_list;
            wire signed [32:0] pushes = $signed({value[31], value})
                                      + $signed({{(33-`KN_T){old_load[`KN_T-1]}}, old_load});
            wire signed [`KN_T-1:0] pushed;
            wire signed [`KN_U-1:0] moved;
            knead_saturate #(33, `KN_T) saturate_load (.i_value(pushes), .o_value(pushed), .o_over(over_load[k]));
            knead_saturate #(32, `KN_U) saturate_u (.i_value(value), .o_value(moved), .o_over(over_u[k]));
            always @(posedge clk) begin
                o_load[k*`KN_T +: `KN_T] <= holds ? old_load : pushed;
                o_u[k*`KN_U +: `KN_U] <= holds & ~i_held[k] ? moved : i_u[k*`KN_U +: `KN_U];
            end
        end
    endgenerate
    always @(posedge clk) o_held <= i_held | {3{holds}};

    assign o_write = i_bound && i_step == 4'd6;
    assign o_sat_u = i_bound && i_step == 4'd5 && holds && |(over_u & ~i_held);
    assign o_sat_reaction = i_bound && i_step == 4'd5 && !holds && |over_load;

    // Result: six words a record at address 6 record + word, low word before high word; 0 for a record that only
    // pushes.
    wire [3:0] word = i_step - 4'd6;
    wire [LOG_LIST+2:0] record = {3'd0, i_record};
    wire [`KN_ACC-1:0] sum = word[2:1] == 2'd0 ? i_reaction_sum[0 +: `KN_ACC]
                           : word[2:1] == 2'd1 ? i_reaction_sum[`KN_ACC +: `KN_ACC]
                           : i_reaction_sum[2*`KN_ACC +: `KN_ACC];
    assign o_result_write = i_reaction && i_step >= 4'd6;
    assign o_result_address = (record << 2) + (record << 1) + {{(LOG_LIST-1){1'b0}}, word};
    assign o_result = !holds ? 32'd0 : word[0] ? {{28{sum[`KN_ACC-1]}}, sum[35:32]} : sum[31:0];
endmodule
`default_nettype wire
