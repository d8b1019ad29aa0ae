#ifndef KN_CORE_LATTICE_MEASURE_H
#define KN_CORE_LATTICE_MEASURE_H
// Readings of an object without stepping it: its edges one by one, three measures at each node, and the energy that it
// stores.
#include "core/state.h"

// --- edges ----------------------------------------------------------------------------------------------------------

// All edges of a model in one list: of a block, a net, or the parts of a composite.

typedef struct kn_spring {
    int i, j, slot; // ids of the two end nodes in the whole model; index of the edge's strain in the strain field
    double rest_m;  // rest length L0
    // Volume V = (gamma L0)^2 kappa weight of the edge. An edge with strain u of the Voigt part stores the energy
    // V k1 u^2/2. An edge with stress s pulls with the force s V/(gamma L0).
    double volume_m3;
} kn_spring;

// The values of one edge at the end of the last step.
typedef struct kn_spring_now {
    double length_m;
    double voigt;     // strain u of the Voigt part: the part's extension divided by gamma L0
    double stress_pa; // stress s of law.h, tension positive
    double residual;  // permanent part of (L - L0)/L0
} kn_spring_now;

typedef struct kn_springs {
    const kn_model *model; // must outlive this struct
    // Law that turns the state's strain u into the stress. With the implicit solver, the state holds u of the step's
    // beginning, so the law is that of the step's dt. With the other solvers, u belongs to the step's end, so dt is 0.
    kn_law law;
    double gamma;
    int count;
    kn_spring *spring; // [count]
} kn_springs;

// List the edges. Allocates; returns false if memory is short.
bool kn_springs_init(kn_springs *springs, const kn_model *model);
void kn_springs_free(kn_springs *springs); // free the list; does nothing if the struct is all 0

// Return the values of edge `number` at the end of the last step. Takes some 100 ns, because a force-dependent law is
// solved by Newton's method. Real-time safe.
kn_spring_now kn_spring_look(const kn_springs *springs, const kn_state *state, int number);

// --- measures at the nodes ------------------------------------------------------------------------------------------

// Stress and permanent strain of an object at each node: for colours and files, never for the step.
//
//     displacement  |x - X|, m
//     stress        von Mises of  sigma = R <n n n n> : S,  S fits  n.S.n = q_e  to the node's edges best, Pa
//     residual      root of the mean of r_e^2, r_e the permanent part of an edge's strain, a share of L0; dimensionless
//
// q_e = s_e L_e/(gamma L0_e) is an edge's pull times its length, per volume V_e. Means and fits are
// weighted by V_e. n is an edge's direction at rest, so turning an object changes nothing. <n n n n> is the mean over
// all edges, and R their volume over the object's. So sigma is the virial stress. For small strains it is exactly the
// continuum's stress wherever that stress is uniform, even at a block's corners. The virial of a node's own edges would
// be 3 times as much at a corner, where half of the directions are missing. Gas in cells pushes equally in all
// directions and does not show in the von Mises stress.

typedef enum kn_measure { KN_MEASURE_DISPLACEMENT, KN_MEASURE_STRESS, KN_MEASURE_RESIDUAL, KN_MEASURES } kn_measure;

typedef struct kn_measure_name {
    // name: in LCM messages; words: text for users; unit: "" for a ratio, where 0.1 means 10 %
    const char *name, *words, *unit;
} kn_measure_name;
extern const kn_measure_name kn_measure_names[KN_MEASURES];

typedef struct kn_gauge kn_gauge;

kn_gauge *kn_gauge_create(const kn_model *model); // `model` must outlive the gauge; NULL: memory is short
void kn_gauge_destroy(kn_gauge *gauge);           // does nothing if `gauge` is NULL
size_t kn_gauge_bytes(const kn_model *model);     // largest memory that a gauge takes [bytes]

// Store one measure (displacement, stress or residual strain) of every node in value[node_count]. Nodes of a composite
// that lie in the same place have the same stress and residual. Takes some 50 ns per edge and allocates nothing.
void kn_gauge_read(kn_gauge *gauge, const kn_state *state, kn_measure what, double *value);
// Store several measures in one pass over the edges: value[measure][node_count]. A measure whose pointer is NULL is
// skipped.
void kn_gauge_read_all(kn_gauge *gauge, const kn_state *state, double *const value[KN_MEASURES]);

// --- energy ---------------------------------------------------------------------------------------------------------

// The energy audit of the lattice: no energy may come out that has not gone in.
//
//     E(t2) <= E(t1) + contact(t1) + W(t1..t2),      E = kinetic + elastic + gas + height
//
// E is the energy that the object stores. W is the work of the tools (kn_probe_state.work_j). `contact` is the energy
// that the layers of tools and table may still return: at most half of force times depth, and for stuck friction half
// of force times stretch. The difference between the two sides has been dissipated. An edge stores k1 u^2/2 per volume,
// with u at the end of the step (law.h (1), (2)) and the volume (gamma L0)^2 kappa weight. Gas stores energy as in
// cell.h. Implicit Euler itself dissipates. Its linearisation around the guess and the remaining residual of the
// conjugate gradients may create a little energy. So KN_AUDIT_SHARE of the work done in either direction is tolerated.
//
// Summing a large lattice takes longer than a tick. So the state is copied once in KN_AUDIT_TICKS, after the forces
// have been sent. The copy takes 12 us for 847 nodes and 64 us for 5 733. The following ticks sum the copy edge by
// edge, at 1.5 and 12 us each.

#define KN_AUDIT_TICKS 1000 // ticks between two copies of the state
// ratio of the tolerated created energy to the tools' work, where negative work counts as positive
#define KN_AUDIT_SHARE 0.01

typedef struct kn_energy { // energy stored in the object, J; all 0 for the undeformed object at rest
    double kinetic, elastic, gas, height;
} kn_energy;

static inline double kn_energy_sum(const kn_energy *e) { return e->kinetic + e->elastic + e->gas + e->height; }

typedef struct kn_audit_news {
    kn_energy stored; // energy stored in the last copy of the state
    double work_j;    // work of all tools from the last reset to the last copy of the state
    double lost_j;    // energy dissipated between the last two copies of the state; < 0: energy was created
    // Energy dissipated since the first copy of this object's state: work minus increase of the stored energy; < 0:
    // energy was created.
    double balance_j;
    int64_t windows; // number of intervals judged since the audit was created; an interval lies between two copies
    int64_t created; // number of intervals in which more energy was created than is tolerated
    double most_j;   // most energy created in one interval
} kn_audit_news;

typedef struct kn_audit kn_audit;

// Create an audit. `model` must outlive the audit. Return NULL if memory is short or the solver is not the implicit
// one.
kn_audit *kn_audit_create(const kn_model *model);
void kn_audit_destroy(kn_audit *audit); // does nothing if `audit` is NULL

// Start a new account of work and energy. Call after the object has been replaced, because no tool has done the work
// that the new object stores. Real-time safe.
void kn_audit_restart(kn_audit *audit);

// Copy the results of the audit `last` to the audit `next`. Call when the object continues in another model, whose
// audit is `next`. Real-time safe.
void kn_audit_follow(kn_audit *next, const kn_audit *last);

// Continue the audit after a tick. Call after every tick, also after a tick that reset the object. Real-time safe: one
// call in KN_AUDIT_TICKS copies the state. Each of the other calls sums the energy of some edges, nodes or cells of the
// copy.
void kn_audit_tick(kn_audit *audit, const kn_state *state, const kn_scratch *scratch);

const kn_audit_news *kn_audit_read(const kn_audit *audit);

// Compute the energy that a state stores, in one call. Not real-time safe. Return false if memory is short.
bool kn_energy_of(const kn_model *model, const kn_state *state, kn_energy *energy);

#endif
