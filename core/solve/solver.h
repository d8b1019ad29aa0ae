#ifndef KN_CORE_SOLVE_SOLVER_H
#define KN_CORE_SOLVE_SOLVER_H
// The solvers of a step, and their memory within a step. Only core includes this header; step.h is the interface for
// programs. The solver in integers has a header of its own, solver_fixed.h.
#include "core/solve/contact.h"
#include "core/solve/kernel.h"
#include "core/solve/step_effort.h"
#include <string.h>

// --- memory ---------------------------------------------------------------------------------------------------------

// Constraints and forces on the nodes during one step. The arrays belong to the caller and are indexed by node id.
typedef struct kn_boundary {
    const uint8_t *fixed;            // [nodes] bit k is set if component k is fixed: it moves with velocity_m_s
    const double (*velocity_m_s)[3]; // [nodes] velocity of the fixed components, constant over the step
    const double (*force_n)[3];      // [nodes] load and contact forces, constant over the step; NULL = none
    // [nodes] result: mean force over the step that moves the fixed components as prescribed, 0 for other components.
    // If velocity_m_s changes, the force includes m dv/dt. The force on a probe is minus the sum of these forces.
    double (*reaction_n)[3];
} kn_boundary;

typedef struct kn_rigid { // rigid motions of an object that nothing holds, see solver_implicit.c
    bool on;              // true: the preconditioner of this step uses the rigid motions
    // Vector from the centre of mass to every node, in the layout of the solver's fields. A fourth component is 1 where
    // there is a node and 0 in the padding. NULL if the model does not use the rigid motions.
    float *arm;
    double centre_m[3];  // centre of mass of the object
    double factor[6][6]; // Cholesky factor of R'AR: R maps a rigid motion to velocities, A is the step's matrix
} kn_rigid;

// Memory of the solvers within a step. It stays after the step, so that the contact of the step can be read.
struct kn_scratch {
    const kn_state *state;                        // state of the last step
    char after[offsetof(kn_state, displacement)]; // its plain members after the step, which tell it from others
    kn_work work;                                 // implicit
    kn_contact contact;
    kn_effort effort;     // implicit: effort of this step
    kn_deadline deadline; // implicit: deadline of this step
    kn_rigid rigid;       // implicit
    int *last_held;       // implicit: nodes whose velocities the last step prescribed
    int last_held_count;
    uint8_t *row_base; // implicit: one flag per row; 1: the support holds a node of the row
    // RK4: the arrays of kn_boundary
    uint8_t *fixed;
    double (*velocity)[3], (*force)[3], (*reaction)[3];
    void *stages; // RK4: memory of its stages; FIXED: memory of the integer step
};

// Return the contact of the last step of a state. NULL: the last step with this scratch was of another state, or the
// state is another one since (a copy, a snapshot, a reset).
static inline const kn_contact *kn_scratch_contact(const kn_scratch *scratch, const kn_state *state)
{
    const bool same = scratch->state == state && memcmp(scratch->after, state, sizeof scratch->after) == 0;
    return same ? &scratch->contact : NULL;
}

// Forget everything that earlier steps have left in the scratch. Real-time safe.
void kn_scratch_reset(const kn_model *model, kn_scratch *scratch);

// --- implicit solver: solver_implicit.c -----------------------------------------------------------------------------

// The linearly implicit step. The unknown is the velocity; every edge's law is linearised around the last velocity.
//
//     (M/dt + sum C n n') dv = M/dt (v_n - v*) + sum s* A n + f,   C = kappa W ds/dw > 0: always positive definite
//
// Here dv is the change of the nodes' velocities from v*, the velocity around which the laws are linearised. s* is the
// stress at v*, v_n the velocity before the step, f the outside force. The solver is conjugate gradients. Their
// preconditioner has up to three levels: 3 x 3 blocks, the rigid motions of an object that nothing holds, and a few
// coarse nodes (coarse.h). It starts from the last velocity and searches first along the last change of velocity.
// The residual that remains on a prescribed node is the force that holds the node. Every step does `iterations`
// iterations. A step does more only while the preconditioned residual exceeds `tolerance` times the largest residual of
// the last second, and never more than `iterations_max`.

// Solve for the velocities of the nodes and store them in work->guess. Store the forces of held nodes and samples. The
// kernel `integrate` moves the nodes later. Real-time safe.
void kn_solve_implicit(const kn_model *model, kn_state *state, kn_scratch *scratch, const kn_input *input,
                       kn_output *output);

// --- foundation contact in the implicit step: foundation.c ----------------------------------------------------------

// Foundation contact in the implicit step: the samples' forces at the end of the step and their stiffness in the
// matrix. Samples of one patch of the skin are stored one after the other and share the patch's nodes. The kernels
// compute the samples of a patch together, as the lanes of a vector (contact section of kernel_nodes.h).
//
// Symbols are those of contact.h. Let r be the skin's velocity at a sample, J V the tool's velocity there, and K = k n
// n' + k_side (1 - n n') the sample's stiffness. The force on the skin is f = k depth n - k_side e - dt K (r - J V). If
// sticking would leave Coulomb's cone, k_side = mu f_n/|e|. This secant keeps the matrix positive, and the end of the
// step is on the cone. The velocity V of a coupled tool is eliminated (tool.h).

// Decide by the guessed velocities which samples press. Add their forces to the residual r, and dt K to the matrix
// blocks of their nodes.
void kn_foundation_push(const kn_model *model, kn_scratch *scratch);

// Add dt K d of all samples to the product q, where d is the search direction. Return the samples' part of d.q.
double kn_foundation_apply(const kn_model *model, kn_scratch *scratch);

// Decide again, by the present guess, which samples press, slide or stick. If any decision has changed, update the
// linearised forces of all samples and the residual r. Return the number of samples whose decision has changed.
int kn_foundation_change(const kn_model *model, kn_scratch *scratch);

// From the solution, compute the final force of every sample (force_n, pressing_n) and the velocities of coupled tools.
void kn_foundation_read(const kn_model *model, kn_scratch *scratch);

// Add the resistance of all active samples to a rigid motion of the object about `centre_m`, sum dt J'KJ, to the lower
// half of `a`.
void kn_foundation_rigid(const kn_model *model, const kn_scratch *scratch, const double centre_m[3], double a[6][6]);

// --- Runge-Kutta: solver_rk4.c --------------------------------------------------------------------------------------

// The papers' own method: explicit Runge-Kutta of order 4 over positions, velocities and Voigt strains, in f64. The
// implicit step is tested against this method, and a scene may ask for it. Dough with its real mass needs steps of 2e-7
// s. So kn_model_build refuses a model whose step is longer than kn_rk4_limit; a scene may set mass_scale instead.
//
//     m x'' = sum of s gamma kappa weight L0 n  +  m g  +  f                      node
//     s + c1 g(s) = c1 w + k1 u,    u' = w - g(s),    w = L'/(gamma L0)           edge, see law.h
//
// The law of the model is built with dt = 0, so A = c1. With c1 = 0 the equations give s = k1 u. Without a damper
// (KN_LAW_VOIGT) the state does not hold u, because u = (L - L0)/(gamma L0).
//
// The inertia of a node is node_mass_kg * mass_scale, but its weight follows from node_mass_kg alone: a scaled object
// keeps its weight. The stages visit the edges in the order of the list model->edges, so every machine gives the same
// bits. There is no choice of an instruction set.

// Return the longest stable step of the object at rest, s: 2.785 divided by the fastest rate of the lattice. This rate
// is the largest of three. The first is the largest eigenvalue of C/M, with C = c1/(1 + c1/c2(0)) per edge. The second
// is the root of the largest eigenvalue of K/M, gas included. The third is the rate of the Voigt part itself. The
// object is stiffest at rest. With a step up to 20 times too long, the flowing damper bounds the instability: there is
// no NaN, but the forces are wrong. The function allocates memory while it works. Return -1 if memory is short.
double kn_rk4_limit(const kn_model *model);

// Return the bytes of scratch that a step needs, a multiple of 64.
size_t kn_rk4_scratch(const kn_model *model);

// Advance displacement, velocity and strain by def.solver.dt_s, and store boundary->reaction_n. Nothing else in the
// state changes; the caller counts the tick. The step allocates nothing and its loops are bounded. `scratch`:
// kn_rk4_scratch bytes, 8-byte aligned.
void kn_rk4_step(const kn_model *model, kn_state *state, const kn_boundary *boundary, void *scratch);

// Add the gas forces (P - P0) dV/dx of every cell to f. Each cell has its own pressure, or all cells have one pressure,
// which follows from their total volume. `rest` (rest positions, m), `x` (displacements, m) and `f` (forces, N) have 3
// values per node, in the order of node ids. The model must have a list of cells. Real-time safe.
void kn_gas_push(const kn_model *model, const double *rest, const double *x, double *f);

#endif
