#ifndef KN_CLIENTS_VIEWER_CAMERA_H
#define KN_CLIENTS_VIEWER_CAMERA_H
// Where a picture is looked at from: far enough that a box is inside it, with some air above. Pure.
#include <stdbool.h>

#define KN_CAMERA_TAN_HALF                                                                                             \
    0.2217f // of the angle of view: 25 degrees from top to bottom, a telephoto's calm perspective

typedef struct kn_camera_view { // how to look at a box
    double azimuth_deg;         // 0: from the front (-y), 90: from the right
    double elevation_deg;       // 0: level, 90: from above
    double zoom;                // lens, not place: 2 shows half as much; 0: 1
    bool turns;                 // far enough for every azimuth, so that nothing breathes while it goes round
    float aspect;               // width / height of the picture
} kn_camera_view;

typedef struct kn_camera {
    float eye[3], right[3], up[3], back[3]; // m; unit axes
    float aspect;                           // width / height of the picture
    float tan_half;                         // of half the angle of view, from top to bottom
    float matrix[16];                       // world to clip coordinates, column-major
} kn_camera;

// low, high: the box.
void kn_camera_look(kn_camera *camera, const float low[3], const float high[3], const kn_camera_view *view);

// The same without zoom, from one place.
void kn_camera_aim(kn_camera *camera, const float low[3], const float high[3], double azimuth_deg, double elevation_deg,
                   float aspect);

// Where the sight line through (u, v) of the picture, 0..1 from its upper left corner, meets the plane z = z_m. False:
// not in front of the eye.
bool kn_camera_pick(const kn_camera *camera, double u, double v, double z_m, double at_m[2]);

// Axes of someone who looks from there.
void kn_camera_axes(double azimuth_deg, double elevation_deg, float right[3], float up[3], float back[3]);

#endif
