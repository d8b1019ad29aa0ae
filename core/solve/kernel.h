#ifndef KN_CORE_SOLVE_KERNEL_H
#define KN_CORE_SOLVE_KERNEL_H
// The hot loops (kernels) of the implicit step: kernel_grid.c for a block, kernel_net.c for a net. The two sources are
// compiled once for each instruction set and precision; kernel.c chooses for a model. All kernels visit rows in memory
// order and sum in one order, so all machines give the same bits.
//
//     begin      r = P = 0;  guess = velocity                                                             [step]
//     edge       law of every edge -> residual r, sqrt(slope) vectors g, block-Jacobi inverse P, z = P r      [step]
//     recall     z = the last step's change of velocity, where free; returns r.z                              [step]
//     apply      d = z + beta d;  q = (M/dt + sum g g^T) d;  returns d.q                                 [iteration]
//     update     guess += a d;  r -= a q;  z = P r;  returns r.z; a = 0: r was changed from outside      [iteration]
//     integrate  displacement += dt guess;  change = guess - velocity;  velocity = guess                  [step]
//
// The rows and columns of P are 0 at constrained components. So the guess of a constrained component never changes, and
// r keeps its load. At the end, r of a constrained component is the force of the lattice on the plate or support that
// holds the node. So the contact force needs no extra work.
#include "core/state.h"

// Coarse level of the preconditioner: a box grid of coarse nodes over the undeformed object, see coarse.h.
typedef struct kn_coarse {
    int nodes[3];      // number of coarse nodes along x, y, z
    double first_m[3]; // place of the first coarse node: from the first node of a block, or in the frame of a mesh [m]
    double cell_m[3];  // distance of coarse nodes; 0 along an axis with one node
    int unknowns;      // three velocities per coarse node
    int padded;        // `unknowns`, rounded up to whole vectors
    void *inverse;     // [unknowns][padded] inverse of Ac in the model's precision, padded with 0
} kn_coarse;

// Solver vectors of a step, part of the scratch, in the model's precision. Before a call of the kernel `edge`, r and P
// must be zero or contain only contact terms. Before a call of the kernel `apply`, q must be zero.
typedef struct kn_work {
    // a leading (3) or (6) is the number of components per node
    void *guess; // (3) velocity to be solved for; starts as the last velocity, or the prescribed one if there is one
    void *r;     // (3) residual force of each node [N]
    void *q;     // (3) product A d of the step's matrix and the search direction
    void *d;     // (3) search direction of the conjugate gradients
    void *z;     // (3) preconditioned residual P r
    void *p;     // (6) diagonal blocks of the matrix while they are summed, then blocks of P: xx xy xz yy yz zz
    // For each edge the vector sqrt(kappa weight ds/dw) n. Layout: block [row][13][x y z][stride], net [turn][x y
    // z][16] (kernel_net.c). A block in f64 has one real per edge instead, kappa weight ds/dw / length^2, in
    // [row][13][stride].
    void *g;
    void *free;  // (3) 1 if a component is free, 0 if its velocity is prescribed
    void *whole; // (6) composite: diagonal blocks before constraints and inversion; else NULL
    // With gas in each cell: sqrt(-dt dP/dV) dV/dx of the corners of every cell, 24 reals per cell (flat 8, net 16).
    // With one gas pressure for the whole object: the same expression with dV/dx of every node, 3 reals per node.
    // Without gas: NULL.
    void *cell;
    void *records; // net: records of nodes and edges, see kernel_net.c; else NULL
    // Coarse level (coarse.h): residual and solution of the coarse nodes, and sums of the transfers; NULL without one.
    void *coarse;
    kn_team *team; // team of the scratch, or NULL
    // for each group of rows (kernel_nodes.h) its sum; in `apply` a second one follows, that of the gas in the cells
    double *sums;
    // Block: the strains of the plane below the cut between two parts as they were before the pass, then for each part
    // a row of g for what the other part writes. Net: the sums of the coarse cells. coarse_solve keeps its sums here.
    void *cut;
    // one flag per row; 1: at least one component of the row's nodes is prescribed
    uint8_t *row_held;
    // one flag per row; 1: a prescribed velocity in the row differs from that of the last step, so the law is evaluated
    // twice
    uint8_t *row_moved;
} kn_work;

struct kn_contact;

typedef struct kn_kernels {
    const char *name; // instruction set and precision, e.g. "avx512 f32"
    size_t (*tables_size)(const kn_model *model);
    void (*tables_build)(const kn_model *model, void *tables);
    // Clear r and P for a linearisation. Unless `again`, set the guess to the last velocity.
    void (*begin)(const kn_model *model, const kn_state *state, const kn_work *work, bool again);
    // Linearise the law of every edge around the guess, fill r, g, P and z, and return r.z. `again`: this is a further
    // linearisation in the step, so the edges' strains do not advance.
    double (*edge)(const kn_model *model, kn_state *state, const kn_work *work, kn_linearization how, bool again);
    double (*recall)(const kn_model *model, const kn_state *state, const kn_work *work);
    double (*apply)(const kn_model *model, const kn_state *state, const kn_work *work, double beta);
    double (*update)(const kn_model *model, const kn_work *work, double alpha);
    // the three parts of z += T Ac^-1 T' r (coarse.h); coarse_solve returns the increase of r.z
    void (*restriction)(const kn_model *model, const kn_work *work);
    double (*coarse_solve)(const kn_model *model, const kn_work *work);
    void (*prolongation)(const kn_model *model, const kn_work *work);
    // The contact (foundation.c), with the lanes of its patches. contact_rates stores the velocities of all samples in
    // a field v, and adds J' dt K v to `wrench` of each coupled tool unless that is NULL. contact_add adds forces to r,
    // and stiffnesses to the diagonal blocks if `blocks`. contact_product adds dt K (d - J V) of all samples to q, and
    // returns their part of d.q. V: velocities of the tools, after contact_rates with d; NULL: all 0.
    void (*contact_rates)(const kn_model *model, const struct kn_contact *contact, const void *field,
                          double (*wrench)[6]);
    void (*contact_add)(const kn_model *model, const kn_work *work, const struct kn_contact *contact, bool blocks);
    double (*contact_product)(const kn_model *model, const kn_work *work, const struct kn_contact *contact,
                              const double (*velocity)[6]);
    void (*integrate)(const kn_model *model, kn_state *state, const kn_work *work);
} kn_kernels;

// Choose model->isa and model->kernels for the model's definition. Return false if this processor lacks the requested
// instruction set.
bool kn_kernels_choose(kn_model *model);

// Build the tables of the kernels for a model whose lattice and law are complete. Return one block of memory, which the
// caller frees, or NULL if memory is short.
void *kn_tables_create(const kn_model *model, const kn_kernels *kernels);

extern const kn_kernels kn_kernels_grid_base_f32, kn_kernels_grid_base_f64, kn_kernels_grid_avx2_f32,
    kn_kernels_grid_avx2_f64, kn_kernels_grid_avx512_f32, kn_kernels_grid_avx512_f64;
extern const kn_kernels kn_kernels_net_base_f32, kn_kernels_net_base_f64, kn_kernels_net_avx2_f32,
    kn_kernels_net_avx2_f64, kn_kernels_net_avx512_f32, kn_kernels_net_avx512_f64;

// Return true if kn_work.g holds one real per edge: a block in f64. Otherwise it holds three.
static inline bool kn_work_lean(const kn_model *m)
{
    return !m->def.mesh && m->def.solver.precision == KN_PRECISION_F64;
}
static inline int kn_work_edge(const kn_model *m) { return kn_work_lean(m) ? 1 : 3; }

// Return the number of a net's cells, rounded up to whole vectors.
static inline size_t kn_work_cells(const kn_model *m)
{
    return ((size_t)m->cell_count + KN_LANES - 1) / KN_LANES * KN_LANES;
}

// Return the number of reals of kn_work.records. A record has four. There are three per node, two per edge and two of
// zeros; gas needs three more per node.
static inline size_t kn_work_records(const kn_model *m)
{
    const size_t each = m->def.pressure == KN_PRESSURE_NONE ? 3 : 6;
    return 4 * (each * (size_t)m->row_count * KN_LANES + 2 * (m->edge_reals + 1));
}

// Return the team if it pays for the loops of a model, else NULL: if a block or net has at least `least` vectors of
// nodes. A block of one plane cannot be cut. In a composite, each block decides for itself.
static inline kn_team *kn_work_team(const kn_model *m, kn_team *team, int least)
{
    if (!team || m->composite) return team;
    const int vectors = m->def.mesh ? m->row_count : m->grid.rows * m->grid.vectors;
    return vectors >= least && (m->def.mesh || m->grid.len[2] > 1) ? team : NULL;
}

// Return true if nothing but contact and gravity holds the object. The preconditioner then has a level of the
// rigid motions (solver_implicit.c). A step in which a plate holds nodes does not use this level.
bool kn_rigid_wanted(const kn_model *model);

#endif
