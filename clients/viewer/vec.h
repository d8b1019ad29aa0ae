#ifndef KN_CLIENTS_VIEWER_VEC_H
#define KN_CLIENTS_VIEWER_VEC_H
// Vector and matrix functions for pictures. Matrices are column-major, as OpenGL reads them: m[4*column + row].
#include <math.h>

static inline float kn_dot(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline void kn_sub(float out[3], const float a[3], const float b[3])
{
    for (int i = 0; i < 3; i++) out[i] = a[i] - b[i];
}

static inline void kn_cross(float out[3], const float a[3], const float b[3]) // out must be neither a nor b
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline float kn_normalize(float v[3]) // returns the former length; a zero vector stays zero
{
    float length = sqrtf(kn_dot(v, v));
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
        out[12 + row] = -kn_dot(axis[row], eye);
        out[4 * row + 3] = 0;
    }
    out[15] = 1;
}

static inline void kn_mat_perspective(float out[16], float tan_half_y, float aspect, float near, float far)
{
    for (int i = 0; i < 16; i++) out[i] = 0;
    out[0] = 1 / (tan_half_y * aspect);
    out[5] = 1 / tan_half_y;
    out[10] = (far + near) / (near - far);
    out[11] = -1;
    out[14] = 2 * far * near / (near - far);
}

static inline void kn_mat_orthographic(float out[16], float half, float near, float far)
{
    for (int i = 0; i < 16; i++) out[i] = 0;
    out[0] = out[5] = 1 / half;
    out[10] = 2 / (near - far);
    out[14] = (far + near) / (near - far);
    out[15] = 1;
}

#endif
