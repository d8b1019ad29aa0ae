#ifndef KN_CORE_SOLVE_CONTACT_H
#define KN_CORE_SOLVE_CONTACT_H
// Contact of rigid tools with the object. This module does the geometry: it lists the held nodes and the pressing
// samples, which are points of the skin near tools. All solvers use these lists.
//
// Plate. The plate holds the top nodes that it reaches: held nodes move with the plate's velocity, so the plate sticks.
// A plate without friction holds only their height. The residual that the lattice leaves on a held node is the contact
// force, unfiltered. A held node that would pull at the plate by more than the adhesion times its area is released.
//
// All other shapes. They use foundation contact (pressure = stiffness x depth) on a smooth skin. The skin is the
// quadratic B-spline with the nodes of each face as control points, or bilinear (kn_skin_form). The patch of skin that
// belongs to a node has samples s = sum_a w_a x_a,  depth = -distance of the shape at s,
//
//     f = k A depth n                                   while depth > -adhesion/k, once touched; else while depth > 0
//     t = -k A e, cut to mu f; e: how far s has slid along the tool since it stuck (elastoplastic anchor)
//     k: foundation stiffness, N/m^3;  A: area of the skin that the sample stands for;  n: normal of the tool
//
// Both forces are those at the end of the step (implicit), and so are the choice of pressing samples and the friction
// cone. Rejected: contact at single nodes or closest points. Its force jumps by 60-76 % per millisecond when another
// node becomes the supporting one, while a pressure that fades to zero at the rim does not jump. Also rejected:
// friction that follows a measured velocity instead of an anchor. This friction chatters at full amplitude. e belongs
// to the sample, which is a point of the material, so the skin carries e along.
//
// A coupled tool (tool.h) may arrive at 1 m/s and with any force. Its foundation is a layer whose thickness is KN_LAYER
// times the tool's smallest half width:
//     pressure = k depth / (1 - depth / layer)
// So no force can push the skin through the tool. The part of the object that the tool pushes down stops at the table.
//
// Table. With support FRICTION, the plane z = 0 pushes up the nodes of the object's outside, also by a foundation.
#include "core/solve/contact_list.h"

// Begin the step of every tool (kn_tool_begin), then list the held nodes and the samples at the present positions. The
// tools do not move before kn_contact_end.
void kn_contact_find(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact);

// Return the velocity of a sample's point (rate_m_s) minus the velocity of its tool, along the sample's normal.
double kn_sample_gap_rate(const kn_contact *contact, const kn_sample *s);

// Set the force on a sample: foundation stiffness times present depth, along the normal. Explicit solvers use this
// function.
void kn_sample_push(kn_sample *s);

// End a step: sum the forces on each tool, release held nodes that pull, store the anchors of sticking samples, and
// advance the tools by one step.
void kn_contact_end(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact,
                    kn_output *output);

#endif
