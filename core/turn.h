#ifndef KN_CORE_TURN_H
#define KN_CORE_TURN_H
// Orientations as quaternions w, x, y, z.
#include <math.h>

// Normalise a quaternion. If all components are 0, the result is identity.
static inline void kn_turn_unit(const double q[4], double out[4])
{
    double size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int k = 0; k < 4; k++) out[k] = size > 0.5 ? q[k] / size : k == 0;
}

// Compute the quaternion product out = a b, the rotation b followed by the rotation a. `out` must be neither `a` nor
// `b`.
static inline void kn_turn_multiply(const double a[4], const double b[4], double out[4])
{
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
    out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
    out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

// Compute the rotation that takes the orientation `from` to the orientation `to`: the quaternion product out from = to.
static inline void kn_turn_between(const double from[4], const double to[4], double out[4])
{
    const double back[4] = {from[0], -from[1], -from[2], -from[3]};
    kn_turn_multiply(to, back, out);
}

// Compute the rotation matrix of a unit quaternion.
static inline void kn_turn_matrix(const double q[4], double r[3][3])
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    r[0][0] = 1 - 2 * (y * y + z * z), r[0][1] = 2 * (x * y - w * z), r[0][2] = 2 * (x * z + w * y);
    r[1][0] = 2 * (x * y + w * z), r[1][1] = 1 - 2 * (x * x + z * z), r[1][2] = 2 * (y * z - w * x);
    r[2][0] = 2 * (x * z - w * y), r[2][1] = 2 * (y * z + w * x), r[2][2] = 1 - 2 * (x * x + y * y);
}

#endif
