#ifndef KN_CLIENTS_DENT_H
#define KN_CLIENTS_DENT_H
// How high an object stands, from its mesh.
#include "clients/knead_mesh.h"
#include "core/model.h"

// Which vertices of the scene's mesh belong to the top face: [vertex_count] 0 or 1, for the caller to free. A plate
// touches these alone, and under a deep dent others may stand higher. NULL when memory is short.
uint8_t *kn_dent_top(const kn_model_def *def, int *vertex_count);

// Where a vertical line at (x_m, y_m) meets the skin, the highest such point. Before - after a press: the dent's depth.
// False: the mesh is not whole, or has nothing there.
bool kn_dent_height(const kn_mesh *mesh, double x_m, double y_m, double *z_m);

// Positions z of a level tool that comes straight down at (x_m, y_m): where it touches first, and, of a flat one, where
// it would touch the lowest node of the top under it. top: of kn_dent_top, for this mesh. Round ones see vertices only:
// between them they touch up to spacing^2 / (8 radius) later. False: nothing under it.
bool kn_dent_touch(const kn_mesh *mesh, const uint8_t *top, double spacing_m, const kn_probe_def *tool, double x_m,
                   double y_m, double *first_m, double *last_m);

#endif
