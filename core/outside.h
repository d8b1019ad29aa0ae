#ifndef KN_CORE_OUTSIDE_H
#define KN_CORE_OUTSIDE_H
// What tools and the table meet: shapes of the tools, nodes of the outside with the area that each stands for.
#include "core/model.h"
#include "core/shape.h"

// Fills model->shape once nodes, faces and skin are there; and base, with support FRICTION, and where a coupled tool
// may be thrown at an object on another table: thin layers end there. False: no memory.
bool kn_outside_build(kn_model *model);

// Why a lattice of that spacing cannot feel the shape of a probe; NULL: it can.
const char *kn_outside_unfit(const kn_probe_def *probe, double spacing_m);

// Of any probe but a plate. False: more than KN_PARTS_MAX parts with those that the shape has.
bool kn_outside_shape(const kn_probe_def *probe, kn_shape *shape);

// At rest, of a triangle of nodes of the skin, m^2.
double kn_outside_area(const kn_model *model, const int node[3]);

#endif
