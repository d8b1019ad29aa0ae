#include "clients/knead/pad.h"
#include <math.h>

// The values of dough are those of a lattice edge in the project's first paper, for an area of 1 cm^2. The values of
// clay and jelly are chosen relative to dough.
const kn_pad_def kn_pads[KN_PADS] = {
    {.name = "wall"},
    {.name = "dough",
     .k1_n_m = 188.0,
     .c1_n_s_m = 1000.0,
     .c2_n_s_m = 15700.0,
     .c2_least_n_s_m = 48.0,
     .from_n = 0.044,
     .to_n = 0.39},
    {.name = "clay",
     .k1_n_m = 3000.0,
     .c1_n_s_m = 300.0,
     .c2_n_s_m = 2e5,
     .c2_least_n_s_m = 150.0,
     .from_n = 0.5,
     .to_n = 2.0},
    {.name = "jelly", .k1_n_m = 50.0, .c1_n_s_m = 0.5},
    {.name = "stiff-jelly", .k1_n_m = 1000.0, .c1_n_s_m = 2.0},
};

void kn_pad_init(kn_pad *pad, const kn_pad_def *def) { *pad = (kn_pad){.def = *def}; }

// Return the damping c2 at a force. c2 falls exponentially from c2_n_s_m at from_n to c2_least_n_s_m at to_n.
static double c2_of(const kn_pad_def *d, double force_n)
{
    if (d->c2_n_s_m == 0.0) return INFINITY;
    double share = fmin(fmax((force_n - d->from_n) / (d->to_n - d->from_n), 0.0), 1.0);
    return d->c2_n_s_m * pow(d->c2_least_n_s_m / d->c2_n_s_m, share);
}

// Solve F (1 + G/A + G/c2(F)) = Q + G H/A for the contact force F (symbols: see pad.h). The left side grows with F, so
// bisection finds the root. 50 halvings reach the precision of a double.
static double meet(const kn_pad_def *d, double q, double g, double h, double a)
{
    double target = q + g * h / a;
    // Without c2, and for F <= 0, the equation is linear.
    if (d->c2_n_s_m == 0.0 || target <= 0.0) return target / (1.0 + g / a);
    double low = 0.0, high = target;
    for (int i = 0; i < 50; i++) {
        double mid = 0.5 * (low + high);
        if (mid * (1.0 + g / a + g / c2_of(d, mid)) < target) low = mid;
        else high = mid;
    }
    return 0.5 * (low + high);
}

double kn_pad_tick(kn_pad *pad, const kn_coupling *coupling, double dt_s, double depth_m, double speed_m_s)
{
    const kn_pad_def *d = &pad->def;
    bool wall = d->k1_n_m == 0.0 && d->c1_n_s_m == 0.0;
    // A wall has A = infinity, so its Voigt element never moves.
    double a = wall ? INFINITY : d->c1_n_s_m + dt_s * d->k1_n_m, h = d->k1_n_m * pad->voigt_m;
    // Compute the depth of the device below the deformed surface, and the terms Q and G of the force law F = Q - G w in
    // pad.h.
    double out_m = depth_m - pad->voigt_m - pad->flow_m;
    double q = coupling->stiffness_n_m * out_m + coupling->damping_n_s_m * speed_m_s;
    double g = coupling->damping_n_s_m + dt_s * coupling->stiffness_n_m;
    // Contact begins when the device is below the surface. Contact then lasts until the force is zero, even if the
    // device is above the surface, because the coupling's damper can still press.
    double force = out_m > 0.0 || pad->touching ? meet(d, q, g, h, a) : 0.0;
    // A negative contact force would pull the tool into the pad, so contact ends instead.
    pad->force_n = fmax(force, 0.0);
    pad->touching = pad->force_n > 0.0;
    // Implicit Euler step: the Voigt element and the damper c2 move with the force at the end of the step.
    pad->voigt_m += dt_s * (pad->force_n - h) / a;
    pad->flow_m += dt_s * pad->force_n / c2_of(d, pad->force_n);
    return pad->force_n;
}

double kn_pad_stored_j(const kn_pad *pad) { return 0.5 * pad->def.k1_n_m * pad->voigt_m * pad->voigt_m; }

double kn_pad_touch(void *contact, const double position_m[3], const double velocity_m_s[3], double force_n[3])
{
    kn_pad_contact *c = contact;
    force_n[0] = force_n[1] = 0.0;
    force_n[2] = kn_pad_tick(&c->pad, &c->coupling, 1e-3, -position_m[2], -velocity_m_s[2]);
    return kn_pad_stored_j(&c->pad);
}
