#ifndef KN_CLIENTS_TOOL_HEIGHT_H
#define KN_CLIENTS_TOOL_HEIGHT_H
// The underside of a level tool: the part that touches an object when the tool is lowered onto it.
//
//        sphere, capsule            plate, box, cross, cylinder
//            ___
//           /   \                      +---------+
//          |  o  |  pose               |         |
//           \___/   ^ kn_tool_height_m        +----o----+  pose: 0
//
// Rounded edges of a tool are treated as sharp; the error is at most the radius of the rounding. A union of shapes or a
// mesh counts as a flat tool, wherever it touches first, because this is the safer assumption.
#include "clients/knead_mesh.h"
#include "core/model.h"

// Return true if a tool of this shape touches a flat object with a face and not with a point.
bool kn_tool_height_flat(kn_probe_shape shape);

// Return the probe with this name. If `name` is NULL, return the first probe that is not flat, or the first probe if
// all are flat. Return NULL if there is no such probe.
const kn_probe_def *kn_tool_height_choose_tool(const kn_model_def *def, const char *name);

// Return the vertical distance from the tool's pose down to its underside, m, at the horizontal offset (dx_m, dy_m)
// from the pose. Return -INFINITY if no part of the tool is at that offset.
double kn_tool_height_below(const kn_probe_def *tool, double dx_m, double dy_m);

// Return the vertical distance from the tool's pose down to the lowest point of the tool, m.
double kn_tool_height_m(const kn_probe_def *tool);

// Heights of an object: of its surface at a point (x, y), and of a tool that touches it. They are computed from the
// surface mesh of the object.

// Return one flag per vertex of the scene's skin mesh, [vertex_count]: 1 if the vertex belongs to the top face, else 0.
// The caller frees the flags. The flags are needed because a plate touches only the top face. In a deep dent, vertices
// of other faces may be higher than those of the top face. Return NULL if out of memory.
uint8_t *kn_tool_height_top(const kn_model_def *def, int *vertex_count);

// Find the highest point where a vertical line at (x_m, y_m) meets the skin. The height of this point before a press
// minus its height after the press is the depth of the dent. Return false if the mesh is not complete, or if the line
// does not meet the mesh.
bool kn_tool_height_object(const kn_mesh *mesh, double x_m, double y_m, double *z_m);

// Find two heights for a level tool that moves straight down at (x_m, y_m). Both are z coordinates of the tool's pose.
// At `*first_m` the tool touches for the first time. At `*last_m` a flat tool would touch the lowest vertex of the top
// face under the tool. `top` is the result of kn_tool_height_top for this mesh. A round tool is tested against vertices
// only, so `*first_m` may be too low by up to spacing^2 / (8 radius). Return false if nothing is under the tool.
bool kn_tool_height_touch(const kn_mesh *mesh, const uint8_t *top, double spacing_m, const kn_probe_def *tool,
                          double x_m, double y_m, double *first_m, double *last_m);

#endif
