#ifndef KN_CORE_NET_H
#define KN_CORE_NET_H
// A net: a lattice on triangles or tetrahedra. Every side of an element is an edge with the whole law of law.h.
//
// Stiffness. Each element gives each of its sides k = E V/L^2 (Van Gelder), where V is its volume, or area times
// thickness. If the nodes followed the body's strain, edges of all directions would give exactly E. But the nodes give
// way, so one factor for all edges sets the Young modulus of the whole body to E (net_fit.h). With springs alone,
// Poisson's ratio is 1/4 in three dimensions and 1/3 in two. The shear modulus depends on the directions of the mesh's
// edges. `knead check` prints Poisson's ratio and the shear modulus.
//
// Stress. The damper sees |f|/(gamma kappa_e L0). gamma makes the body creep like the 1-D element. gamma is a property
// of the mesh, 0.55 to 0.9, and is also fitted.
//
// Memory. A row is one node, with its components side by side. Edges are ordered by their lower node.
#include "core/model.h"

#define KN_NO_MEMORY "not enough memory for the model"

// Helpers of model.c: allocate room for that many nodes and top nodes, or for that many cells; return the mask of the
// components that a support holds at a base node.
bool kn_model_nodes(kn_model *model, int nodes, int top);
bool kn_model_cells(kn_model *model, int cells);
uint8_t kn_support_mask(kn_support support);

// Fill in the model's nodes, edges, skin and top from def.mesh. Return NULL, or a sentence that says what is wrong.
const char *kn_net_build(kn_model *model);

#endif
