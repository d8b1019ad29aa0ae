#ifndef KN_CORE_SIX_H
#define KN_CORE_SIX_H
// The six motions (v, w) of a rigid body: Cholesky solver for small symmetric positive systems, velocities, wrenches.
#include <math.h>

// Factor the matrix `a` in place. Only the lower half is read; it becomes the factor.
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

// Add sign (force, arm x force) to the wrench.
static inline void kn_six_wrench(const double arm[3], const double force[3], double sign, double wrench[6])
{
    for (int k = 0; k < 3; k++) wrench[k] += sign * force[k];
    wrench[3] += sign * (arm[1] * force[2] - arm[2] * force[1]);
    wrench[4] += sign * (arm[2] * force[0] - arm[0] * force[2]);
    wrench[5] += sign * (arm[0] * force[1] - arm[1] * force[0]);
}

#endif
