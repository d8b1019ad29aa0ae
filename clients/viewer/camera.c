#include "clients/viewer/camera.h"
#include <string.h>

#define FILL 0.86f     // fraction of the picture's height or width that the box fills
#define HEADROOM 0.45f // space above the object for a lifted probe and its arrow, as a fraction of the object's height

kn_view_scene kn_view_scene_default(void)
{
    return (kn_view_scene){.color = {0.90f, 0.78f, 0.58f}, .azimuth_deg = 28, .elevation_deg = 27};
}

static void perspective_matrix(float out[16], float tan_half_y, float aspect, float near, float far)
{
    for (int i = 0; i < 16; i++) out[i] = 0;
    out[0] = 1 / (tan_half_y * aspect);
    out[5] = 1 / tan_half_y;
    out[10] = (far + near) / (near - far);
    out[11] = -1;
    out[14] = 2 * far * near / (near - far);
}

void kn_camera_axes(double azimuth_deg, double elevation_deg, float right[3], float up[3], float back[3])
{
    float a = (float)(azimuth_deg * M_PI / 180), e = (float)(elevation_deg * M_PI / 180);
    memcpy(right, (float[]){cosf(a), sinf(a), 0}, 3 * sizeof *right);
    memcpy(back, (float[]){sinf(a) * cosf(e), -cosf(a) * cosf(e), sinf(e)}, 3 * sizeof *back);
    kn_crossf(up, back, right);
}

// Return the smallest distance between the camera and the middle of a box at which the whole box is inside the picture.
// `half`: half the length of each side of the box.
static float distance_for(const float half[3], double azimuth_deg, double elevation_deg, float aspect)
{
    float right[3], up[3], back[3], distance = 0;
    kn_camera_axes(azimuth_deg, elevation_deg, right, up, back);
    for (int corner = 0; corner < 8; corner++) {
        const float p[3] = {corner & 1 ? half[0] : -half[0], corner & 2 ? half[1] : -half[1],
                            corner & 4 ? half[2] : -half[2]};
        // Move back until this corner is within the fraction FILL of the picture's half width and half height.
        const float x = fabsf(kn_dotf(p, right)) / aspect, y = fabsf(kn_dotf(p, up));
        distance = fmaxf(distance, kn_dotf(p, back) + fmaxf(x, y) / (FILL * KN_CAMERA_TAN_HALF));
    }
    return distance;
}

void kn_camera_look(kn_camera *c, const float low[3], const float high[3], const kn_camera_view *v)
{
    float target[3], half[3], scale = 1e-6f, top = high[2] + HEADROOM * (high[2] - low[2]), view[16], perspective[16];
    c->aspect = v->aspect;
    c->tan_half = KN_CAMERA_TAN_HALF / (float)(v->zoom > 0 ? v->zoom : 1);
    kn_camera_axes(v->azimuth_deg, v->elevation_deg, c->right, c->up, c->back);
    // Aim at the middle of the box and of the empty space above it (HEADROOM).
    for (int i = 0; i < 3; i++) {
        target[i] = 0.5f * (low[i] + (i == 2 ? top : high[i]));
        half[i] = target[i] - low[i];
        scale = fmaxf(scale, high[i] - low[i]);
    }
    float distance = distance_for(half, v->azimuth_deg, v->elevation_deg, v->aspect);
    // Try the azimuths of half a turn only, because a box looks the same from the opposite side.
    for (int deg = 0; v->turns && deg < 180; deg += 5)
        distance = fmaxf(distance, distance_for(half, deg, v->elevation_deg, v->aspect));
    for (int i = 0; i < 3; i++) c->eye[i] = target[i] + distance * c->back[i];
    kn_mat_view(view, c->right, c->up, c->back, c->eye);
    perspective_matrix(perspective, c->tan_half, v->aspect, 0.1f * distance, distance + 20 * scale);
    kn_mat_mul(c->matrix, perspective, view);
}
