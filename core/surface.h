#ifndef KN_CORE_SURFACE_H
#define KN_CORE_SURFACE_H
// The skin of the block as triangles: for meshes on the wire and for drawing. Topology is fixed when the model is.
#include "core/state.h"

typedef struct kn_surface {
    int vertex_count;
    int triangle_count;
    int *node;     // [vertex_count] node id of each vertex
    int *triangle; // [triangle_count][3] vertex numbers, counter-clockwise from outside
} kn_surface;

kn_surface *kn_surface_create(const kn_model *model); // NULL when memory is short
void kn_surface_destroy(kn_surface *surface);
// xyz[vertex_count][3], m. Real-time safe.
void kn_surface_positions(const kn_surface *s, const kn_model *model, const kn_state *state, float *xyz);

#endif
