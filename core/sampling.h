#ifndef KN_CORE_SAMPLING_H
#define KN_CORE_SAMPLING_H
// Points of the skin near tools, and how far the skin is from a tool: the geometry of foundation contact.
#include "core/contact.h"

// Most samples that all tools can have under them at once.
int kn_sampling_max(const kn_model *model);

// Lists the samples of probe p near its tool (contact->tool[p]) at the positions of now; keys ascend.
void kn_sampling_find(const kn_model *model, const kn_state *state, int p, kn_contact *contact);

// And those of the table.
void kn_sampling_table(const kn_model *model, const kn_state *state, kn_contact *contact);

// kn_clearance of any shape but a plate, turned as the matrix says.
double kn_sampling_clearance(const kn_model *model, const kn_state *state, int p, const double position_m[3],
                             const double turn[3][3]);

#endif
