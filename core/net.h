#ifndef KN_CORE_NET_H
#define KN_CORE_NET_H
// A lattice on triangles or tetrahedra: every side of an element is an edge with the whole law of law.h.
//
// Stiffness. Each element gives each of its sides k = E V/L^2 (Van Gelder), V its volume, or area times thickness. Were
// the nodes to follow the body's strain that would be exactly E for edges of all directions; they give way, so one
// factor over all edges makes the body's own Young modulus E (kn_net_fit). Springs alone leave Poisson's ratio at 1/4
// in three dimensions, 1/3 in two, and what the mesh's directions make of the shear modulus: knead check prints both.
//
// Stress. The damper sees |f|/(gamma kappa_e L0); gamma makes the body creep as the 1-D element does and is a property
// of the mesh, .55 to .9: fitted, too.
//
// Memory. A row is one node, its components beside each other; edges stand by their lower node.
#include "core/model.h"

#define KN_NO_MEMORY "not enough memory for the model"

// What model.c lends: room for that many nodes and top nodes, for that many cells, and the components that a support
// holds of a base node.
bool kn_model_nodes(kn_model *model, int nodes, int top);
bool kn_model_cells(kn_model *model, int cells);
uint8_t kn_support_mask(kn_support support);

// Fills what a model says about its nodes, edges, skin and top from def.mesh. NULL, or what is wrong.
const char *kn_net_build(kn_model *model);

#endif
