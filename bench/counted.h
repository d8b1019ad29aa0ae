#ifndef KN_BENCH_COUNTED_H
#define KN_BENCH_COUNTED_H
// Count the work of the loops of a block's step by running them. counted.c is core/solve/kernel_grid.c itself with
// a counter in every operation on 16 lanes, so it always agrees with the code.
//
// An operation is one vector instruction of the arithmetic pipes for each lane. Add, subtract, multiply, divide,
// root, minimum and fused multiply-add count one each; comparing and choosing count two. Flops follow textbooks: a
// fused operation two, minimum and choice none. Moves, rotations, table look-ups and the scalar sums are not counted.
// Bytes are the distinct 64-byte lines of the state that a loop touches, once per loop: the data that must come from
// the state's memory level.
#include "core/state.h"
#include "core/step.h"

typedef struct counted { // over the whole lattice, including padding
    double operations, flops, bytes;
} counted;

// Run one step from `state` under `input` with the counting loops. Return the counts of its edge pass, and of its
// last iteration (product and update). The model must be a block's with KN_ISA_BASE; its loops are exchanged.
void counted_step_f32(kn_model *model, kn_state *state, const kn_input *input, counted *edge, counted *iteration);
void counted_step_f64(kn_model *model, kn_state *state, const kn_input *input, counted *edge, counted *iteration);

#endif
