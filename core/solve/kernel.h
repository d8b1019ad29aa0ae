#ifndef KN_CORE_SOLVE_KERNEL_H
#define KN_CORE_SOLVE_KERNEL_H
// The hot loops of the implicit step: kernel_grid.c for a grid, kernel_net.c for any lattice. They are compiled once
// per instruction set and precision; kernel.c chooses for a model. All of them visit rows in memory order and sum in
// the same order, so all machines give the same bits.
//
//     edge       law of every edge -> residual r, sqrt(slope) vectors g, block-Jacobi inverse P, z = P r      [step]
//     recall     z = the last step's change of velocity, where free; returns r.z                              [step]
//     apply      d = z + beta d;  q = (M/dt + sum g g^T) d;  returns d.q                                 [iteration]
//     update     guess += a d;  r -= a q;  z = P r;  returns r.z; a = 0: r was changed from outside      [iteration]
//     integrate  displacement += dt guess;  change = guess - velocity;  velocity = guess                  [step]
//
// Constrained components have zero rows and columns in P, so their guess never moves and r keeps their load. At the
// end, r of such a component is the force that the lattice exerts on whatever holds the node. So the contact force
// costs nothing extra.
#include "core/state.h"

// Solver vectors in the scratch part of a state, in the model's precision. When edge is called, r and P must be zero or
// contain only contact terms. When apply is called, q must be zero.
typedef struct kn_work {
    // The number that opens each comment is the number of components per node.
    void *guess;       // 3   velocity sought; starts as the last velocity, with prescribed components overwritten
    void *r;           // 3   residual force of each node, N
    void *q;           // 3   product A d of the step's matrix and the search direction
    void *d;           // 3   search direction of the conjugate gradients
    void *z;           // 3   preconditioned residual P r
    void *p;           // 6   xx xy xz yy yz zz of the matrix's diagonal blocks while they are summed, then of P
    void *g;           // per edge, sqrt(kappa W ds/dw) n: grid [row][13][x y z][stride], net [edge][x y z]; a grid in
                       // f64 keeps kappa W ds/dw / length^2 instead, [row][13][stride]
    void *free;        // 3   1 where a component is free, 0 where it is prescribed
    void *whole;       // 6   composite only, else NULL: diagonal blocks of held rows, before they are inverted in p
    void *cell;        // with pressure, else NULL: sqrt(-dt dP/dV) dV/dx of the corners of every cell, 24 (flat 8, net
                       // 12), or of the whole object, 3
    uint8_t *row_held; // [rows] 1: at least one component of the row's nodes is prescribed
    // [rows] 1: a prescribed velocity in the row differs from that of the last step, so the law is evaluated twice
    uint8_t *row_moved;
} kn_work;

typedef struct kn_kernels {
    const char *name; // instruction set and precision, e.g. "avx512 f32"
    size_t (*tables_size)(const kn_model *model);
    void (*tables_build)(const kn_model *model, void *tables);
    // Linearise the law, fill r, g, P and z, and return r.z. `again`: linearise once more around the guess, without
    // advancing the edges' strain.
    double (*edge)(const kn_model *model, kn_state *state, kn_linearization how, bool again);
    double (*recall)(const kn_model *model, kn_state *state);
    double (*apply)(const kn_model *model, kn_state *state, double beta);
    double (*update)(const kn_model *model, kn_state *state, double alpha);
    void (*integrate)(const kn_model *model, kn_state *state);
} kn_kernels;

// Choose model->isa and model->kernels by the model's definition. Return false if this processor lacks the requested
// instruction set.
bool kn_kernels_choose(kn_model *model);

// Build the kernels' tables of a model whose grid or net and law are built. Return one block that the caller frees, or
// NULL if memory is short.
void *kn_tables_create(const kn_model *model, const kn_kernels *kernels);

extern const kn_kernels kn_kernels_grid_base_f32, kn_kernels_grid_base_f64, kn_kernels_grid_avx2_f32,
    kn_kernels_grid_avx2_f64, kn_kernels_grid_avx512_f32, kn_kernels_grid_avx512_f64;
extern const kn_kernels kn_kernels_net_base_f32, kn_kernels_net_base_f64, kn_kernels_net_avx2_f32,
    kn_kernels_net_avx2_f64, kn_kernels_net_avx512_f32, kn_kernels_net_avx512_f64;

// Return the number of reals that kn_work.g holds per edge.
static inline int kn_work_edge(const kn_model *m)
{
    return m->def.mesh || m->def.solver.precision == KN_PRECISION_F32 ? 3 : 1;
}

static inline kn_work *kn_state_work(const kn_state *state) { return state->scratch; }

// Return true if the preconditioner has a second level, the rigid motions (solver_implicit.c): only contact and gravity
// hold the object. A step in which a plate holds nodes does not use them.
bool kn_rigid_wanted(const kn_model *model);

#endif
