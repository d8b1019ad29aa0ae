#ifndef KN_CLIENTS_VIEWER_CAMERA_H
#define KN_CLIENTS_VIEWER_CAMERA_H
// Camera that looks at a box from a distance at which all of the box is visible, with some empty space above the box;
// vectors and matrices for pictures. All functions are pure.
#include <math.h>
#include <stdbool.h>

#define KN_CAMERA_TAN_HALF                                                                                             \
    0.2217f // tangent of half the angle of view: 25 degrees from top to bottom, a telephoto with little perspective

typedef struct kn_camera_view { // direction and lens for looking at a box
    double azimuth_deg;         // 0: from the front (-y), 90: from the right
    double elevation_deg;       // 0: horizontal line of sight, 90: from above
    // Magnification of the lens at an unchanged eye point; 2: the picture shows half the width and height; 0 means 1.
    double zoom;
    bool turns;   // use a distance that fits every azimuth, so that the object keeps its size while the camera turns
    float aspect; // width / height of the picture
} kn_camera_view;

typedef struct kn_camera {
    float eye[3], right[3], up[3], back[3]; // eye point, m; unit axes of the picture
    float aspect;                           // width / height of the picture
    float tan_half;                         // tangent of half the angle of view, from top to bottom
    float matrix[16];                       // world to clip coordinates, column-major
} kn_camera;

// Place the camera for the box between low and high.
void kn_camera_look(kn_camera *camera, const float low[3], const float high[3], const kn_camera_view *view);

// Intersect the line of sight through (u, v) of the picture with the plane z = z_m. u and v are 0..1 from the upper
// left corner. Return false if the intersection is not in front of the eye.
bool kn_camera_pick(const kn_camera *camera, double u, double v, double z_m, double at_m[2]);

// Compute the unit axes of a camera that looks from the direction azimuth_deg, elevation_deg.
void kn_camera_axes(double azimuth_deg, double elevation_deg, float right[3], float up[3], float back[3]);

// ---- vectors and matrices; matrices are column-major, as OpenGL reads them: m[4*column + row]

static inline float kn_dotf(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void kn_crossf(float out[3], const float a[3], const float b[3]) // out must be neither a nor b
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline float kn_normalizef(float v[3]) // returns the former length; a zero vector stays zero
{
    float length = sqrtf(kn_dotf(v, v));
    for (int i = 0; i < 3 && length > 0; i++) v[i] /= length;
    return length;
}

static inline void kn_mat_mul(float out[16], const float a[16], const float b[16]) // out must be neither a nor b
{
    for (int column = 0; column < 4; column++) {
        for (int row = 0; row < 4; row++) {
            float sum = 0;
            for (int k = 0; k < 4; k++) sum += a[4 * k + row] * b[4 * column + k];
            out[4 * column + row] = sum;
        }
    }
}

// Transform from the world to a frame with these unit axes, which looks along -z from eye.
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
