#ifndef KN_CLIENTS_FOOT_H
#define KN_CLIENTS_FOOT_H
// The underside of a level tool: the part that touches an object when the tool is lowered onto it.
//
//        sphere, capsule            plate, box, cross, cylinder
//            ___
//           /   \                      +---------+
//          |  o  |  pose               |         |
//           \___/   ^ kn_foot_m        +----o----+  pose: 0
//
// Rounded edges count as sharp; the error is at most the rounding. A union or a mesh counts as flat, wherever it
// touches first. This is the safer assumption.
#include "core/model.h"

// Return true for a shape that touches a flat object with a face and not with a point.
bool kn_foot_flat(kn_probe_shape shape);

// Return how far the underside is below the pose at the offset (dx, dy), m. Return -INFINITY if the tool has nothing
// there.
double kn_foot_below(const kn_probe_def *tool, double dx_m, double dy_m);

// Return how far the lowest point of the tool is below the pose, m.
double kn_foot_m(const kn_probe_def *tool);

#endif
