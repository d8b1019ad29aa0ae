#ifndef KN_CLIENTS_VIEWER_REGION_H
#define KN_CLIENTS_VIEWER_REGION_H
// Region: the part of a picture that an object, its probes and their shadows cover. Outside the region, the picture
// shows the empty table. The region may be too large, but never too small.
#include "clients/viewer/camera.h"
#include "clients/viewer/tool.h"

typedef struct kn_region_def {
    const kn_camera *camera;
    const float *key; // unit vector towards the light that casts the shadows
    int width, height;
    float level_m, square_m; // level_m: height (z) of the table, m; square_m: side of the squares drawn on the table, m
    float dim_m;             // distance from the object within which the table is darkened, m
} kn_region_def;

// Find two regions. `foot`: low x, low y, high x, high y of the object's footprint. `all`: everything that differs from
// the empty table. `table`: the part of `all` in which the table itself differs, by shadow or darkening.
void kn_region_find(const kn_region_def *def, const kn_tools *tools, const kn_view_scene *scene, int vertex_count,
                    const float foot[4], kn_gl_region *all, kn_gl_region *table);

#endif
