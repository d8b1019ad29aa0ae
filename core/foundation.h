#ifndef KN_CORE_FOUNDATION_H
#define KN_CORE_FOUNDATION_H
// Samples in the implicit step: what they push with at the end of the step, and their stiffness in the matrix. Samples
// of one patch of the skin lie one behind the other and share its nodes, which are fetched and added to once for all of
// them: three quarters of what a ball costs were single sums into a field.
//
// With r the skin's velocity at a sample, J V its tool's and K = k n n' + k_side (1 - n n') its stiffness, the skin is
// pushed by f = k depth n - k_side e - dt K (r - J V). Where the stick would leave Coulomb's cone, k_side is what ends
// on it, mu f_n/|e|: a secant, so the matrix stays positive and the end of the step is on the cone. A coupled tool's V
// is eliminated (tool.h).
#include "core/scratch.h"

// Which samples press, judged by the guess: their force into r, dt K into the blocks of their nodes.
void kn_foundation_push(const kn_model *model, kn_scratch *scratch);

// q += what the samples answer d with; returns their share of d.q.
double kn_foundation_apply(const kn_model *model, kn_scratch *scratch);

// Samples that the guess shows on the wrong side, or sliding where they stuck, change it, in r too; returns how many.
int kn_foundation_change(const kn_model *model, kn_scratch *scratch);

// force_n of every sample and the tools' velocities, from the solution.
void kn_foundation_read(const kn_model *model, kn_scratch *scratch);

// Adds what the samples resist a rigid motion about `centre` with, sum dt J'KJ, to the lower half of a.
void kn_foundation_rigid(const kn_model *model, const kn_scratch *scratch, const double centre_m[3], double a[6][6]);

#endif
