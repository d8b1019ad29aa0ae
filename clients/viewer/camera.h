#ifndef KN_CLIENTS_VIEWER_CAMERA_H
#define KN_CLIENTS_VIEWER_CAMERA_H
// View of a scene: what a picture shows, and the camera. The camera looks at a box. Its distance is chosen so that the
// whole box and some empty space above the box are visible. This file also contains vectors and matrices for pictures.
// All functions are pure.
#include "core/model.h"
#include <math.h>
#include <stdbool.h>

typedef struct kn_view_probe {
    kn_probe_def def; // shape and size of the tool
    // Position of the tool (core/shape.h); for a plate: centre of the face that touches the object.
    double position_m[3];
    double orientation_wxyz[4]; // orientation of the tool, unit quaternion; all 0: the tool is level
    // Force on the tool. A force of 0.05 N or more is drawn as an arrow at the tool's upper end. The length of the
    // arrow is the side of one square of the table for every 5 N.
    double force_n[3];
    // True if the tool does not act on the object (no session yet, or a latched fault). Such a tool is drawn pale and
    // without a shadow.
    bool outside;
    bool held; // true if the fields hand_* give the pose of the hand that holds the tool
    double hand_position_m[3], hand_orientation_wxyz[4];
} kn_view_probe;

typedef enum kn_view_style {
    KN_VIEW_LINED, // the surface, with the lines of the lattice drawn on the surface
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
    // True: if the object was lifted or pushed away, the picture shows both the object's present place and its place at
    // rest.
    bool follow;
    // [2] low and high corner of a box that the picture shows instead of the object's place; NULL: the object's place
    const float (*frame)[3];
    double zoom; // magnification; 2: the picture shows half the width and height; 0 means 1
    bool hands;  // draw the outline of a hand that is at least 0.5 mm or 3 degrees away from its tool
    // True: the distance of the camera fits every azimuth, so that the object keeps its size while the camera turns.
    bool turns;
} kn_view_scene;

// Return the default view. The camera looks from the front and above, so that the picture shows both the top of the
// object and the profile of a dent. The colour is that of dough, lattice lines are on, and there are no probes.
kn_view_scene kn_view_scene_default(void);

// ---- camera

// Tangent of half the angle of view. The angle is 25 degrees from top to bottom, as of a telephoto lens, so that there
// is little perspective.
#define KN_CAMERA_TAN_HALF 0.2217f

typedef struct kn_camera_view { // direction and lens for looking at a box
    double azimuth_deg;         // 0: from the front (-y), 90: from the right
    double elevation_deg;       // 0: horizontal line of sight, 90: from above
    // Magnification of the lens at an unchanged eye point; 2: the picture shows half the width and height; 0 means 1.
    double zoom;
    bool turns;   // true: the distance fits every azimuth, so that the object keeps its size while the camera turns
    float aspect; // width / height of the picture
} kn_camera_view;

typedef struct kn_camera {
    float eye[3], right[3], up[3], back[3]; // eye point, m; unit axes of the picture
    float aspect;                           // width / height of the picture
    float tan_half;                         // tangent of half the angle of view, from top to bottom
    float matrix[16];                       // matrix from world to clip coordinates, column-major
} kn_camera;

// Place the camera so that it sees the whole box between the corners `low` and `high`.
void kn_camera_look(kn_camera *camera, const float low[3], const float high[3], const kn_camera_view *view);

// Compute the unit axes of a camera that looks from the direction azimuth_deg, elevation_deg.
void kn_camera_axes(double azimuth_deg, double elevation_deg, float right[3], float up[3], float back[3]);

// ---- vectors and matrices; matrices are column-major, as OpenGL reads them: m[4*column + row]

static inline float kn_dotf(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void kn_crossf(float out[3], const float a[3], const float b[3]) // `out` must not be `a` or `b`
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline float kn_normalizef(float v[3]) // returns the length before the call; a zero vector stays zero
{
    float length = sqrtf(kn_dotf(v, v));
    for (int i = 0; i < 3 && length > 0; i++) v[i] /= length;
    return length;
}

static inline void kn_mat_mul(float out[16], const float a[16], const float b[16]) // `out` must not be `a` or `b`
{
    for (int column = 0; column < 4; column++) {
        for (int row = 0; row < 4; row++) {
            float sum = 0;
            for (int k = 0; k < 4; k++) sum += a[4 * k + row] * b[4 * column + k];
            out[4 * column + row] = sum;
        }
    }
}

// Compute the matrix that converts world coordinates to the coordinates of a camera. The camera is at `eye` and has the
// unit axes right, up and back. It looks in the direction opposite to `back`.
static inline void kn_mat_view(float out[16], const float right[3], const float up[3], const float back[3],
                               const float eye[3])
{
    const float *axis[3] = {right, up, back};
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++) out[4 * column + row] = axis[row][column];
        out[12 + row] = -kn_dotf(axis[row], eye);
        out[4 * row + 3] = 0;
    }
    out[15] = 1;
}

#endif
