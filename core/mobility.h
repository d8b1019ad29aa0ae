#ifndef KN_CORE_MOBILITY_H
#define KN_CORE_MOBILITY_H
// How far a pattern of forces on the object moves the points it acts on: the object's impedance at a contact.
//
//     (M/(S dt) + A n n' over all edges) z = b,   |b| = 1 N in sum,   Y = b'z,   impedance A_c = 1/Y   [N s/m]
//
// The matrix is the step's own with two changes: dampers c2 do not yield (edges answer with A = c1 + dt k1 alone, which
// is a property of object and contact that lasts), and inertia is made S times less: the unit of a client has no mass,
// so it is to answer like the object over S dt = 30 ms, not over the step. All edges are of one material: what k1 is to
// A in an edge, it is at the contact.
//
// Conjugate gradients, warm: a pattern changes little between two rounds, so a round of a few iterations spread over
// ticks follows it. The lattice is taken as undeformed; a fifth of compression changes A_c by as much.
#include "core/model.h"

typedef struct kn_mobility kn_mobility;

// Allocates all that it will need, among it a state of the model. NULL: no memory, or a model of Runge-Kutta.
kn_mobility *kn_mobility_create(const kn_model *model);
void kn_mobility_destroy(kn_mobility *m); // NULL is fine

// A round for probe p: begin, load every force of the pattern (at a node's model->offset), start, iterate till true.
// Real-time safe, like all below.
void kn_mobility_begin(kn_mobility *m, int p);
void kn_mobility_load(kn_mobility *m, size_t offset, const double force_n[3]);
void kn_mobility_start(kn_mobility *m);

// One iteration: about 20 ns per node. True: the round is over and *a_n_s_per_m new, if it is a number > 0.
bool kn_mobility_iterate(kn_mobility *m, double *a_n_s_per_m);

// Of the last round of p that was good: how fast its whole pattern, 1 N, moves a node along a force, times that force.
double kn_mobility_rate(const kn_mobility *m, int p, size_t offset, const double force_n[3]);

#endif
