#ifndef KN_CORE_CONTACT_FIT_H
#define KN_CORE_CONTACT_FIT_H
// Identification of the local contact model: find the three-element units that answer like the lattice under a tool
// when a client renders them (core/contact_model.h). The fit observes the steps and does not change them. Below, t is
// the contact force along the normal n, and w is the speed at which the tool presses the surface inwards. A round is
// one mobility solve (core/local/patch.h), spread over several ticks.
//
//     A     damping of the contact, from the mobility of the contact's own pattern of forces, one round at a time
//     k1    stiffness: A k1/(c1 + dt k1) with k1, c1 of the material, which is the same in all edges
//     H     force of k1, dH/dt = k1 (t - H)/A: it follows from the contact force and does not depend on c2
//     c2    damping of the force-dependent damper: t over its rate w - (t - H)/A, least squares over 20 ms; clipped to
//           the range that the material's own damper gives for A between its stiffest and its softest
//     k_vc  tool's coupling and foundation in series, since the unit begins at the skin; 0 for a rigid plate
//     valid_ms  100; less for a tool that follows its pose rigidly on an object too viscous for a device's coupling
//
// If the tool does not touch the object but is nearer than three of its radii, the fit gives the plane that the tool
// would meet. The plane comes from the tool's distance and the gradient of the distance. The unit of the plane comes
// from a node at that place. A plate gets one unit for all nodes that it will meet at once.
//
// A unit is one contact as kn_contact_unit describes it. Each separate patch of pressed skin (patch.h) becomes one
// unit. If there is only one patch, its unit covers everything that the tool touches. The values t, n, w, H, c2,
// foundation and place come from the patch's own samples. The place of a unit is the point at which the force t n has
// the patch's torque. A comes from one round for all patches together,
//
//     A_i = w_i/(b_i'z),   z = mobility of b = sum w_i b_i,   w_i = t_i/t,   clipped to A/2N .. A of all N patches
//
// So under the present loads, each patch yields as fast as in the lattice, where the other patches also move it. This
// is exact while all loads change by one factor. When one load grows while another falls, as in rocking, the effect of
// the other patches has the wrong sign: two balls 30 mm apart on dough 30 mm high have Y_ij = 0.4 Y_ii. A patch that
// appeared after the start of the last round has the average A. When patches merge, their k1, A, c2 and H add up. When
// a patch breaks, its parts share its k1, A, c2 and H by load. The generation stays the same in both cases.
//
// A tool of several parts also gets the planes where another part is about to touch (patch.h).
//
// A flat face that presses everywhere at once is one unit. Such a unit resists a turn of the tool only by the arm of
// its place. Friction is one force for all units, shared by load. The unit of a plate has neither friction nor
// foundation. kn_contact_fit_step takes 2 us while the tool touches. While the tool is near the object, it computes the
// tool's distance twice instead.
#include "core/contact_model.h"
#include "core/coupling.h"
#include "core/step.h"

typedef struct kn_contact_fit kn_contact_fit;

// Create a fit, which the caller destroys. `model` must outlive the fit. `device` is the coupling of the client's
// device; this coupling decides how long the unit of a rigid tool stays valid. Return NULL if memory is short, or if
// the model's solver is not the implicit one. Only this function allocates.
kn_contact_fit *kn_contact_fit_create(const kn_model *model, kn_coupling device);
void kn_contact_fit_destroy(kn_contact_fit *fit); // does nothing if `fit` is NULL
void kn_contact_fit_reset(kn_contact_fit *fit);   // forget all contacts; call when the object is reset

// Update the fit from the contact of one step. Call after every kn_step with the step's scratch, input and output.
// Real-time safe.
void kn_contact_fit_step(kn_contact_fit *fit, const kn_state *state, const kn_scratch *scratch, const kn_input *input,
                         const kn_output *output);

// Do two iterations of the mobility solve (core/local/patch.h) for the present contact, and group the pressed nodes
// into patches for the next step. Call once per tick, after the forces and units have been sent. Real-time safe.
void kn_contact_fit_iterate(kn_contact_fit *fit, const kn_state *state, const kn_scratch *scratch);

// Store the units of probe p after the last step in unit[0 .. contact_count - 1]. `most`: number of units for which
// unit[] has room, 1 to KN_CONTACT_UNITS. unit[0].contact_count is 0 if the object is not within the tool's reach. If
// there are more than `most` patches, one unit stands for the resultant of all patches. Session, pose_seq, generation,
// utime and flags of the units are 0; the caller fills them in. Real-time safe.
void kn_contact_fit_units(const kn_contact_fit *fit, int p, int most, kn_contact_unit unit[]);

#endif
