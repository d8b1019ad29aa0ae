#ifndef KN_CORE_SOLVER_IMPLICIT_H
#define KN_CORE_SOLVER_IMPLICIT_H
// The linearly implicit step: unknown is the velocity, every edge's law linearised around the last one.
//
//     (M/dt + sum C n n') dv = M/dt (v_n - v*) + sum s* A n + f,   C = kappa W ds/dw > 0: always positive definite
//
// solved by conjugate gradients with 3x3 block-Jacobi, warm-started by the last velocity itself, and first along its
// last change. What is left on a prescribed node is the force that holds it. Every step gets `iterations`, more only
// while the preconditioned residual exceeds `tolerance` of the largest of the recent second, never more than
// `iterations_max`.
#include "core/scratch.h"

// Velocities into work->guess; forces into the contact's holds and samples. Displacements do not move yet.
void kn_solve_implicit(const kn_model *model, kn_state *state, const kn_input *input, kn_output *output);

// Displacements and velocities take the solution.
void kn_advance_implicit(const kn_model *model, kn_state *state);

#endif
