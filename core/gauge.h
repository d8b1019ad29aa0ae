#ifndef KN_CORE_GAUGE_H
#define KN_CORE_GAUGE_H
// What an object is under and what has stayed, node by node: for colours and files, never for the step.
//
//     displacement  |x - X|, m
//     stress        von Mises of  sigma = R <n n n n> : S,  S fits  n.S.n = q_e  to the node's edges best, Pa
//     residual      root of the mean of r_e^2, r_e the share of L0 that nothing brings back; a number
//
// q_e = s_e L_e/(gamma L0_e) is what an edge pulls with, times its length, per volume V_e (springs.h); means and fits
// are weighted by V_e. n is an edge's direction at rest: turning an object changes nothing. <n n n n> is the mean over
// all edges, R their volume over the object's: so sigma is the virial stress, and for small strains exactly the
// continuum's wherever it is uniform, to a block's corners. The virial of a node's own edges is not, 3 times as much
// there: half of their directions are missing. Gas in cells pushes in all directions alike and does not show in von
// Mises' stress.
#include "core/state.h"

typedef enum kn_measure { KN_MEASURE_DISPLACEMENT, KN_MEASURE_STRESS, KN_MEASURE_RESIDUAL, KN_MEASURES } kn_measure;

typedef struct kn_measure_name {
    const char *name, *words, *unit; // unit "" for numbers, in which 0.1 is 10 %
} kn_measure_name;
extern const kn_measure_name kn_measure_names[KN_MEASURES];

typedef struct kn_gauge kn_gauge;

kn_gauge *kn_gauge_create(const kn_model *model); // borrows it; NULL: memory is short
void kn_gauge_destroy(kn_gauge *gauge);           // NULL is fine
size_t kn_gauge_bytes(const kn_model *model);     // memory that one takes, at most

// value[node_count]. Of a composite's nodes in one place all say the same. Some 50 ns an edge, allocates nothing.
void kn_gauge_read(kn_gauge *gauge, const kn_state *state, kn_measure what, double *value);
// Several in one pass over the edges: value[what][node_count], NULL where it is not asked for.
void kn_gauge_read_all(kn_gauge *gauge, const kn_state *state, double *const value[KN_MEASURES]);

#endif
