#ifndef KN_CLIENTS_VIEWER_REGION_H
#define KN_CLIENTS_VIEWER_REGION_H
// The part of a picture that an object, its probes and their shadows take up: what is outside of it is the table as it
// is without them. Rather too large than too small.
#include "clients/viewer/camera.h"
#include "clients/viewer/tool.h"

typedef struct kn_region_def {
    const kn_camera *camera;
    const float *key; // towards the light, unit
    int width, height;
    float level_m, square_m; // of the table
    float dim_m;             // how far from the object it is darker
} kn_region_def;

// foot: low x, low y, high x, high y of where the object stands. all: whatever is not as without them; table: of that,
// what the table can be seen in, shadows and all.
void kn_region_find(const kn_region_def *def, const kn_tools *tools, const kn_view_scene *scene, int vertex_count,
                    const float foot[4], kn_gl_region *all, kn_gl_region *table);

#endif
