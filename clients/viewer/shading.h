#ifndef KN_CLIENTS_VIEWER_SHADING_H
#define KN_CLIENTS_VIEWER_SHADING_H
// The things that the renderer draws: the shaded surface of an object, triangles and programs in OpenGL's memory
// (shading.c), and the solids of probes (drawn_probe.c).
#include "clients/viewer/camera.h"
#include "clients/viewer/offscreen.h"
#include "core/field.h"
#include "core/shape.h"

// ---- shaded mesh, triangles, programs: shading.c
//
// Meshes and programs for shading. A shaded mesh is the surface of an object: the corners of triangles that share a
// normal, and the sides of triangles that are lines of the lattice. Both are determined once, at rest. If they were
// determined for every picture, the flank of a dent would turn from smooth to creased in the middle of a press.
//
//     crease   two triangles that meet at more than 40 degrees at rest do not share normals: a block's edges stay sharp
//     line     every side is a line, except the diagonal that two coplanar right triangles of one quad share
//
// Angles are measured on the rest shape given to kn_shaded_mesh_create, normals on the present shape.

// Largest number of vertices. A limit is needed, because a mesh from the bus may claim any number.
#define KN_SHADED_VERTICES_MAX (1 << 20)

typedef struct kn_shaded_mesh {
    int vertex_count;
    int triangle_count;
    int group_count; // number of groups; a group consists of all corners that share one normal
    int *triangle;   // [triangle_count][3] indices of the vertices of each triangle
    int *group;      // [triangle_count][3] index of the group of each corner, and of its normal
    // [triangle_count][3] true: the triangle's side opposite the corner is drawn as a line of the lattice.
    bool *line;
    float *normal;     // [group_count][3] normals, scratch memory of kn_shaded_mesh_corners
    float rest_low[3]; // low corner of the box around the rest shape, m
    float rest_high[3];
} kn_shaded_mesh;

// Create a mesh from copies of the arrays. Return NULL if memory is short or a triangle names a vertex that does not
// exist. Also return NULL if the number of vertices is not 3 .. KN_SHADED_VERTICES_MAX, or the number of triangles not
// 1 .. 2 * KN_SHADED_VERTICES_MAX.
kn_shaded_mesh *kn_shaded_mesh_create(int vertex_count, const float (*rest)[3], int triangle_count,
                                      const int (*triangle)[3]);
void kn_shaded_mesh_destroy(kn_shaded_mesh *mesh); // `mesh` may be NULL

// Compute position and unit normal of every corner, out[triangle_count][3][6]. A normal is the mean of the face
// normals, weighted by the corner's angle, so the direction of a quad's diagonal causes no visible pattern. Degenerate
// triangles are ignored. A triangle with a position that is not finite is shrunk to a point.
void kn_shaded_mesh_corners(kn_shaded_mesh *mesh, const float (*xyz)[3], float *out);

// Triangles in OpenGL's memory, ready to be drawn. They are the surface of the object (uploaded for every picture), a
// tool that is a mesh, a unit solid, or the square of the table. All other tools and the arrows consist of unit solids.
// The memory is freed with the OpenGL context, and never deleted singly.
typedef struct kn_gl_mesh {
    // OpenGL names: `array`: vertex array; `buffer`: positions and normals; `sides`: distances of each corner from the
    // triangle sides that are drawn as lines; `values`: values on the colour scale.
    GLuint array, buffer, sides, values;
    int corners;
} kn_gl_mesh;

kn_gl_mesh kn_gl_mesh_create(const kn_gl *gl); // create a mesh without triangles

// Upload triangles. `data`: [corners][6], position and unit normal.
void kn_gl_mesh_upload(const kn_gl *gl, kn_gl_mesh *mesh, int corners, const float *data, GLenum usage);

// Create a solid of revolution about z. profile[i] is {radius, z} from the bottom up, with at most 17 entries.
// `segments`: at most 32; four segments and the radius sqrt(1/2) make a box with sides of length 1. If memory is short,
// the mesh stays empty.
kn_gl_mesh kn_gl_mesh_revolve(const kn_gl *gl, int count, const float (*profile)[2], int segments);

// Text of shaders.glsl, which both OpenGL 3.3 and WebGL 2 compile.
extern const char kn_shader_text[];

// Programs that OpenGL runs per vertex and per pixel.
typedef struct kn_shader_programs {
    // depth: for the shadow map; solid: object and tools; table; edge: edges of the lattice.
    GLuint depth, solid, table, edge;
} kn_shader_programs;

// Compile and link all programs. If a shader is wrong or the context is not OpenGL 3.3, return false and put the
// compiler's message in error.
bool kn_shader_programs_create(const kn_gl *gl, kn_shader_programs *programs, char *error, size_t error_size);

// ---- probes: drawn_probe.c
//
// Drawing of a probe: its unit solids, each turned, scaled and placed, its force arrow, and its hand. Rounded edges are
// drawn sharp, and a plate is drawn 2 mm thick. With a flat object, a ball is drawn as a disc and a plate as a line.

// Largest number of solids of a probe: a part that is a capsule consists of three solids.
#define KN_DRAWN_SOLIDS_MAX (3 * KN_PARTS_MAX)

typedef struct kn_drawn_shapes { // unit solids and tools in OpenGL's memory
    const kn_gl *gl;
    kn_gl_mesh box, ball, rod, cone;
    kn_gl_mesh mesh[KN_PROBES_MAX]; // triangles of each probe whose shape is a mesh file
    uint64_t hash[KN_PROBES_MAX];   // hash of the mesh file from which each element of `mesh` was uploaded
    double thickness_m;             // thickness of the flat object in the picture; 0: not flat
} kn_drawn_shapes;

typedef struct kn_drawn_solid { // a unit solid and the matrix that turns, scales and places it
    const kn_gl_mesh *shape;
    float place[16];
} kn_drawn_solid;

typedef struct kn_drawn_arrow {
    float tail[3], direction[3], length; // tail: position, m; direction: unit vector; length: m, 0 for no arrow
} kn_drawn_arrow;

kn_drawn_shapes kn_drawn_shapes_create(const kn_gl *gl);
// Upload those tool meshes of the scene that are not in OpenGL's memory yet.
void kn_drawn_shapes_load(kn_drawn_shapes *shapes, const kn_view_scene *scene);

// Fill in the solids of a probe. Return their number.
int kn_drawn_probe_solids(const kn_drawn_shapes *shapes, const kn_view_probe *probe,
                          kn_drawn_solid out[KN_DRAWN_SOLIDS_MAX]);

// Return the force arrow of a probe. `square_m`: side of the squares drawn on the table, m.
kn_drawn_arrow kn_drawn_probe_arrow(const kn_view_probe *probe, float square_m);

// Return the corners of a tool that is a mesh, [triangle_count][3][6]: position and unit normal. The caller frees them.
// Return NULL if memory is short.
float *kn_drawn_probe_corners(const kn_field *field);
// Return the height of the tool's upper end above the tool's origin, m.
double kn_drawn_probe_height(const kn_probe_def *def);
bool kn_drawn_probe_is_finite(const kn_view_probe *probe); // return true if all numbers of the pose are finite

// Set `hand` to a copy of the probe at the pose of its hand and without force, so that the hand can be drawn like a
// tool. Return false if the hand needs no outline: if the scene draws no hands, no hand holds the tool, the pose of the
// hand is not finite, or the hand is within 0.5 mm and 3 degrees of its tool.
bool kn_drawn_probe_hand(const kn_view_scene *scene, const kn_view_probe *probe, kn_view_probe *hand);

#endif
