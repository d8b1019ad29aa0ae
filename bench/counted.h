#ifndef KN_BENCH_COUNTED_H
#define KN_BENCH_COUNTED_H
// What the loops of a block's step do, counted by running them: counted.c is core/kernel.c itself with a counter in
// every operation on 16 lanes, so it can not lag behind the code.
//
// An operation is one vector instruction of the arithmetic pipes for each lane: add, subtract, multiply, divide, root,
// minimum, fused multiply-add, each one; comparing and choosing, two. A flop is that of any book: a fused operation
// two, minimum and choice none. Moves, rotations, table look-ups and the scalar sums are not counted. Bytes are the
// distinct 64-byte lines of the state that a loop touches, once per loop: what has to come from where the state lives.
#include "core/state.h"
#include "core/step.h"

typedef struct counted { // over the whole lattice, padding too
    double operations, flops, bytes;
} counted;

// One step from `state` under `input` with the counting loops: those of its edge pass, and of its last iteration
// (product and update). The model is a block's with KN_ISA_BASE; its loops are exchanged.
void counted_step_f32(kn_model *model, kn_state *state, const kn_input *input, counted *edge, counted *iteration);
void counted_step_f64(kn_model *model, kn_state *state, const kn_input *input, counted *edge, counted *iteration);

#endif
