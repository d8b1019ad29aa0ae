#ifndef KN_CORE_CARRY_H
#define KN_CORE_CARRY_H
// An object goes on in another material: the state of one model becomes that of another with the same lattice.
//
// Positions, velocities, what sticks to tools, and every Voigt part's length but for its natural one, p - p0 = u gamma
// L0, are as they were; so is the flow that the dampers have gone through. u is of the beginning of the last step
// (law.h), so that of this one step the new material tells what became of it. Forces jump, and so does what is stored:
// kn_energy_of both tells by how much. Density and gravity act from the next step on.
#include "core/state.h"

// NULL: it can be. Else why not, as "another lattice": other nodes, edges, skin, step method, precision or tools; a
// damper where there was none, stops other than there were, contact that sticks where none did.
const char *kn_carry_misfit(const kn_model *from, const kn_model *to);

// now: of `from`; then: of `to`, kept or not. Real-time safe: reads and writes either once.
void kn_carry(const kn_model *from, const kn_state *now, const kn_model *to, kn_state *then);

#endif
