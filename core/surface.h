#ifndef KN_CORE_SURFACE_H
#define KN_CORE_SURFACE_H
// The skin of the object as triangles: for meshes on the wire and for drawing. Topology is fixed when the model is. A
// flat block is drawn as thick as it is: its one layer of nodes has a vertex in front and one behind.
#include "core/state.h"

typedef struct kn_surface {
    int vertex_count;
    int triangle_count;
    int *node;        // [vertex_count] node id of each vertex
    double *across_m; // [vertex_count] from the node to the vertex, along y
    int *triangle;    // [triangle_count][3] vertex numbers, counter-clockwise from outside
} kn_surface;

kn_surface *kn_surface_create(const kn_model *model); // NULL when memory is short
void kn_surface_destroy(kn_surface *surface);
// Where a vertex is at rest, m.
void kn_surface_rest(const kn_surface *s, const kn_model *model, int vertex, double x_m[3]);
// xyz[vertex_count][3], m. Real-time safe.
void kn_surface_positions(const kn_surface *s, const kn_model *model, const kn_state *state, float *xyz);

#endif
