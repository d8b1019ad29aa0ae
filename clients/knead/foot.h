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
// Rounded edges of a tool are treated as sharp; the error is at most the radius of the rounding. A union of shapes or a
// mesh counts as a flat tool, wherever it touches first, because this is the safer assumption.
#include "core/model.h"

// Return true if a tool of this shape touches a flat object with a face and not with a point.
bool kn_foot_flat(kn_probe_shape shape);

// Return the named probe. Without a name, return the first probe that is not flat, else the first probe; NULL if none.
const kn_probe_def *kn_foot_choose_tool(const kn_model_def *def, const char *name);

// Return the vertical distance from the tool's pose down to its underside, m, at the horizontal offset (dx_m, dy_m)
// from the pose. Return -INFINITY if no part of the tool is at that offset.
double kn_foot_below(const kn_probe_def *tool, double dx_m, double dy_m);

// Return the vertical distance from the tool's pose down to the lowest point of the tool, m.
double kn_foot_m(const kn_probe_def *tool);

#endif
