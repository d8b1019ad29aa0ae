#ifndef KN_CORE_VEC_H
#define KN_CORE_VEC_H
// Products of two 3-vectors. They are summed from the first component on, so all callers get the same bits.

static inline double kn_dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Compute the cross product out = a x b. `out` must be neither `a` nor `b`.
static inline void kn_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

#endif
