#include "clients/knead/pad.h"
#include <math.h>

// The numbers of dough are the first paper's edge under 1 cm^2; clay and jelly are chosen beside it.
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

static double c2_of(const kn_pad_def *d, double force_n)
{
    if (d->c2_n_s_m == 0.0) return INFINITY;
    double share = fmin(fmax((force_n - d->from_n) / (d->to_n - d->from_n), 0.0), 1.0);
    return d->c2_n_s_m * pow(d->c2_least_n_s_m / d->c2_n_s_m, share);
}

// F (1 + G/A + G/c2(F)) = Q + G H/A. The left side grows with F, so halving finds it, 50 times to a double's digits.
static double meet(const kn_pad_def *d, double q, double g, double h, double a)
{
    double target = q + g * h / a;
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
    double a = wall ? INFINITY : d->c1_n_s_m + dt_s * d->k1_n_m, h = d->k1_n_m * pad->voigt_m;
    double out_m = depth_m - pad->voigt_m - pad->flow_m;
    double q = coupling->stiffness_n_m * out_m + coupling->damping_n_s_m * speed_m_s;
    double g = coupling->damping_n_s_m + dt_s * coupling->stiffness_n_m;
    double force = out_m > 0.0 || pad->touching ? meet(d, q, g, h, a) : 0.0;
    pad->force_n = fmax(force, 0.0);
    pad->touching = pad->force_n > 0.0;
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
