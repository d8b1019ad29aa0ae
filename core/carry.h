#ifndef KN_CORE_CARRY_H
#define KN_CORE_CARRY_H
// Change of an object's material: turn the state of one model into a state of another model with the same lattice.
//
// Positions, velocities, held nodes, anchors and the flow that the dampers have gone through stay the same. So does the
// extension p - p0 = u gamma L0 of each Voigt part (p0: its natural length). The stored strain u belongs to the
// beginning of the last step (law.h), so the new material decides how u developed in that step. Forces jump, and so
// does the stored energy. Call kn_energy_of (energy.h) for both states to find the difference. The new density and
// gravity act from the next step on.
#include "core/state.h"

// Return NULL if a state of `from` can become a state of `to`, else the reason, e.g. "another lattice". A change is
// refused if nodes, edges, skin, step method, precision, support, kind of gas pressure, tools or stops of the damper
// differ. A change is also refused if only one of the two models has a damper, or contact that sticks, or if contact
// reaches farther in one of them.
const char *kn_carry_misfit(const kn_model *from, const kn_model *to);

// Convert the state `now` of the model `from` into the state `then` of the model `to`. `then` may come from
// kn_state_keep. Real-time safe: reads and writes each state once.
void kn_carry(const kn_model *from, const kn_state *now, const kn_model *to, kn_state *then);

#endif
