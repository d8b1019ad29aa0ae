#ifndef KN_TESTS_PERSON_H
#define KN_TESTS_PERSON_H
// The height at which a simulated person wants the handle: 35 mm down in 1 s, rest, lift, every 4 s.
#include <math.h>

static inline double kn_person_z(int ms, double *speed_m_s)
{
    const double turn = acos(-1.0), depth_m = 0.035;
    int t = ms % 4000;
    double down = t < 2500 ? 1.0 : -1.0;
    if (t >= 3500) t = 0;
    else if (t >= 2500) t = 3500 - t; // up: the way down, reversed
    *speed_m_s = t < 1000 ? -0.5 * depth_m * turn * sin(turn * 1e-3 * t) * down : 0.0;
    return t < 1000 ? -0.5 * depth_m * (1.0 - cos(turn * 1e-3 * t)) : -depth_m;
}

#endif
