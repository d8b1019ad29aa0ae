#ifndef KN_CLIENTS_VIEWER_DRAWN_PROBE_H
#define KN_CLIENTS_VIEWER_DRAWN_PROBE_H
// Drawing of a probe: its unit solids, each turned, scaled and placed, its force arrow, and its hand. Rounded edges are
// drawn sharp, and a plate is 2 mm thick. Over a flat object, a ball is drawn as a disc.
//
// Region: the part of a picture that an object, its probes and their shadows cover. Outside the region, the picture
// shows the empty table. The region may be too large, but never too small.
#include "clients/viewer/camera.h"
#include "clients/viewer/shading.h"
#include "core/shape.h"

// Largest number of solids of a probe: a part that is a capsule consists of three solids.
#define KN_DRAWN_SOLIDS_MAX (3 * KN_PARTS_MAX)

typedef struct kn_drawn_shapes { // unit solids and tools in OpenGL's memory
    const kn_gl *gl;
    kn_gl_mesh box, ball, rod, cone;
    kn_gl_mesh mesh[KN_PROBES_MAX]; // those tools whose shape is a mesh file, one per probe
    uint64_t hash[KN_PROBES_MAX];   // hash of the mesh file behind each element of `mesh`
    double thickness_m;             // thickness of the flat object in the picture; 0: not flat
} kn_drawn_shapes;

typedef struct kn_drawn_solid { // a unit solid and its placement
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

bool kn_drawn_probe_is_finite(const kn_view_probe *probe); // return true if all numbers of the pose are finite

// Set `hand` to a copy of the probe at the pose of its hand and without force, so that the hand can be drawn like a
// tool. Return false if no hand holds the tool, or if the hand is at the pose of its tool.
bool kn_drawn_probe_hand(const kn_view_scene *scene, const kn_view_probe *probe, kn_view_probe *hand);

typedef struct kn_dirty_region_def {
    const kn_camera *camera;
    const float *key; // unit vector towards the light that casts the shadows
    int width, height;
    float level_m, square_m; // level_m: height (z) of the table, m; square_m: side of the squares drawn on the table, m
    float dim_m;             // distance from the object within which the table is darkened, m
} kn_dirty_region_def;

// Find two regions. `foot`: low x, low y, high x, high y of the object's footprint. `all`: everything that differs from
// the empty table. `table`: the part of `all` in which the table itself differs, by shadow or darkening.
void kn_dirty_region_find(const kn_dirty_region_def *def, const kn_drawn_shapes *shapes, const kn_view_scene *scene,
                          int vertex_count, const float foot[4], kn_gl_region *all, kn_gl_region *table);

#endif
