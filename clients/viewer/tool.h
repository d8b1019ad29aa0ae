#ifndef KN_CLIENTS_VIEWER_TOOL_H
#define KN_CLIENTS_VIEWER_TOOL_H
// Drawing of a probe: its unit solids, each turned, scaled and placed, its force arrow, and its hand. Rounded edges are
// drawn sharp, and a plate is 2 mm thick. Over a flat object, a ball is drawn as a disc.
#include "clients/viewer/form.h"
#include "clients/viewer/renderer.h"
#include "core/shape.h"

#define KN_TOOL_SOLIDS_MAX (3 * KN_PARTS_MAX) // a capsule takes three solids

typedef struct kn_tools { // forms in OpenGL's memory
    const kn_gl *gl;
    kn_form box, ball, rod, cone;
    kn_form mesh[KN_PROBES_MAX];  // forms of tools that are mesh files, by probe
    uint64_t hash[KN_PROBES_MAX]; // hash of each mesh file
    double thickness_m;           // thickness of the flat object in the picture; 0: not flat
} kn_tools;

typedef struct kn_tool_solid { // a unit solid and its placement
    const kn_form *shape;
    float place[16];
} kn_tool_solid;

typedef struct kn_tool_arrow {
    float tail[3], direction[3], length; // m; unit vector; m. length 0: no arrow
} kn_tool_arrow;

kn_tools kn_tools_create(const kn_gl *gl);
void kn_tools_load(kn_tools *tools, const kn_view_scene *scene); // upload tool meshes that are new

// Fill in the solids of a probe. Return their number.
int kn_tool_solids(const kn_tools *tools, const kn_view_probe *probe, kn_tool_solid out[KN_TOOL_SOLIDS_MAX]);
kn_tool_solid kn_tool_ball(const kn_tools *tools, const float at_m[3], double radius_m);

// Return the force arrow of a probe. square_m: side of the table's squares.
kn_tool_arrow kn_tool_arrow_of(const kn_view_probe *probe, float square_m);

bool kn_tool_somewhere(const kn_view_probe *probe); // return whether the pose is finite

// Make the hand a tool without force, for drawing. Return false if no hand holds the tool, or the hand is where its
// tool is.
bool kn_tool_hand(const kn_view_scene *scene, const kn_view_probe *probe, kn_view_probe *hand);

#endif
