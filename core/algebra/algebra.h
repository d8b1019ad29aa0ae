#ifndef KN_CORE_ALGEBRA_ALGEBRA_H
#define KN_CORE_ALGEBRA_ALGEBRA_H
// Linear algebra in three and six dimensions: vectors, orientations as quaternions w, x, y, z, and the motions (v, w)
// of a rigid body. Every sum adds the components from the first to the last, so all callers get the same bits.
#include <math.h>
#include <stdint.h>

// --- vectors --------------------------------------------------------------------------------------------------------

static inline double kn_dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Compute the cross product out = a x b. `out` must be neither `a` nor `b`.
static inline void kn_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

// --- orientations ---------------------------------------------------------------------------------------------------

// Normalise a quaternion. If it is shorter than 0.5, for example 0, the result is identity.
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

// Compute the rotation that takes the orientation `from` to the orientation `to`. The quaternion product of `out` and
// `from` is then `to`.
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

// --- motions of a rigid body ----------------------------------------------------------------------------------------

// Compute the Cholesky factor of the symmetric positive matrix `a` in place. Only the lower half is read; it becomes
// the factor.
static inline void kn_six_factor(double a[6][6])
{
    for (int i = 0; i < 6; i++)
        for (int k = 0; k <= i; k++) {
            double sum = a[i][k];
            for (int j = 0; j < k; j++) sum -= a[i][j] * a[k][j];
            a[i][k] = i == k ? sqrt(sum) : sum / a[k][k];
        }
}

// Solve a x = b with the Cholesky factor of the matrix a. b becomes the solution x.
static inline void kn_six_solve(const double factor[6][6], double b[6])
{
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < i; k++) b[i] -= factor[i][k] * b[k];
        b[i] /= factor[i][i];
    }
    for (int i = 5; i >= 0; i--) {
        for (int k = i + 1; k < 6; k++) b[i] -= factor[k][i] * b[k];
        b[i] /= factor[i][i];
    }
}

// Compute the velocity of a point at `arm` from the body's reference point.
static inline void kn_six_velocity(const double v[6], const double arm[3], double at[3])
{
    at[0] = v[0] + (v[4] * arm[2] - v[5] * arm[1]);
    at[1] = v[1] + (v[5] * arm[0] - v[3] * arm[2]);
    at[2] = v[2] + (v[3] * arm[1] - v[4] * arm[0]);
}

// Add a force that acts at `arm` from the reference point to a wrench (force, torque). With `sign` = -1, subtract the
// force.
static inline void kn_six_wrench(const double arm[3], const double force[3], double sign, double wrench[6])
{
    for (int k = 0; k < 3; k++) wrench[k] += sign * force[k];
    wrench[3] += sign * (arm[1] * force[2] - arm[2] * force[1]);
    wrench[4] += sign * (arm[2] * force[0] - arm[0] * force[2]);
    wrench[5] += sign * (arm[0] * force[1] - arm[1] * force[0]);
}

// --- order of numbers -----------------------------------------------------------------------------------------------

// Comparison functions for qsort, ascending. Doubles must not be NaN.
static inline int kn_ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static inline int kn_ascending_i64(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

#endif
