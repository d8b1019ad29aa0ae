// Phases of the engine.
`define KN_PHASE_IDLE 4'd0
`define KN_PHASE_BEGIN 4'd1
`define KN_PHASE_BOUND 4'd2
`define KN_PHASE_SETUP 4'd3
`define KN_PHASE_INVERT 4'd4
`define KN_PHASE_EDGE 4'd5
`define KN_PHASE_NODE 4'd6
`define KN_PHASE_EDGE_COMMIT 4'd7
`define KN_PHASE_NODE_COMMIT 4'd8
`define KN_PHASE_REACTION 4'd9
`define KN_PHASE_REST_NODES 4'd10
`define KN_PHASE_REST_EDGES 4'd11
`define KN_PHASE_CRC 4'd12
