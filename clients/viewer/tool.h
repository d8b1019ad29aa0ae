#ifndef KN_CLIENTS_VIEWER_TOOL_H
#define KN_CLIENTS_VIEWER_TOOL_H
// What a probe is drawn with: unit solids, each turned, stretched and put in its place; the arrow of its force; its
// hand. Rounded edges are sharp, a plate is 2 mm thick, and to a flat object a ball is a disc.
#include "clients/viewer/form.h"
#include "clients/viewer/renderer.h"
#include "core/shape.h"

#define KN_TOOL_SOLIDS_MAX (3 * KN_PARTS_MAX) // a capsule is three

typedef struct kn_tools { // in OpenGL's memory
    const kn_gl *gl;
    kn_form box, ball, rod, cone;
    kn_form mesh[KN_PROBES_MAX];  // of tools that are files, where a probe is one
    uint64_t hash[KN_PROBES_MAX]; // of which
    double thickness_m;           // of the flat object that is drawn; 0: none
} kn_tools;

typedef struct kn_tool_solid { // a unit shape, and where it is
    const kn_form *shape;
    float place[16];
} kn_tool_solid;

typedef struct kn_tool_arrow {
    float tail[3], direction[3], length; // m, unit, m; length 0: none
} kn_tool_arrow;

kn_tools kn_tools_create(const kn_gl *gl);
void kn_tools_load(kn_tools *tools, const kn_view_scene *scene); // meshes that were not seen before

// How many.
int kn_tool_solids(const kn_tools *tools, const kn_view_probe *probe, kn_tool_solid out[KN_TOOL_SOLIDS_MAX]);
kn_tool_solid kn_tool_ball(const kn_tools *tools, const float at_m[3], double radius_m);

// square_m: of the table.
kn_tool_arrow kn_tool_arrow_of(const kn_view_probe *probe, float square_m);

bool kn_tool_somewhere(const kn_view_probe *probe); // its pose is finite

// The hand as a tool without force. False: it is where its tool is, or nobody's.
bool kn_tool_hand(const kn_view_scene *scene, const kn_view_probe *probe, kn_view_probe *hand);

#endif
