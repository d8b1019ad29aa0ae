#ifndef KN_CORE_SOLVER_IMPLICIT_H
#define KN_CORE_SOLVER_IMPLICIT_H
// The linearly implicit step. The unknown is the velocity; every edge's law is linearised around the last velocity.
//
//     (M/dt + sum C n n') dv = M/dt (v_n - v*) + sum s* A n + f,   C = kappa W ds/dw > 0: always positive definite
//
// Here dv is the change of the nodes' velocities from v*, the velocity around which the laws are linearised. s* is the
// stress at v*, v_n the velocity before the step, f the outside force. The solver is conjugate gradients with a 3x3
// block-Jacobi preconditioner. It starts from the last velocity and searches first along the last change of velocity.
// The residual that remains on a prescribed node is the force that holds the node. Every step does `iterations`
// iterations. A step does more only while the preconditioned residual exceeds `tolerance` times the largest residual of
// the last second, and never more than `iterations_max`.
#include "core/scratch.h"

// Solve for the velocities and store them in work->guess. Store the forces in the contact's holds and samples.
// Displacements do not change yet.
void kn_solve_implicit(const kn_model *model, kn_state *state, const kn_input *input, kn_output *output);

// Advance displacements and velocities to the solution.
void kn_advance_implicit(const kn_model *model, kn_state *state);

#endif
