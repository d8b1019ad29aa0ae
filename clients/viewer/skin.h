#ifndef KN_CLIENTS_VIEWER_SKIN_H
#define KN_CLIENTS_VIEWER_SKIN_H
// The skin of an object made ready to be shaded: which corners of which triangles share a normal, and which sides of
// triangles are lines of the lattice. Decided once, at rest: decided anew in every picture, the flank of a dent would turn
// from smooth to creased in the middle of a press.
//
//     crease   two triangles that meet at more than 40 degrees at rest do not share normals: a block's edges stay sharp
//     line     sides are lines, but for the diagonal that two coplanar right triangles of one quad have in common
//
// Angles are measured on the rest shape that create() is given, normals on the shape of the moment.
#include <stdbool.h>

#define KN_SKIN_VERTICES_MAX (1 << 20) // a mesh on the wire may claim anything

typedef struct kn_skin {
    int vertex_count;
    int triangle_count;
    int group_count;   // normals
    int *triangle;     // [triangle_count][3] vertex numbers
    int *group;        // [triangle_count][3] normal of that corner
    bool *line;        // [triangle_count][3] is the side opposite that corner a line
    float *normal;     // [group_count][3] scratch of kn_skin_corners
    float rest_low[3]; // box around the rest shape, m
    float rest_high[3];
} kn_skin;

// Copies what it is given. NULL: memory short, more than KN_SKIN_VERTICES_MAX vertices or twice as many triangles, or a
// triangle that names a vertex that is not there.
kn_skin *kn_skin_create(int vertex_count, const float (*rest)[3], int triangle_count, const int (*triangle)[3]);
void kn_skin_destroy(kn_skin *skin); // NULL is fine

// Position and unit normal of every corner, out[triangle_count][3][6]; normals are weighted by the corner's angle, so that
// which way a quad is cut leaves no pattern. Degenerate triangles have no say; one with a position that is not finite is
// shrunk to a point.
void kn_skin_corners(kn_skin *skin, const float (*xyz)[3], float *out);

#endif
