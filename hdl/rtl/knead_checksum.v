`default_nettype none
// kn_fixed_crc: CRC-32 (IEEE 802.3) of x, u and h, each as 64-bit little-endian words. One byte per clock, ten clocks a
// word.
`include "knead_formats.vh"
module knead_checksum #(
    parameter LOG_NODES = 10,
    parameter LOG_EDGES = 13
) (
    input  wire                 clk,
    input  wire                 i_run, // high in phase CRC
    input  wire [16:0]          i_node_count,
    input  wire [20:0]          i_edge_count,
    output wire [LOG_NODES-1:0] o_node,
    output wire [LOG_EDGES-1:0] o_edge,
    input  wire [3*`KN_X-1:0]   i_x, // a clock after the address, as i_u and i_h
    input  wire [3*`KN_U-1:0]   i_u,
    input  wire [`KN_H-1:0]     i_h,
    output reg                  o_done, // high for one clock
    output reg  [31:0]          o_crc
);
    reg [1:0] kind; // 0 x, 1 u, 2 h, 3 end
    reg [1:0] component;
    reg [20:0] index;
    reg [3:0] step;
    reg [63:0] word;
    reg [31:0] crc;
    assign o_node = index[LOG_NODES-1:0];
    assign o_edge = index[LOG_EDGES-1:0];

    // The component of the node that is summed now.
    wire [`KN_X-1:0] x = component == 2'd0 ? i_x[0 +: `KN_X] : component == 2'd1 ? i_x[`KN_X +: `KN_X]
                       : i_x[2*`KN_X +: `KN_X];
    wire [`KN_U-1:0] u = component == 2'd0 ? i_u[0 +: `KN_U] : component == 2'd1 ? i_u[`KN_U +: `KN_U]
                       : i_u[2*`KN_U +: `KN_U];

    wire [31:0] crc_next;
    knead_crc32 crc32 (.crc(crc), .data(word[7:0]), .next(crc_next));

    wire [20:0] count = kind == 2'd2 ? i_edge_count : {4'd0, i_node_count};
    wire ends = index == count; // the last item of this kind is done
    wire word_ends = step == 4'd9;
    wire item_ends = word_ends && (kind == 2'd2 || component == 2'd2);
    // Step 0 reads the item, step 1 loads its word, steps 2 to 9 feed the eight bytes to the CRC.
    always @(posedge clk) begin
        o_done <= 1'b0;
        if (!i_run || o_done) begin
            kind <= 2'd0;
            component <= 2'd0;
            index <= 21'd0;
            step <= 4'd0;
            crc <= 32'hffffffff;
        end else if (kind == 2'd3) begin
            o_done <= 1'b1;
            o_crc <= ~crc;
        end else if (ends) begin
            kind <= kind + 2'd1;
            index <= 21'd0;
        end else begin
            step <= word_ends ? 4'd0 : step + 4'd1;
            if (word_ends) component <= item_ends ? 2'd0 : component + 2'd1;
            if (item_ends) index <= index + 21'd1;
            if (step >= 4'd2) crc <= crc_next;
            if (step == 4'd1)
                word <= kind == 2'd0 ? {{(64-`KN_X){x[`KN_X-1]}}, x} : kind == 2'd1 ? {{(64-`KN_U){u[`KN_U-1]}}, u}
                      : {{(64-`KN_H){i_h[`KN_H-1]}}, i_h};
            else word <= {8'd0, word[63:8]};
        end
    end
endmodule
`default_nettype wire
