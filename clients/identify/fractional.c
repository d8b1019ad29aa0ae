#include "clients/identify/fractional.h"
#include <complex.h>
#include <math.h>

// number of nodes of the Talbot inversion; each node adds 0.6 digits, but the rounding error grows as exp(0.4 NODES),
// so more nodes would lose accuracy
enum { NODES = 18 };

// The contour of the Talbot inversion at time t = 1, and the two terms of 1/Z at the nodes of the contour.
typedef struct contour {
    const kn_fractional_maxwell_maxwell *f;
    double complex node[NODES], weight[NODES], part_v[NODES], part_g[NODES];
} contour;

// Compute the nodes and weights of the Talbot contour, and the powers of p that depend on the orders only.
static void prepare(contour *c, const kn_fractional_maxwell_maxwell *f)
{
    const double r = 0.4 * NODES, pi = acos(-1.0);
    c->f = f;
    c->node[0] = r;
    c->weight[0] = 0.5 * exp(r) * r / NODES;
    for (int k = 1; k < NODES; k++) {
        const double angle = k * pi / NODES, cot = 1 / tan(angle);
        c->node[k] = r * angle * (cot + I);
        c->weight[k] = r / NODES * cexp(c->node[k]) * (1 + I * (angle + (angle * cot - 1) * cot));
    }
    for (int k = 0; k < NODES; k++) {
        c->part_v[k] = cpow(c->node[k], -f->v_order) / f->v_pa_s;
        c->part_g[k] = cpow(c->node[k], -f->g_order) / f->g_pa_s;
    }
}

// Invert the transform at time t. `times` is the number of integrations: 0 for the modulus, 1 for its integral from 0
// to t.
static double invert(const contour *c, double t, int times)
{
    const double v = pow(t, c->f->v_order), g = pow(t, c->f->g_order);
    double sum = 0;
    for (int k = 0; k < NODES; k++) {
        double complex at = c->weight[k] / (c->node[k] * (c->part_v[k] * v + c->part_g[k] * g));
        if (times) at *= t / c->node[k];
        sum += creal(at);
    }
    return sum;
}

static double after_ramp(const contour *c, double ramp, double t)
{
    // a short ramp acts like a step at its middle, to second order in ramp/t
    if (ramp < 1e-4 * t) return invert(c, t + ramp / 2, 0);
    return (invert(c, t + ramp, 1) - (t > 0 ? invert(c, t, 1) : 0)) / ramp;
}

void kn_fractional_maxwell_relax(const kn_fractional_maxwell_maxwell *f, double ramp_s, int count, const double *time_s,
                                 double *modulus_pa)
{
    contour c;
    prepare(&c, f);
    for (int i = 0; i < count; i++) modulus_pa[i] = after_ramp(&c, ramp_s, time_s[i]);
}
