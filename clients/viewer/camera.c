#include "clients/viewer/camera.h"
#include "clients/viewer/vec.h"
#include <math.h>
#include <string.h>

#define FILL 0.86f     // of the picture's height or width, by the box
#define HEADROOM 0.45f // of the object's height, above it, for a lifted probe and its arrow

void kn_camera_axes(double azimuth_deg, double elevation_deg, float right[3], float up[3], float back[3])
{
    float a = (float)(azimuth_deg * M_PI / 180), e = (float)(elevation_deg * M_PI / 180);
    memcpy(right, (float[]){cosf(a), sinf(a), 0}, 3 * sizeof *right);
    memcpy(back, (float[]){sinf(a) * cosf(e), -cosf(a) * cosf(e), sinf(e)}, 3 * sizeof *back);
    kn_cross(up, back, right);
}

// The nearest distance from which the whole framed box is inside the picture.
void kn_camera_aim(kn_camera *c, const float low[3], const float high[3], double azimuth_deg, double elevation_deg,
                   float aspect)
{
    float target[3], distance = 0, scale = 1e-6f, top = high[2] + HEADROOM * (high[2] - low[2]);
    c->aspect = aspect;
    kn_camera_axes(azimuth_deg, elevation_deg, c->right, c->up, c->back);
    for (int i = 0; i < 3; i++) {
        target[i] = 0.5f * (low[i] + (i == 2 ? top : high[i]));
        scale = fmaxf(scale, high[i] - low[i]);
    }
    for (int corner = 0; corner < 8; corner++) {
        float p[3] = {corner & 1 ? high[0] : low[0], corner & 2 ? high[1] : low[1], corner & 4 ? top : low[2]};
        kn_sub(p, p, target);
        float x = fabsf(kn_dot(p, c->right)) / aspect, y = fabsf(kn_dot(p, c->up));
        distance = fmaxf(distance, kn_dot(p, c->back) + fmaxf(x, y) / (FILL * KN_CAMERA_TAN_HALF));
    }
    for (int i = 0; i < 3; i++) c->eye[i] = target[i] + distance * c->back[i];
    float view[16], perspective[16];
    kn_mat_view(view, c->right, c->up, c->back, c->eye);
    kn_mat_perspective(perspective, KN_CAMERA_TAN_HALF, aspect, 0.1f * distance, distance + 20 * scale);
    kn_mat_mul(c->matrix, perspective, view);
}

bool kn_camera_pick(const kn_camera *c, double u, double v, double z_m, double at_m[2])
{
    double x = KN_CAMERA_TAN_HALF * c->aspect * (2.0 * u - 1.0), y = KN_CAMERA_TAN_HALF * (1.0 - 2.0 * v), sight[3];
    for (int i = 0; i < 3; i++) sight[i] = x * c->right[i] + y * c->up[i] - c->back[i];
    double far = (z_m - c->eye[2]) / sight[2];
    for (int i = 0; i < 2; i++) at_m[i] = c->eye[i] + far * sight[i];
    return sight[2] != 0.0 && far > 0.0;
}
