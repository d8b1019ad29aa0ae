#ifndef KN_CLIENTS_DENT_H
#define KN_CLIENTS_DENT_H
// Height of an object at a point of the plan view, and under a tool, computed from the surface mesh of the object.
#include "clients/knead_mesh.h"
#include "core/model.h"

// Return one flag per vertex of the scene's skin mesh, [vertex_count]: 1 if the vertex belongs to the top face, else 0.
// The caller frees the flags. The flags are needed because a plate touches only the top face. In a deep dent, vertices
// of other faces may be higher than those of the top face. Return NULL if out of memory.
uint8_t *kn_dent_top(const kn_model_def *def, int *vertex_count);

// Find the highest point where a vertical line at (x_m, y_m) meets the skin. The difference before and after a press is
// the depth of the dent. Return false if the mesh is not complete, or if the line does not meet the mesh.
bool kn_dent_height(const kn_mesh *mesh, double x_m, double y_m, double *z_m);

// Find two heights for a level tool that moves straight down at (x_m, y_m). Both are z coordinates of the tool's pose.
// At `*first_m` the tool touches for the first time. At `*last_m` a flat tool would touch the lowest vertex of the top
// face under the tool. `top` is the result of kn_dent_top for this mesh. A round tool is tested against vertices only,
// so between vertices `*first_m` is lower by up to spacing^2 / (8 radius). Return false if nothing is under the tool.
bool kn_dent_touch(const kn_mesh *mesh, const uint8_t *top, double spacing_m, const kn_probe_def *tool, double x_m,
                   double y_m, double *first_m, double *last_m);

#endif
