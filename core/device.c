#include "core/device.h"
#include <math.h>
#include <stddef.h>

// Compute the rotation matrix of a quaternion of any length.
static void turn(const double q[4], double r[3][3])
{
    double s = 2.0 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), w = q[0], x = q[1], y = q[2], z = q[3];
    r[0][0] = 1.0 - s * (y * y + z * z), r[0][1] = s * (x * y - w * z), r[0][2] = s * (x * z + w * y);
    r[1][0] = s * (x * y + w * z), r[1][1] = 1.0 - s * (x * x + z * z), r[1][2] = s * (y * z - w * x);
    r[2][0] = s * (x * z - w * y), r[2][1] = s * (y * z + w * x), r[2][2] = 1.0 - s * (x * x + y * y);
}

// Compute the matrix of the signed permutation B from `basis` (device.h).
static void permute(const double basis[3], double b[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) b[i][k] = fabs(basis[i]) == k + 1 ? copysign(1.0, basis[i]) : 0.0;
}

const char *kn_device_check(const kn_device_def *d)
{
    double b[3][3], q2 = 0.0;
    // check that B is a right-handed permutation and R a unit quaternion
    permute(d->basis, b);
    double det = b[0][0] * (b[1][1] * b[2][2] - b[1][2] * b[2][1]) - b[0][1] * (b[1][0] * b[2][2] - b[1][2] * b[2][0]) +
                 b[0][2] * (b[1][0] * b[2][1] - b[1][1] * b[2][0]);
    for (int k = 0; k < 4; k++) q2 += d->rotation_wxyz[k] * d->rotation_wxyz[k];
    if (det == 0.0) return "the basis is not a permutation, expected 1, 2 and 3 in any order, some negative";
    if (det < 0.0) return "the basis is left-handed, expected one sign changed";
    if (!(fabs(q2 - 1.0) <= 1e-6)) return "the rotation is not a unit quaternion, expected [w, x, y, z] of length 1";
    return NULL;
}

void kn_device_axes(const kn_device_def *device, double axes[3][3])
{
    double r[3][3], b[3][3];
    turn(device->rotation_wxyz, r);
    permute(device->basis, b);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) axes[i][k] = r[i][0] * b[0][k] + r[i][1] * b[1][k] + r[i][2] * b[2][k];
}

void kn_device_velocity(const kn_device_def *device, const double device_m_s[3], double scene_m_s[3])
{
    double a[3][3];
    kn_device_axes(device, a);
    for (int i = 0; i < 3; i++)
        scene_m_s[i] = device->scale * (a[i][0] * device_m_s[0] + a[i][1] * device_m_s[1] + a[i][2] * device_m_s[2]);
}

void kn_device_position(const kn_device_def *device, const double device_m[3], double scene_m[3])
{
    kn_device_velocity(device, device_m, scene_m);
    for (int i = 0; i < 3; i++) scene_m[i] += device->position_m[i];
}

void kn_device_force(const kn_device_def *device, const double scene_n[3], double device_n[3])
{
    // the transposed matrix turns scene axes into device axes
    double a[3][3];
    kn_device_axes(device, a);
    for (int k = 0; k < 3; k++) device_n[k] = a[0][k] * scene_n[0] + a[1][k] * scene_n[1] + a[2][k] * scene_n[2];
}
