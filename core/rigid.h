#ifndef KN_CORE_RIGID_H
#define KN_CORE_RIGID_H
// The second level of the preconditioner: the six rigid motions of an object that nothing holds.
//
//     z = P r + R (R'AR)^-1 R'r        R: [nodes] (v, w) -> v + w x (x - centre)
//
// A lattice resists its own deformation a thousand times more than inertia resists its motion as a whole. The 3 x 3
// blocks of P represent the first resistance only, so falling or being lifted would take hundreds of iterations. Edges
// do no work under rigid motions. So R'AR is mass and inertia over dt plus the contact, and needs no product with A.
#include "core/scratch.h"

// Return true if the model uses the rigid motions: only contact and gravity hold the object. A step in which a plate
// holds nodes does not use them.
bool kn_rigid_wanted(const kn_model *model);
// memory of scratch->rigid.arm [bytes], 0 if the model does not use the rigid motions
size_t kn_rigid_bytes(const kn_model *model);

// Prepare R and the factor of R'AR for the present positions and pressing samples.
void kn_rigid_begin(const kn_model *model, const kn_state *state, kn_scratch *scratch);

// Add the rigid part of z = P r to work.z, for the residual work.r. Return the increase of r.z.
double kn_rigid_add(const kn_model *model, kn_scratch *scratch);

#endif
