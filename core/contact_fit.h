#ifndef KN_CORE_CONTACT_FIT_H
#define KN_CORE_CONTACT_FIT_H
// Identification of the local contact model: which three-element unit, rendered by a client (core/contact_model.h),
// answers like the lattice under a tool. Looks at steps from outside and changes nothing in them.
//
//     A     mobility of the contact's own pattern of forces (core/mobility.h), a round at a time
//     k1    A k1/(c1 + dt k1) of an edge: all edges are of one material
//     H     dH/dt = k1 (t - H)/A: the Voigt part's force follows from that of the contact, whatever c2 does
//     c2    t over the rate that A leaves to it, w - (t - H)/A, least squares over 20 ms; between what the material's
//           own damper makes of A at its stiffest and at its softest
//     k_vc  of the tool's coupling and of the foundation in series: the unit begins at the skin. 0 of a rigid plate
//     valid_ms  100; less of a tool that follows its pose rigidly on what is too viscous for a device's coupling
//
// With the tool off the object, within three of its radii: the plane it would meet, by the distance of the tool and the
// gradient of that, and the unit of a node there; of a plate, that of all nodes that it meets at once.
//
// Of one contact per tool, the resultant of all its samples: torque is left to the server. A plate has neither friction
// nor foundation here. In contact the step is 1 us; ahead of it two distances of the tool.
#include "core/contact_model.h"
#include "core/coupling.h"
#include "core/step.h"

typedef struct kn_contact_fit kn_contact_fit;

// device: coupling of the client's device, of how long a rigid tool's unit is good for it. Borrows model. NULL: no
// memory, or a model of Runge-Kutta.
kn_contact_fit *kn_contact_fit_create(const kn_model *model, kn_coupling device);
void kn_contact_fit_destroy(kn_contact_fit *fit); // NULL is fine
void kn_contact_fit_reset(kn_contact_fit *fit);   // with the object

// After every kn_step, with what went in and came out. Real-time safe, as the next.
void kn_contact_fit_step(kn_contact_fit *fit, const kn_state *state, const kn_input *input, const kn_output *output);

// Two iterations of the mobility, for the contact as it stands: once per tick, when its forces are on their way.
void kn_contact_fit_iterate(kn_contact_fit *fit, const kn_state *state);

// The unit of probe p as of the last step, its physical fields; contact_count is 0 when nothing is within reach.
void kn_contact_fit_unit(const kn_contact_fit *fit, int p, kn_contact_unit *unit);

#endif
