#ifndef KN_CLIENTS_VIEWER_RENDERER_H
#define KN_CLIENTS_VIEWER_RENDERER_H
// A picture of an object: its skin, lit from the left of whoever looks, with a cast shadow and the lines of the
// lattice; the probes and an arrow for what the hand feels; a table with squares of 1 cm (or the power of ten that
// fits). The skin may have the colours of numbers (scale.h), and the lattice may stand there as bare lines.
//
//     kn_renderer_open -> kn_renderer_mesh -> kn_renderer_draw, as often as positions come -> kn_renderer_close
//
// The same input gives the same bytes on the same Mesa. Frame: scene frame of proto/README.md, metres, z up. One
// thread; everything is allocated by open and mesh, nothing by draw (Mesa itself may, and the first picture of a tool
// that is a mesh).
#include "core/model.h"
#include <stdint.h>

typedef struct kn_renderer kn_renderer;

typedef struct kn_view_probe {
    kn_probe_def def;           // shape and size
    double position_m[3];       // of its pose, see core/shape.h; plate: centre of the face that touches
    double orientation_wxyz[4]; // all 0: level
    double force_n[3]; // on the tool; drawn beyond the tool, one square of the table per 5 N; none below 0.05 N
    bool outside;      // not in the model (no session yet, or latched): drawn pale and without a shadow
    bool held;         // hand_* say where the hand is that holds it
    double hand_position_m[3], hand_orientation_wxyz[4];
} kn_view_probe;

typedef enum kn_view_style {
    KN_VIEW_LINED, // the skin, and the lattice's lines on it
    KN_VIEW_SOLID, // the skin
    KN_VIEW_WIRE,  // the lattice's lines on the skin alone: seen through
    KN_VIEW_EDGES  // every edge of the lattice, inside, too
} kn_view_style;

typedef struct kn_view_scene {
    const float (*xyz)[3];        // [vertex_count] m, now
    const float *value;           // [vertex_count] place on the colour scale, 0..1; NaN: the object's colour. NULL: all
    int edge_count;               // for KN_VIEW_EDGES, else 0
    const float (*edge)[2][3];    // [edge_count] its ends, m
    const float (*edge_value)[2]; // [edge_count] theirs on the scale; NULL: the object's colour
    float color[3];               // of the object, sRGB 0..1
    double thickness_m; // of a flat object: to it a ball is a disc and a plate a line, 1 % less wide; 0: not flat
    int probe_count;    // 0 .. KN_PROBES_MAX
    kn_view_probe probe[KN_PROBES_MAX];
    double azimuth_deg;   // 0: from the front (-y), 90: from the right (+x)
    double elevation_deg; // 0: level, 90: from above
    kn_view_style style;
    bool follow;             // an object that has left its place, lifted or pushed, is in the picture with it
    const float (*frame)[3]; // [2] low, high: this box is in the picture instead, whatever happens. NULL: none
    double zoom;             // 2 shows half as much; 0: 1
    bool hands;              // where a hand is 0.5 mm or 3 degrees away from its tool, its outline shows it
    bool turns;              // framed for every azimuth, so that an object that is gone round stays as large
} kn_view_scene;

// Front above, so that both the top and the profile of a dent across the block show; dough's colour; lines; no probe.
kn_view_scene kn_view_scene_default(void);

// samples: of the solids, per pixel; 4 smooths their outlines, 1 halves the time. NULL and one sentence in error (see
// offscreen.h: size, library).
kn_renderer *kn_renderer_open(int width, int height, int samples, char *error, size_t error_size);

// The object's topology and its shape at rest, which decides creases (skin.h) and frames the camera: it stands still
// while the object is deformed. May be called again. False: not a mesh (skin.h) or out of memory; the old one is gone
// then.
bool kn_renderer_mesh(kn_renderer *renderer, int vertex_count, const float (*rest)[3], int triangle_count,
                      const int (*triangle)[3]);

// Draws and reads back: rgba [height][width][4], top row first. A mesh must have been given. Triangles with a
// vertex that is not finite are left out.
void kn_renderer_draw(kn_renderer *renderer, const kn_view_scene *scene, uint8_t *rgba);

// The bar on the table: its length, and where the middle of its nearer edge is in the picture, pixels from the upper
// left corner.
double kn_renderer_bar(const kn_renderer *renderer, float at[2]);

void kn_renderer_close(kn_renderer *renderer); // NULL is fine

#endif
