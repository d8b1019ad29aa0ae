#ifndef KN_CORE_SURFACE_H
#define KN_CORE_SURFACE_H
// The skin of the object as triangles, for mesh messages and for drawing. The triangles stay the same while the object
// deforms; only their vertices move. A flat block is drawn with its thickness: each node of its single layer has a
// vertex in front of it and a vertex behind it.
#include "core/state.h"

typedef struct kn_surface {
    int vertex_count;
    int triangle_count;
    int *node;        // [vertex_count] id of the node with which each vertex moves
    double *across_m; // [vertex_count] offset along y from the node to its vertex
    int *triangle;    // [triangle_count][3] vertex numbers, counter-clockwise from outside
} kn_surface;

kn_surface *kn_surface_create(const kn_model *model); // allocate; the caller destroys; NULL: memory is short
void kn_surface_destroy(kn_surface *surface);         // does nothing if `surface` is NULL
// Store the position of a vertex in the undeformed object, m.
void kn_surface_rest(const kn_surface *s, const kn_model *model, int vertex, double x_m[3]);
// Store the present positions of all vertices in xyz[vertex_count][3], m. Real-time safe.
void kn_surface_positions(const kn_surface *s, const kn_model *model, const kn_state *state, float *xyz);

#endif
