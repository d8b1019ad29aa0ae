#ifndef KN_CLIENTS_VIEWER_TOOL_H
#define KN_CLIENTS_VIEWER_TOOL_H
// Drawing of a probe: its unit solids, each turned, scaled and placed, its force arrow, and its hand. Rounded edges are
// drawn sharp, and a plate is 2 mm thick. Over a flat object, a ball is drawn as a disc.
#include "clients/viewer/form.h"
#include "clients/viewer/renderer.h"
#include "core/shape.h"

// Largest number of solids of a probe: a part that is a capsule consists of three solids.
#define KN_TOOL_SOLIDS_MAX (3 * KN_PARTS_MAX)

typedef struct kn_tools { // forms in OpenGL's memory
    const kn_gl *gl;
    kn_form box, ball, rod, cone;
    kn_form mesh[KN_PROBES_MAX];  // forms of those tools whose shape is a mesh file, one per probe
    uint64_t hash[KN_PROBES_MAX]; // hash of the mesh file behind each form in `mesh`
    double thickness_m;           // thickness of the flat object in the picture; 0: not flat
} kn_tools;

typedef struct kn_tool_solid { // a unit solid and its placement
    const kn_form *shape;
    float place[16];
} kn_tool_solid;

typedef struct kn_tool_arrow {
    float tail[3], direction[3], length; // tail: position, m; direction: unit vector; length: m, 0 for no arrow
} kn_tool_arrow;

kn_tools kn_tools_create(const kn_gl *gl);
// Upload those tool meshes of the scene that are not in OpenGL's memory yet.
void kn_tools_load(kn_tools *tools, const kn_view_scene *scene);

// Fill in the solids of a probe. Return their number.
int kn_tool_solids(const kn_tools *tools, const kn_view_probe *probe, kn_tool_solid out[KN_TOOL_SOLIDS_MAX]);
kn_tool_solid kn_tool_ball(const kn_tools *tools, const float at_m[3], double radius_m);

// Return the force arrow of a probe. `square_m`: side of the squares drawn on the table, m.
kn_tool_arrow kn_tool_arrow_of(const kn_view_probe *probe, float square_m);

bool kn_tool_somewhere(const kn_view_probe *probe); // return true if all numbers of the pose are finite

// Set `hand` to a copy of the probe at the pose of its hand and without force, so that the hand can be drawn like a
// tool. Return false if no hand holds the tool, or if the hand is at the pose of its tool.
bool kn_tool_hand(const kn_view_scene *scene, const kn_view_probe *probe, kn_view_probe *hand);

#endif
