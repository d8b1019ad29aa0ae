#ifndef KN_CORE_FOUNDATION_H
#define KN_CORE_FOUNDATION_H
// Spheres in the implicit step: what the samples of their foundation push with at the end of the step, and their
// stiffness in the matrix. Samples of one patch of the skin lie one behind the other and share its nine nodes, which are
// fetched and added to once for all of them: three quarters of what a ball costs were single sums into a field.
#include "core/scratch.h"

// Which samples press, judged by the guess: their force into r, dt k n n^T into the blocks of their nodes.
void kn_foundation_push(const kn_model *model, kn_state *state, kn_scratch *scratch);

// q += sum k dt n n^T d over active samples; returns their share of d.q.
double kn_foundation_apply(const kn_model *model, kn_scratch *scratch);

// Samples that the guess shows on the wrong side change it, in r too; returns how many.
int kn_foundation_change(const kn_model *model, kn_state *state, kn_scratch *scratch);

// force_n of every sample, from the solution.
void kn_foundation_read(const kn_model *model, kn_state *state, kn_scratch *scratch);

#endif
