#ifndef KN_CLIENTS_OBJECT_STILL_H
#define KN_CLIENTS_OBJECT_STILL_H
// Still: all that the renderer needs to draw an object at one moment: shape at rest, present shape, triangles and
// tools. A still is filled from a state of this process, or from messages on the bus.
#include "clients/hand/live_server.h"
#include "clients/viewer/label.h"
#include "clients/viewer/renderer.h"
#include "core/lattice/measure.h"
#include "core/shape.h"
#include "core/state.h"

typedef struct kn_object_still {
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
    char caption[128]; // text at the upper left of the picture, set by the caller
} kn_object_still;

// Fill a still from a state of the solver. `still` must be zeroed except for its field `view`. Return false when memory
// is short.
bool kn_object_still_state(kn_object_still *still, const kn_model *model, const kn_state *state);

// Add the values of the measure `what` at the vertices. If `edges` is true, also add the edges of the lattice. gauge:
// the gauge that computes measures of `model`; NULL: add the edges without a measure. Return false when memory is
// short.
bool kn_object_still_measure(kn_object_still *still, const kn_model *model, const kn_state *state, kn_gauge *gauge,
                             kn_measure what, bool edges);

// Add the values of the measure `what` to a still that was filled from the same `live`. The displacement is always
// known. Other measures are known only if the mesh messages contain them (mesh.measures of the scene). Return false if
// the measure is not known or memory is short. Memory is allocated at the first call only.
bool kn_object_still_told(kn_object_still *still, const kn_live_server *live, kn_measure what);

// Divide `value` and `edge_value` by `top` in place. The results are positions on the renderer's colour scale, which
// ends at 1.
void kn_object_still_scale(kn_object_still *still, double top);
// Return the largest number in the arrays still->value and still->edge_value.
double kn_object_still_most(const kn_object_still *still);

// Fill a still from the messages in `live`. live->mesh must be complete. If the scene is missing or does not fit the
// mesh, write the reason to `error`, add no tools and use the present shape as the shape at rest. Otherwise `error` is
// "". Return false when memory is short.
bool kn_object_still_live(kn_object_still *still, const kn_live_server *live, char *error, size_t error_size);

// Update a still to the newest tick of the mesh messages, and show the tools that hands hold. Nothing is allocated.
void kn_object_still_update(kn_object_still *still, const kn_live_server *live);

// Add a tool at this pose to a still. orientation_wxyz: unit quaternion; four zeros mean a level tool. gain: the tool's
// gain in kneadd; 0: the tool does not act on the object.
void kn_object_still_probe(kn_object_still *still, const kn_probe_def *def, const double position_m[3],
                           const double orientation_wxyz[4], const double force_n[3], double gain);

// Set the pose of the hand that holds the most recently added tool of the still.
void kn_object_still_hand(kn_object_still *still, const double position_m[3], const double orientation_wxyz[4]);
// Copy the skin (surface mesh) of a still, with room for one value per vertex. `to` must be zeroed except for its field
// `view`. Return false when memory is short.
bool kn_object_still_copy(kn_object_still *to, const kn_object_still *from);
void kn_object_still_free(kn_object_still *still);

// Comparison of two objects vertex by vertex. Each vertex of the second object is matched with the nearest vertex of
// the first object at rest. If both objects have the same mesh, the two vertices of a match coincide at rest. The
// distance tells how far two matched vertices have moved apart: |(x2 - X2) - (x1 - X1)|, where x is the present
// position and X the position at rest.

typedef struct kn_vertex_match {
    int count;  // number of vertices of the second object
    int *first; // index of the matching vertex of the first object, for each vertex of the second object, [count]
    bool same;  // true: the two vertices of every match lie at the same place at rest
    // Largest distance at rest from a vertex of either object to the nearest vertex of the other object, m.
    double apart_m;
} kn_vertex_match;

// Match the vertices of two objects. Return false with one sentence in error if out of memory, or if apart_m is larger
// than the edge length of the coarser mesh can explain.
bool kn_vertex_match_make(kn_vertex_match *match, const kn_object_still *first, const kn_object_still *second,
                          char *error, size_t error_size);
// Return true if the match can still be used: the second object has the same number of vertices as before, and the
// first object has all vertices that the match refers to.
bool kn_vertex_match_fits(const kn_vertex_match *match, const kn_object_still *first, const kn_object_still *second);

// For every vertex of the second object, compute how far it has moved apart from its matched vertex of the first
// object, m, into value[count].
void kn_vertex_match_distance(const kn_vertex_match *match, const kn_object_still *first, const kn_object_still *second,
                              float *value);
void kn_vertex_match_free(kn_vertex_match *match); // a struct that is all zero is allowed

// Shot: maker of pictures of stills. A shot renders the object and writes caption, scale bar and legend on the picture.

typedef struct kn_object_picture kn_object_picture;

// Open a shot (a maker of pictures). width, height: size of the pictures, pixels. samples: as for kn_renderer_open.
// Return NULL and one sentence in `error` on failure.
kn_object_picture *kn_object_picture_open(int width, int height, int samples, char *error, size_t error_size);

// Text on the picture. PLAIN: none. NAMED: name of the object and length of the scale bar. LEGEND: as NAMED, and the
// legend of the colours.
typedef enum kn_object_picture_words {
    KN_OBJECT_PICTURE_PLAIN,
    KN_OBJECT_PICTURE_NAMED,
    KN_OBJECT_PICTURE_LEGEND
} kn_object_picture_words;

// Draw a still into rgba[height][width][4]. scale: colour scale of still->value; NULL: the object has its own colour.
// The function replaces the still's values by positions on the colour scale. Return false and one sentence in `error`
// on failure.
bool kn_object_picture_take(kn_object_picture *shot, kn_object_still *still, const kn_scale *scale,
                            kn_object_picture_words words, uint8_t *rgba, char *error, size_t error_size);
// Free a shot (a maker of pictures). NULL is allowed.
void kn_object_picture_close(kn_object_picture *shot);

// The options --color WHAT and --top QUANTITY of `knead view` and `knead export`.

#define KN_MEASURE_WORDS "displacement|stress|residual" // the names of kn_measure

// Read a moment of a recording into the double at `at_s`: seconds, or INFINITY for "end". Return NULL. If `text` is not
// a valid value, return a text that says what was expected.
const char *kn_moment_take(void *at_s, const char *text);

// Read the upper end of the colour scale from `text`. Return the value in the SI unit of the measure, 1e-9 .. 1e12, or
// 0 if `text` is not a valid value.
double kn_measure_top(kn_measure measure, const char *text);
const char *kn_measure_top_example(kn_measure measure); // example of a scale end for help texts, like "'2 mm'"

// Return the upper end of the colour scale. If `asked` is not 0, return `asked`. Otherwise return a round number that
// is not below `most`, the largest value of the data. This number has a lower limit for each measure, so that an object
// at rest does not show rounding errors as colours.
double kn_measure_scale(kn_measure measure, double asked, double most);

#endif
