`default_nettype none
// Memories as words: give one word of the record that was read, and the record with that word replaced by i_data. Each
// assignment does both: {the record's part, the word} = {i_data, the part as it was}.
`include "knead_formats.vh"
module knead_windows #(
    parameter LOG_NODES = 10
) (
    input  wire [3:0]            i_word, // index of the word in the record
    input  wire [31:0]           i_data,
    input  wire                  i_rest, // the rest position instead of x
    input  wire [3*`KN_X-1:0]    i_x,
    input  wire [3*`KN_X-1:0]    i_x_rest,
    input  wire [3*`KN_U-1:0]    i_u,
    input  wire [3*`KN_T-1:0]    i_load,
    input  wire [2:0]            i_held,
    input  wire [2*LOG_NODES+`KN_KV+`KN_IA-1:0] i_edge, // ia, kv, j, i
    input  wire [`KN_H-1:0]      i_h,
    output reg  [3*`KN_X-1:0]    o_x, // x, or the rest position
    output reg  [3*`KN_U-1:0]    o_u,
    output reg  [3*`KN_T-1:0]    o_load,
    output reg  [2:0]            o_held,
    output reg  [2*LOG_NODES+`KN_KV+`KN_IA-1:0] o_edge,
    output reg  [`KN_H-1:0]      o_h,
    output reg  [31:0]           o_node_word,
    output reg  [31:0]           o_edge_word
);
    localparam KV = 2*LOG_NODES;
    localparam IA = KV + `KN_KV;
    wire [3*`KN_X-1:0] x = i_rest ? i_x_rest : i_x;
    integer k;
    always @* begin
        o_x = x;
        o_u = i_u;
        o_load = i_load;
        o_held = i_word == 4'd6 ? i_data[2:0] : i_held;
        o_node_word = i_word == 4'd6 ? {29'd0, i_held} : 32'd0;
        for (k = 0; k < 3; k = k + 1) begin
            if (i_word == 2*k[3:0]) {o_x[`KN_X*k +: 32], o_node_word} = {i_data, x[`KN_X*k +: 32]};
            if (i_word == 2*k[3:0] + 4'd1)
                {o_x[`KN_X*k + 32 +: `KN_X-32], o_node_word}
                    = {i_data[`KN_X-33:0], {(64-`KN_X){x[`KN_X*k+`KN_X-1]}}, x[`KN_X*k + 32 +: `KN_X-32]};
            if (i_word == k[3:0] + 4'd7)
                {o_u[`KN_U*k +: `KN_U], o_node_word}
                    = {i_data[`KN_U-1:0], {(32-`KN_U){i_u[`KN_U*k+`KN_U-1]}}, i_u[`KN_U*k +: `KN_U]};
            if (i_word == k[3:0] + 4'd10)
                {o_load[`KN_T*k +: `KN_T], o_node_word}
                    = {i_data[`KN_T-1:0], {(32-`KN_T){i_load[`KN_T*k+`KN_T-1]}}, i_load[`KN_T*k +: `KN_T]};
        end
    end
    always @* begin
        o_edge = i_edge;
        o_h = i_h;
        o_edge_word = 32'd0;
        case (i_word[2:0])
            3'd0: begin
                {o_edge[LOG_NODES-1:0], o_edge_word[LOG_NODES-1:0]} = {i_data[LOG_NODES-1:0], i_edge[LOG_NODES-1:0]};
                {o_edge[LOG_NODES +: LOG_NODES], o_edge_word[16 +: LOG_NODES]}
                    = {i_data[16 +: LOG_NODES], i_edge[LOG_NODES +: LOG_NODES]};
            end
            3'd1: {o_edge[KV +: `KN_KV], o_edge_word[`KN_KV-1:0]} = {i_data[`KN_KV-1:0], i_edge[KV +: `KN_KV]};
            3'd2: {o_edge[IA +: `KN_IA], o_edge_word[`KN_IA-1:0]} = {i_data[`KN_IA-1:0], i_edge[IA +: `KN_IA]};
            3'd3: {o_h[31:0], o_edge_word} = {i_data, i_h[31:0]};
            3'd4: {o_h[`KN_H-1:32], o_edge_word}
                = {i_data[`KN_H-33:0], {(64-`KN_H){i_h[`KN_H-1]}}, i_h[`KN_H-1:32]};
            default: ;
        endcase
    end
endmodule
`default_nettype wire
