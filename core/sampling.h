#ifndef KN_CORE_SAMPLING_H
#define KN_CORE_SAMPLING_H
// Geometry of foundation contact: the points of the skin near tools, and the distance of the skin from a tool.
#include "core/contact.h"

// Return the largest number of samples that all tools and the table can have at once.
int kn_sampling_max(const kn_model *model);

// List the samples of probe p near its tool (contact->tool[p]) at the present positions. The samples are in ascending
// order of their keys.
void kn_sampling_find(const kn_model *model, const kn_state *state, int p, kn_contact *contact);

// List the samples at which the table (plane z = 0) may push the object.
void kn_sampling_table(const kn_model *model, const kn_state *state, kn_contact *contact);

// Return the distance of the skin from probe p at a pose, as kn_clearance (step.h) does, for any shape but a plate.
// `turn`: rotation matrix of the tool.
double kn_sampling_clearance(const kn_model *model, const kn_state *state, int p, const double position_m[3],
                             const double turn[3][3]);

#endif
