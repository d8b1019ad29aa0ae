#ifndef KN_CLIENTS_VIEWER_RENDERER_H
#define KN_CLIENTS_VIEWER_RENDERER_H
// Renderer of an object: its surface, lit from the left of the viewer, with a cast shadow and the lines of the lattice;
// the probes, with an arrow for the force on the hand; and a table with squares of 1 cm (or the power of ten that
// fits). The surface may be coloured by values (label.h), and the lattice may be shown as bare lines.
//
//     kn_renderer_open -> kn_renderer_mesh -> kn_renderer_draw for each picture -> kn_renderer_close
//
// The same input gives the same bytes on the same Mesa. The frame is the scene frame of proto/README.md, in metres, z
// up. Use from one thread only. kn_renderer_open and kn_renderer_mesh allocate everything, and kn_renderer_draw
// allocates nothing. Exceptions are Mesa itself and the first picture of a tool that is a mesh.
#include "core/model.h"
#include <stdint.h>

typedef struct kn_renderer kn_renderer;

typedef struct kn_view_probe {
    kn_probe_def def; // shape and size of the tool
    // Position of the tool (core/shape.h); for a plate: centre of the face that touches the object.
    double position_m[3];
    double orientation_wxyz[4]; // orientation of the tool, unit quaternion; all 0: the tool is level
    // Force on the tool. Drawn as an arrow beyond the tool, with a length of one square of the table per 5 N. There is
    // no arrow below 0.05 N.
    double force_n[3];
    // True if the tool does not act on the object (no session yet, or a latched fault); drawn pale and without a
    // shadow.
    bool outside;
    bool held; // true if the fields hand_* give the pose of the hand that holds the tool
    double hand_position_m[3], hand_orientation_wxyz[4];
} kn_view_probe;

typedef enum kn_view_style {
    KN_VIEW_LINED, // the surface with the lines of the lattice on it
    KN_VIEW_SOLID, // the surface without lines
    KN_VIEW_WIRE,  // only the lines of the lattice on the surface; the surface between the lines is transparent
    KN_VIEW_EDGES  // every edge of the lattice, including those inside the object
} kn_view_style;

typedef struct kn_view_scene {
    const float (*xyz)[3]; // [vertex_count] present positions, m
    // [vertex_count] values on the colour scale, 0..1; NaN: the object's colour. NULL: all vertices have the object's
    // colour
    const float *value;
    int edge_count;            // number of edges, for KN_VIEW_EDGES; otherwise 0
    const float (*edge)[2][3]; // [edge_count] ends of each edge, m
    // [edge_count] values on the colour scale at the two ends of each edge; NULL: the object's colour.
    const float (*edge_value)[2];
    float color[3]; // colour of the object, sRGB 0..1
    // Thickness of a flat object, m; 0: not flat. On a flat object, a ball is drawn as a disc and a plate as a line,
    // both 1 % thinner than the object.
    double thickness_m;
    int probe_count; // number of probes, 0 .. KN_PROBES_MAX
    kn_view_probe probe[KN_PROBES_MAX];
    double azimuth_deg;   // 0: from the front (-y), 90: from the right (+x)
    double elevation_deg; // 0: horizontal line of sight, 90: from above
    kn_view_style style;
    // If true, an object that was lifted or pushed away from its first place stays in the picture, and so does the
    // first place.
    bool follow;
    // [2]: low and high corner of a box that is framed instead of the object. NULL: frame the object
    const float (*frame)[3];
    double zoom; // magnification; 2: the picture shows half the width and height; 0 means 1
    bool hands;  // draw the outline of a hand that is at least 0.5 mm or 3 degrees away from its tool
    // Use a camera distance that fits every azimuth, so that the object keeps its size while the camera turns.
    bool turns;
} kn_view_scene;

// Return the default view: from the front and above, to show both the top and the profile of a dent across the block.
// The colour is that of dough, lattice lines are on, and there are no probes.
kn_view_scene kn_view_scene_default(void);

// Open a renderer. `samples`: number of samples per pixel for the solids (tools, arrows); 4 samples smooth the
// outlines, and 1 sample halves the drawing time. On failure (size, library; see offscreen.h) return NULL and put one
// sentence in error.
kn_renderer *kn_renderer_open(int width, int height, int samples, char *error, size_t error_size);

// Set the object's topology and its rest shape. The rest shape determines the creases (shading.h) and the camera's
// position, so the camera does not move while the object is deformed. May be called again. Return false if the mesh is
// invalid (shading.h) or memory is short; the old mesh is then gone.
bool kn_renderer_mesh(kn_renderer *renderer, int vertex_count, const float (*rest)[3], int triangle_count,
                      const int (*triangle)[3]);

// Draw a picture and read it back: rgba [height][width][4], top row first. A mesh must have been set. Triangles with a
// vertex that is not finite are left out.
void kn_renderer_draw(kn_renderer *renderer, const kn_view_scene *scene, uint8_t *rgba);

// Return the length of the bar on the table, m. Set `at` to the middle of the bar's edge that is nearer to the viewer,
// as a position in the last picture, pixels from the upper left corner.
double kn_renderer_bar(const kn_renderer *renderer, float at[2]);

void kn_renderer_close(kn_renderer *renderer); // `renderer` may be NULL

#endif
