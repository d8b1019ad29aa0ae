#ifndef KN_CLIENTS_STILL_H
#define KN_CLIENTS_STILL_H
// An object at one moment, complete for the renderer: shape at rest, shape now, triangles, tools. Filled from a state
// that was stepped here, or from what is heard on the bus.
#include "clients/knead/live.h"
#include "clients/viewer/renderer.h"
#include "core/gauge.h"
#include "core/shape.h"
#include "core/state.h"

typedef struct kn_still {
    int vertex_count, triangle_count;
    float (*rest)[3], (*now)[3]; // [vertex_count] m
    int (*triangle)[3];
    kn_shape tool[KN_PROBES_MAX]; // what view's unions are made of: the scene may be gone before they are drawn
    kn_view_scene view; // colour of the material and the tools; where from and in which style are the caller's
    float *value;       // [vertex_count] of a measure, in its unit; NULL: none was asked for
    int edge_count;     // every edge of the lattice, when they were asked for
    float (*edge)[2][3], (*edge_value)[2]; // [edge_count] ends, m; their measure, or NULL
    char caption[128];                     // the caller's
} kn_still;

// All return false when memory is short. still: zeroed but for view.
bool kn_still_state(kn_still *still, const kn_model *model, const kn_state *state);

// The same state's measure at the vertices and, with edges, the lattice inside. gauge: of that model; NULL: edges only.
bool kn_still_measure(kn_still *still, const kn_model *model, const kn_state *state, kn_gauge *gauge, kn_measure what,
                      bool edges);

// The measure of a still that is of the mesh in live: displacement always, the others when it tells them (the scene's
// mesh.measures). False: it does not, or memory is short. Allocates nothing the second time.
bool kn_still_told(kn_still *still, const kn_live *live, kn_measure what);

// Places on a colour scale from 0 to top for the renderer, out of value and edge_value, which they replace.
void kn_still_scale(kn_still *still, double top);
double kn_still_most(const kn_still *still); // of value and edge_value

// What live has heard; live->mesh must be whole. error says what is missing when the scene does not go with the mesh,
// "" else: then there are no tools, and the shape of now stands for that at rest.
bool kn_still_live(kn_still *still, const kn_live *live, char *error, size_t error_size);

// The same mesh at its newest tick, with the tools that somebody holds. Allocates nothing.
void kn_still_update(kn_still *still, const kn_live *live);

// orientation_wxyz: all 0 is level.
void kn_still_probe(kn_still *still, const kn_probe_def *def, const double position_m[3],
                    const double orientation_wxyz[4], const double force_n[3], double gain);

// Where the hand is that holds the tool that was added last.
void kn_still_hand(kn_still *still, const double position_m[3], const double orientation_wxyz[4]);
void kn_still_free(kn_still *still);

#endif
