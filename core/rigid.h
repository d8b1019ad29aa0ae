#ifndef KN_CORE_RIGID_H
#define KN_CORE_RIGID_H
// The six rigid motions of an object that nothing holds, as a second level of the preconditioner.
//
//     z = P r + R (R'AR)^-1 R'r        R: [nodes] (v, w) -> v + w x (x - centre)
//
// A lattice resists its own deformation a thousand times more than inertia resists its motion as a whole, and the
// 3 x 3 blocks of P know of the first only: falling, or being lifted, would take hundreds of iterations. Bars do no
// work under rigid motions, so R'AR is the mass and inertia over dt and the contact: known without a product.
#include "core/scratch.h"

// Whether a model asks for it: nothing but contact and gravity holds the object, and no plate does in this step.
bool kn_rigid_wanted(const kn_model *model);
size_t kn_rigid_bytes(const kn_model *model); // of scratch->rigid.arm, 0 when it is not wanted

// For the positions of now and the samples as they press.
void kn_rigid_begin(const kn_model *model, const kn_state *state, kn_scratch *scratch);

// Adds its part to work.z of the residual work.r. Returns what r.z is more by.
double kn_rigid_add(const kn_model *model, kn_scratch *scratch);

#endif
