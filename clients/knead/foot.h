#ifndef KN_CLIENTS_FOOT_H
#define KN_CLIENTS_FOOT_H
// The underside of a level tool: what it touches an object with that it is lowered onto.
//
//        sphere, capsule            plate, box, cross, cylinder
//            ___
//           /   \                      +---------+
//          |  o  |  pose               |         |
//           \___/   ^ kn_foot_m        +----o----+  pose: 0
//
// Rounded edges count as sharp: that they are less is at most the rounding. A union or a mesh counts as flat, the more
// careful of the two, wherever it touches first.
#include "core/model.h"

// Of the shapes: lies on an object with a face, not with a point.
bool kn_foot_flat(kn_probe_shape shape);

// How far below its pose the underside is (dx, dy) from it, m. -INFINITY: the tool has nothing there.
double kn_foot_below(const kn_probe_def *tool, double dx_m, double dy_m);

// The same of its lowest point.
double kn_foot_m(const kn_probe_def *tool);

#endif
