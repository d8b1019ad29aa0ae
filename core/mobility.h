#ifndef KN_CORE_MOBILITY_H
#define KN_CORE_MOBILITY_H
// Impedance of the object at a contact: the velocity of the contact's points under the contact's own pattern of forces.
//
//     (M/(S dt) + A n n' over all edges) z = b,   |b| = 1 N in sum,   Y = b'z,   impedance A_c = 1/Y   [N s/m]
//
// The matrix is that of the step with two changes. First, the dampers c2 do not yield: edges answer with A = c1 + dt k1
// alone, which is a lasting property of object and contact. Second, inertia is S times smaller. A client's unit has no
// mass, so it must answer like the object over S dt = 30 ms, not over one step. All edges have one material, so k1/A at
// the contact is the same as in an edge.
//
// The solver is conjugate gradients with a warm start. A pattern changes little between two rounds, so a round of a few
// iterations, spread over several ticks, follows it. The lattice is taken as undeformed. A compression by a fifth
// changes A_c by about a fifth.
#include "core/model.h"

typedef struct kn_mobility kn_mobility;

// Create a mobility solver. It allocates all its memory here, including a state of the model. Return NULL if memory is
// short or the solver is not the implicit one.
kn_mobility *kn_mobility_create(const kn_model *model);
void kn_mobility_destroy(kn_mobility *m); // does nothing if `m` is NULL

// Run a round for probe `p`: call begin, then load for every force of the pattern (`offset`: the node's model->offset),
// then start. Then call iterate until it returns true. These and the functions below are real-time safe.
void kn_mobility_begin(kn_mobility *m, int p);
void kn_mobility_load(kn_mobility *m, size_t offset, const double force_n[3]);
void kn_mobility_start(kn_mobility *m);

// Do one iteration of the solve, about 20 ns per node. Return true when the solve (the round) is complete. Then
// *a_n_s_per_m is the new impedance, or 0 if the solve failed.
bool kn_mobility_iterate(kn_mobility *m, double *a_n_s_per_m);

// Return the scalar product of force_n and the velocity of a node under the whole pattern of 1 N. The velocity is that
// of the last successful solve for probe p.
double kn_mobility_rate(const kn_mobility *m, int p, size_t offset, const double force_n[3]);

#endif
