#ifndef KN_CLIENTS_VIEWER_SKIN_H
#define KN_CLIENTS_VIEWER_SKIN_H
// Surface of an object, prepared for shading: the corners of triangles that share a normal, and the sides of triangles
// that are lines of the lattice. Both are determined once, at rest. If they were determined for every picture, the
// flank of a dent would turn from smooth to creased in the middle of a press.
//
//     crease   two triangles that meet at more than 40 degrees at rest do not share normals: a block's edges stay sharp
//     line     every side is a line, except the diagonal that two coplanar right triangles of one quad share
//
// Angles are measured on the rest shape given to kn_skin_create, normals on the present shape.
#include <stdbool.h>

// Largest number of vertices; a limit is needed because a mesh received from the bus may claim any size.
#define KN_SKIN_VERTICES_MAX (1 << 20)

typedef struct kn_skin {
    int vertex_count;
    int triangle_count;
    int group_count; // number of normals; corners of triangles that share a normal form a group
    int *triangle;   // [triangle_count][3] numbers of the vertices of each triangle
    int *group;      // [triangle_count][3] number of the normal of each corner
    // [triangle_count][3] true: the triangle's side opposite the corner is drawn as a line of the lattice.
    bool *line;
    float *normal;     // [group_count][3] normals, scratch memory of kn_skin_corners
    float rest_low[3]; // low corner of the box around the rest shape, m
    float rest_high[3];
} kn_skin;

// Create a skin from copies of the arrays. Return NULL if memory is short, if there are more than KN_SKIN_VERTICES_MAX
// vertices or twice as many triangles, or if a triangle names a vertex that does not exist.
kn_skin *kn_skin_create(int vertex_count, const float (*rest)[3], int triangle_count, const int (*triangle)[3]);
void kn_skin_destroy(kn_skin *skin); // `skin` may be NULL

// Compute position and unit normal of every corner, out[triangle_count][3][6]. A normal is the mean of the face
// normals, weighted by the corner's angle, so the direction of a quad's diagonal leaves no pattern. Degenerate
// triangles are ignored. A triangle with a position that is not finite is shrunk to a point.
void kn_skin_corners(kn_skin *skin, const float (*xyz)[3], float *out);

#endif
