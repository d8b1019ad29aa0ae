#ifndef KN_CORE_GAUGE_H
#define KN_CORE_GAUGE_H
// Stress and permanent strain of an object at each node: for colours and files, never for the step.
//
//     displacement  |x - X|, m
//     stress        von Mises of  sigma = R <n n n n> : S,  S fits  n.S.n = q_e  to the node's edges best, Pa
//     residual      root of the mean of r_e^2, r_e the permanent part of an edge's strain, a share of L0; dimensionless
//
// q_e = s_e L_e/(gamma L0_e) is an edge's pull times its length, per volume V_e (springs.h). Means and fits are
// weighted by V_e. n is an edge's direction at rest, so turning an object changes nothing. <n n n n> is the mean over
// all edges, and R their volume over the object's. So sigma is the virial stress. For small strains it is exactly the
// continuum's stress wherever that stress is uniform, even at a block's corners. The virial of a node's own edges would
// be 3 times as much at a corner, where half of the directions are missing. Gas in cells pushes equally in all
// directions and does not show in the von Mises stress.
#include "core/state.h"

typedef enum kn_measure { KN_MEASURE_DISPLACEMENT, KN_MEASURE_STRESS, KN_MEASURE_RESIDUAL, KN_MEASURES } kn_measure;

typedef struct kn_measure_name {
    const char *name, *words, *unit; // name in messages, words for users, unit; unit "": a plain number, 0.1 is 10 %
} kn_measure_name;
extern const kn_measure_name kn_measure_names[KN_MEASURES];

typedef struct kn_gauge kn_gauge;

kn_gauge *kn_gauge_create(const kn_model *model); // `model` must outlive the gauge; NULL: memory is short
void kn_gauge_destroy(kn_gauge *gauge);           // does nothing if `gauge` is NULL
size_t kn_gauge_bytes(const kn_model *model);     // largest memory that a gauge takes [bytes]

// Store one measure (displacement, stress or residual strain) of every node in value[node_count]. Nodes of a composite
// that lie in the same place have the same stress and residual. Takes some 50 ns per edge and allocates nothing.
void kn_gauge_read(kn_gauge *gauge, const kn_state *state, kn_measure what, double *value);
// Store several measures in one pass over the edges: value[measure][node_count]. A measure whose pointer is
// NULL is skipped.
void kn_gauge_read_all(kn_gauge *gauge, const kn_state *state, double *const value[KN_MEASURES]);

#endif
