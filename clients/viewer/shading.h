#ifndef KN_CLIENTS_VIEWER_SHADING_H
#define KN_CLIENTS_VIEWER_SHADING_H
// Meshes and programs for shading. A shaded mesh is the surface of an object: the corners of triangles that share a
// normal, and the sides of triangles that are lines of the lattice. Both are determined once, at rest. If they were
// determined for every picture, the flank of a dent would turn from smooth to creased in the middle of a press.
//
//     crease   two triangles that meet at more than 40 degrees at rest do not share normals: a block's edges stay sharp
//     line     every side is a line, except the diagonal that two coplanar right triangles of one quad share
//
// Angles are measured on the rest shape given to kn_shaded_mesh_create, normals on the present shape.
#include "clients/viewer/offscreen.h"

// Largest number of vertices; a limit is needed because a mesh received from the bus may claim any size.
#define KN_SHADED_VERTICES_MAX (1 << 20)

typedef struct kn_shaded_mesh {
    int vertex_count;
    int triangle_count;
    int group_count; // number of normals; corners of triangles that share a normal form a group
    int *triangle;   // [triangle_count][3] numbers of the vertices of each triangle
    int *group;      // [triangle_count][3] number of the normal of each corner
    // [triangle_count][3] true: the triangle's side opposite the corner is drawn as a line of the lattice.
    bool *line;
    float *normal;     // [group_count][3] normals, scratch memory of kn_shaded_mesh_corners
    float rest_low[3]; // low corner of the box around the rest shape, m
    float rest_high[3];
} kn_shaded_mesh;

// Create a mesh from copies of the arrays. Return NULL if memory is short, if there are more than
// KN_SHADED_VERTICES_MAX vertices or twice as many triangles, or if a triangle names a vertex that does not exist.
kn_shaded_mesh *kn_shaded_mesh_create(int vertex_count, const float (*rest)[3], int triangle_count,
                                      const int (*triangle)[3]);
void kn_shaded_mesh_destroy(kn_shaded_mesh *mesh); // `mesh` may be NULL

// Compute position and unit normal of every corner, out[triangle_count][3][6]. A normal is the mean of the face
// normals, weighted by the corner's angle, so the direction of a quad's diagonal leaves no pattern. Degenerate
// triangles are ignored. A triangle with a position that is not finite is shrunk to a point.
void kn_shaded_mesh_corners(kn_shaded_mesh *mesh, const float (*xyz)[3], float *out);

// Triangles in OpenGL's memory, ready to be drawn: an object's surface, which is uploaded for every picture, or a unit
// solid. Tools, arrows and the table are made of unit solids. The memory is freed with the OpenGL context, and never
// deleted singly.
typedef struct kn_gl_mesh {
    // OpenGL names: `array`: vertex array; `buffer`: positions and normals; `sides`: distances of each corner from the
    // triangle sides that are drawn as lines; `values`: values on the colour scale.
    GLuint array, buffer, sides, values;
    int corners;
    float half, low, high; // extent of a solid of revolution: -half .. half along x and y, low .. high along z
} kn_gl_mesh;

kn_gl_mesh kn_gl_mesh_create(const kn_gl *gl); // create a mesh without triangles

// Upload triangles. `data`: [corners][6], position and unit normal.
void kn_gl_mesh_upload(const kn_gl *gl, kn_gl_mesh *mesh, int corners, const float *data, GLenum usage);

// Create a solid of revolution about z. profile[i] is {radius, z} from the bottom up, with at most 17 entries. There
// are at most 32 segments, and four segments make a box of radius sqrt(1/2). If memory is short, the mesh stays empty.
kn_gl_mesh kn_gl_mesh_revolve(const kn_gl *gl, int count, const float (*profile)[2], int segments);

// Programs that OpenGL runs per vertex and per pixel.
typedef struct kn_shader_programs {
    // depth: for the shadow map; solid: object and tools; table: the table near the object; bare: the part of the table
    // where no shadow falls; edge: edges of the lattice.
    GLuint depth, solid, table, bare, edge;
} kn_shader_programs;

// Compile and link all programs. If a shader is wrong or the context is not OpenGL 3.3, return false and put the
// compiler's message in error.
bool kn_shader_programs_create(const kn_gl *gl, kn_shader_programs *programs, char *error, size_t error_size);

#endif
