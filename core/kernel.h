#ifndef KN_CORE_KERNEL_H
#define KN_CORE_KERNEL_H
// The hot loops of the implicit step: kernel.c of a grid, kernel_net.c of any lattice; compiled once per instruction
// set and precision; isa.c chooses for a model. All of them visit rows in memory order and sum in the same order: the
// same bits everywhere.
//
//     edge       law of every edge -> residual r, sqrt(slope) vectors g, block-Jacobi inverse P, z = P r  [step]
//     recall     z = the last step's change of velocity, where free; returns r.z                              [step]
//     apply      d = z + beta d;  q = (M/dt + sum g g^T) d;  returns d.q                                 [iteration]
//     update     guess += a d;  r -= a q;  z = P r;  returns r.z; a = 0: r was changed from outside      [iteration]
//     integrate  displacement += dt guess;  change = guess - velocity;  velocity = guess                  [step]
//
// Constrained components have zero rows and columns in P, so their guess never moves and r keeps what they carry: at
// the end r there is the force that the lattice exerts on whatever holds the node. Contact force for free.
#include "core/state.h"

// Solver vectors in the scratch part of a state, in the model's precision. r and P must be zero (or hold contact terms)
// when edge is called; q must be zero when apply is.
typedef struct kn_work {
    void *guess;        // 3   velocity sought; starts as the last one, with prescribed components overwritten
    void *r;            // 3   residual force, N
    void *q;            // 3   A d
    void *d;            // 3   search direction
    void *z;            // 3   preconditioned residual
    void *p;            // 6   xx xy xz yy yz zz: accumulated blocks, then their inverses
    void *g;            // sqrt(kappa W ds/dw) n of every edge: [row][13][x y z][stride], a net's [edge][x y z]; a
                        // lattice's in f64 kappa W ds/dw / length^2, [row][13][stride]
    void *free;         // 3   1 free, 0 prescribed
    void *whole;        // 6   of a composite, else NULL: a held row's accumulated blocks, as p before its inverses
    void *cell;         // with pressure, else NULL: sqrt(-dt dP/dV) dV/dx of the corners of every cell, 24 (flat 8, a
                        // net's 12), or of the whole object, 3
    uint8_t *row_held;  // [rows] 1: some component in the row is prescribed
    uint8_t *row_moved; // [rows] 1: a prescribed velocity in the row differs from the last one: evaluate the law twice
} kn_work;

typedef struct kn_kernels {
    const char *name; // "avx512 f32"
    size_t real_size;
    size_t (*tables_size)(const kn_model *model);
    void (*tables_build)(const kn_model *model, void *tables);
    // again: linearise once more around the guess, without advancing the edges' strain. Returns r.z.
    double (*edge)(const kn_model *model, kn_state *state, kn_linearization how, bool again);
    double (*recall)(const kn_model *model, kn_state *state);
    double (*apply)(const kn_model *model, kn_state *state, double beta);
    double (*update)(const kn_model *model, kn_state *state, double alpha);
    void (*integrate)(const kn_model *model, kn_state *state);
} kn_kernels;

// Chooses model->isa and model->kernels, by its def. False: this processor lacks the instruction set that is asked for.
bool kn_kernels_choose(kn_model *model);

// The tables of a model, whose grid or net and law are built, for these kernels: one block, to be freed. NULL: no memory.
void *kn_tables_create(const kn_model *model, const kn_kernels *kernels);

extern const kn_kernels kn_kernels_grid_base_f32, kn_kernels_grid_base_f64, kn_kernels_grid_avx2_f32,
    kn_kernels_grid_avx2_f64, kn_kernels_grid_avx512_f32, kn_kernels_grid_avx512_f64;
extern const kn_kernels kn_kernels_net_base_f32, kn_kernels_net_base_f64, kn_kernels_net_avx2_f32,
    kn_kernels_net_avx2_f64, kn_kernels_net_avx512_f32, kn_kernels_net_avx512_f64;

// Reals of g per edge.
static inline int kn_work_edge(const kn_model *m)
{
    return m->def.mesh || m->def.solver.precision == KN_PRECISION_F32 ? 3 : 1;
}

static inline kn_work *kn_state_work(const kn_state *state) { return state->scratch; }

// Element i of a field in the model's precision, for the few scalar places (contact, output).
static inline double kn_real_get(const kn_model *model, const void *field, size_t i)
{
    bool single = model->def.solver.precision == KN_PRECISION_F32;
    return single ? (double)((const float *)field)[i] : ((const double *)field)[i];
}
static inline void kn_real_set(const kn_model *model, void *field, size_t i, double value)
{
    if (model->def.solver.precision == KN_PRECISION_F32) ((float *)field)[i] = (float)value;
    else ((double *)field)[i] = value;
}
static inline void kn_real_add(const kn_model *model, void *field, size_t i, double value)
{
    kn_real_set(model, field, i, kn_real_get(model, field, i) + value);
}

#endif
