#ifndef KN_CORE_SURFACE_H
#define KN_CORE_SURFACE_H
// The skin of the object as triangles, for mesh messages and for drawing. The topology is fixed once the model is
// built. A flat block is drawn with its thickness: each node of its one layer has a vertex in front and one behind.
#include "core/state.h"

typedef struct kn_surface {
    int vertex_count;
    int triangle_count;
    int *node;        // [vertex_count] id of the node that each vertex moves with
    double *across_m; // [vertex_count] offset along y from the node to its vertex
    int *triangle;    // [triangle_count][3] vertex numbers, counter-clockwise from outside
} kn_surface;

kn_surface *kn_surface_create(const kn_model *model); // NULL: memory is short
void kn_surface_destroy(kn_surface *surface);
// Store the position of a vertex of the undeformed object, m.
void kn_surface_rest(const kn_surface *s, const kn_model *model, int vertex, double x_m[3]);
// Store the present positions of all vertices in xyz[vertex_count][3], m. Real-time safe.
void kn_surface_positions(const kn_surface *s, const kn_model *model, const kn_state *state, float *xyz);

#endif
