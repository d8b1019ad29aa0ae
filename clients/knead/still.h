#ifndef KN_CLIENTS_STILL_H
#define KN_CLIENTS_STILL_H
// Still: all that the renderer needs to draw an object at one moment: shape at rest, present shape, triangles and
// tools. A still is filled from a state of this process, or from messages on the bus.
#include "clients/knead/live.h"
#include "clients/viewer/renderer.h"
#include "core/measure.h"
#include "core/shape.h"
#include "core/state.h"

typedef struct kn_still {
    int vertex_count, triangle_count;
    // Vertex positions [m]: `rest` in the shape at rest, `now` in the present shape; vertex_count elements each.
    float (*rest)[3], (*now)[3];
    int (*triangle)[3];
    // Copies of the shapes of tools that are unions. The copies are needed because the scene may be freed before the
    // tools are drawn.
    kn_shape tool[KN_PROBES_MAX];
    // Colour of the material, and poses of the tools. The caller sets the camera and the style.
    kn_view_scene view;
    // Value of a measure at each vertex, in the unit of the measure; NULL: no measure wanted.
    float *value;
    int edge_count; // number of edges of the lattice; 0: no edges wanted
    // Arrays of edge_count elements. edge: positions of both ends of each lattice edge [m]. edge_value: values of the
    // measure at both ends, or NULL.
    float (*edge)[2][3], (*edge_value)[2];
    char caption[128]; // text below the object, set by the caller
} kn_still;

// Fill a still from a state of the solver. `still` must be zeroed except for its field `view`. Return false when memory
// is short.
bool kn_still_state(kn_still *still, const kn_model *model, const kn_state *state);

// Add the values of the measure `what` at the vertices. If `edges` is true, also add the edges of the lattice. gauge:
// computes measures of `model`; NULL: add no measure, only the edges. Return false when memory is short.
bool kn_still_measure(kn_still *still, const kn_model *model, const kn_state *state, kn_gauge *gauge, kn_measure what,
                      bool edges);

// Add the values of the measure `what` to a still that was filled from the same `live`. The displacement is always
// known. Other measures are known only if the mesh messages contain them (mesh.measures of the scene). Return false if
// the measure is not known or memory is short. Memory is allocated at the first call only.
bool kn_still_told(kn_still *still, const kn_live *live, kn_measure what);

// Divide `value` and `edge_value` by `top` in place. The results are places on the renderer's colour scale, on which 1
// stands for `top`.
void kn_still_scale(kn_still *still, double top);
// Return the largest number in the arrays still->value and still->edge_value.
double kn_still_most(const kn_still *still);

// Fill a still from the messages in `live`. live->mesh must be complete. If the scene is missing or does not fit the
// mesh, write the reason to `error`, add no tools and use the present shape as the shape at rest. Otherwise `error` is
// "". Return false when memory is short.
bool kn_still_live(kn_still *still, const kn_live *live, char *error, size_t error_size);

// Update a still to the newest tick of its mesh. Show the tools that somebody holds. Nothing is allocated.
void kn_still_update(kn_still *still, const kn_live *live);

// Add a tool at this pose to a still. orientation_wxyz: unit quaternion; four zeros mean a level tool. gain: the tool's
// gain in kneadd; 0: the tool does not act on the object.
void kn_still_probe(kn_still *still, const kn_probe_def *def, const double position_m[3],
                    const double orientation_wxyz[4], const double force_n[3], double gain);

// Set the pose of the hand that holds the most recently added tool of the still.
void kn_still_hand(kn_still *still, const double position_m[3], const double orientation_wxyz[4]);
void kn_still_free(kn_still *still);

#endif
