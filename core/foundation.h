#ifndef KN_CORE_FOUNDATION_H
#define KN_CORE_FOUNDATION_H
// Foundation contact in the implicit step: the samples' forces at the end of the step and their stiffness in the
// matrix. Samples of one patch of the skin are stored one behind the other and share the patch's nodes. The nodes'
// values are fetched and added once for all samples of a patch: single sums into a field took three quarters of the
// cost of a ball.
//
// Symbols are those of contact.h. Let r be the skin's velocity at a sample, J V the tool's velocity there, and K = k n
// n' + k_side (1 - n n') the sample's stiffness. The force on the skin is f = k depth n - k_side e - dt K (r - J V). If
// sticking would leave Coulomb's cone, k_side = mu f_n/|e|. This secant keeps the matrix positive, and the end of the
// step is on the cone. The velocity V of a coupled tool is eliminated (tool.h).
#include "core/scratch.h"

// Decide by the guessed velocities which samples press. Add their forces to the residual r, and dt K to the matrix
// blocks of their nodes.
void kn_foundation_push(const kn_model *model, kn_scratch *scratch);

// Add dt K d of all samples to the product q, where d is the search direction. Return the samples' part of d.q.
double kn_foundation_apply(const kn_model *model, kn_scratch *scratch);

// Decide again, by the present guess, which samples press, slide or stick. If the answer for a sample has changed,
// change the sample's linearised force and the residual r. Return the number of such samples.
int kn_foundation_change(const kn_model *model, kn_scratch *scratch);

// Read force_n of every sample and the tools' velocities from the solution.
void kn_foundation_read(const kn_model *model, kn_scratch *scratch);

// Add the samples' resistance to a rigid motion about `centre`, sum dt J'KJ, to the lower half of `a`.
void kn_foundation_rigid(const kn_model *model, const kn_scratch *scratch, const double centre_m[3], double a[6][6]);

#endif
