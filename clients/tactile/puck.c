#include "clients/tactile/puck.h"
#include <math.h>
#include <string.h>

// lag_s: time constant of the lag between puck and tool. dt_s: time that one call of step() covers.
static const double lag_s = 0.05, dt_s = 1e-3;

void kn_puck_init(kn_puck *p, const kn_puck_def *def)
{
    *p = (kn_puck){.def = *def, .pose.orientation_wxyz = {1.0}};
    if (!(p->def.speed_m_s > 0.0)) p->def.speed_m_s = 0.05;
    if (p->def.dead <= 0) p->def.dead = 15;
    if (!(p->def.reach_m > 0.0)) p->def.reach_m = 0.08;
    p->def.floor_m = fmin(fmax(p->def.floor_m, -p->def.reach_m), p->def.reach_m);
}

// Return the deflection as a fraction of full deflection, -1 .. 1. Return 0 inside the dead zone.
static double share(const kn_puck *p, int counts)
{
    double beyond = fabs((double)counts) - p->def.dead;
    if (beyond <= 0.0) return 0.0;
    return copysign(fmin(1.0, beyond / (KN_PUCK_FULL - p->def.dead)), counts);
}

// Rotate the orientation q by the angles w dt about the device's axes. Normalise q afterwards, because rounding errors
// add up.
static void turn(double q[4], const double w[3])
{
    double speed = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), half = 0.5 * speed * dt_s;
    double s = speed > 0.0 ? sin(half) / speed : 0.0, d[4] = {cos(half), s * w[0], s * w[1], s * w[2]};
    double out[4] = {
        d[0] * q[0] - d[1] * q[1] - d[2] * q[2] - d[3] * q[3], d[0] * q[1] + d[1] * q[0] + d[2] * q[3] - d[3] * q[2],
        d[0] * q[2] - d[1] * q[3] + d[2] * q[0] + d[3] * q[1], d[0] * q[3] + d[1] * q[2] - d[2] * q[1] + d[3] * q[0]};
    double size = sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2] + out[3] * out[3]);
    for (int i = 0; i < 4; i++) q[i] = out[i] / size;
}

static void step(kn_puck *p, const int counts[6])
{
    double *x = p->pose.position_m, *v = p->pose.velocity_m_s, gain = dt_s / lag_s;
    // Smooth the wanted speed and twist with the first-order lag. Then move the tool and keep each coordinate within
    // its limits.
    for (int i = 0; i < 3; i++) {
        double low = i == 2 ? p->def.floor_m : -p->def.reach_m, high = p->def.reach_m;
        v[i] += gain * (p->def.speed_m_s * share(p, counts[i]) - v[i]);
        p->turning_rad_s[i] += gain * (p->def.turn_rad_s * share(p, counts[3 + i]) - p->turning_rad_s[i]);
        double to = fmin(fmax(x[i] + v[i] * dt_s, low), high);
        // The actual velocity, which is smaller than the wanted one if the tool has reached a limit.
        v[i] = (to - x[i]) / dt_s;
        x[i] = to;
    }
    turn(p->pose.orientation_wxyz, p->turning_rad_s);
}

void kn_puck_tick(kn_puck *p, const int counts[6], int elapsed_ms)
{
    // After a stall of this process, move the tool for 5 ms at most, because a longer movement would be a jump.
    for (int ms = 0; ms < (elapsed_ms < 5 ? elapsed_ms : 5); ms++) step(p, counts);
}
