#ifndef KN_CORE_OUTSIDE_H
#define KN_CORE_OUTSIDE_H
// The two sides of contact: shapes of the tools, and nodes of the object's outside with the area of each.
#include "core/model.h"
#include "core/shape.h"

// Fill in model->shape after nodes, faces and skin. Fill in model->base, too, if the support is FRICTION, or if a tool
// is coupled and the support is not NONE: a coupled tool may be thrown at the object, and the table stops thin layers
// under it. Return false if memory is short.
bool kn_outside_build(kn_model *model);

// Return NULL, or the reason why a lattice of the given spacing is too coarse for the shape of a probe.
const char *kn_outside_unfit(const kn_probe_def *probe, double spacing_m);

// Add the parts of a probe's shape to `shape`; a plate adds nothing. Return false if the shape would get more than
// KN_PARTS_MAX parts.
bool kn_outside_shape(const kn_probe_def *probe, kn_shape *shape);

// Return the area at rest of a triangle of skin nodes, m^2.
double kn_outside_area(const kn_model *model, const int node[3]);

#endif
