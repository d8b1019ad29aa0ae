#ifndef KN_CORE_CONTACT_FIT_H
#define KN_CORE_CONTACT_FIT_H
// Identification of the local contact model: which three-element units, rendered by a client (core/contact_model.h),
// answer like the lattice under a tool. Looks at steps from outside and changes nothing in them.
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
// Each patch of the skin that the tool presses apart from the others (patch.h) is a unit, one alone all that the tool
// touches. What is found of all is found of each patch from its own samples: t, n, w, H, c2, its foundation, and its
// place, where t n alone has the torque. Its A comes from the one round for all of them,
//
//     A_i = w_i/(b_i'z),   z = mobility of b = sum w_i b_i,   w_i = t_i/t,   between A/2N and A of all N together
//
// so under the loads of the moment patches go in as they do in the lattice, each with what the others do to it. That
// is exact while all loads change by one factor. Where one grows as another falls, as in rocking, the others' part has
// the wrong sign: two balls 30 mm apart on dough 30 mm high have Y_ij = 0.4 Y_ii. A patch that is younger than a round
// has the average's A. Patches that grow together or break have springs, dampers and back stress added up or shared out
// by load, and the same generation.
//
// A tool of several parts is also told the planes where another of them is about to touch (ahead.h).
//
// Of a flat face that presses everywhere at once there is one unit: it has no stiffness against a turn but its place's.
// Friction is one force for all, shared by load. A plate has neither friction nor foundation here. In contact the step
// is 2 us, ahead of it two distances of the tool.
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

// Two iterations of the mobility, for the contact as it stands, and which nodes are one patch from the next step on:
// once per tick, when its forces and units are on their way.
void kn_contact_fit_iterate(kn_contact_fit *fit, const kn_state *state);

// The units of probe p as of the last step, their physical fields: unit[0 .. contact_count - 1], contact_count 0 when
// nothing is within reach. Of more patches than most, 1 .. KN_CONTACT_UNITS, one unit is told, their resultant.
void kn_contact_fit_units(const kn_contact_fit *fit, int p, int most, kn_contact_unit unit[]);

#endif
