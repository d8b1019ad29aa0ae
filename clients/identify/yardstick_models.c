// The yardsticks among the constitutive models: the fractional Maxwell model, and the logarithm of time.
#include "clients/identify/constitutive_models.h"
#include <complex.h>
#include <math.h>
#include <stdlib.h>

// NODES: number of nodes of the Talbot inversion. Each node adds 0.6 digits, but the rounding error grows as exp(0.4
// NODES), so more nodes would lose accuracy. PHASE: number of intervals into which the nodes of the superposition
// divide one phase. A phase is the time between two changes of load.
enum { NODES = 18, PHASE = 40 };
// node i of a phase is placed at the share (i/PHASE)^GRADING of the duration of the phase, since the strain rises as a
// power of time after a change of load
#define GRADING 3

// ---- relaxation of the fractional Maxwell model

// The contour of the Talbot inversion at time t = 1. At each node p of the contour: part_v = 1/(V p^a) and part_g =
// 1/(G p^b), whose sum is 1/Z(p).
typedef struct contour {
    const kn_fractional_maxwell *f;
    double complex node[NODES], weight[NODES], part_v[NODES], part_g[NODES];
} contour;

// Compute the nodes p and the weights of the Talbot contour, and part_v and part_g at the nodes.
static void prepare(contour *c, const kn_fractional_maxwell *f)
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

// Invert the Laplace transform at time t. `times` 0: return the modulus; 1: return the integral of the modulus from 0
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
    // a short ramp acts like a step at the middle of the ramp, to second order in ramp/t
    if (ramp < 1e-4 * t) return invert(c, t + ramp / 2, 0);
    return (invert(c, t + ramp, 1) - (t > 0 ? invert(c, t, 1) : 0)) / ramp;
}

void kn_fractional_maxwell_relax(const kn_fractional_maxwell *f, double ramp_s, int count, const double *time_s,
                                 double *modulus_pa)
{
    contour c;
    prepare(&c, f);
    for (int i = 0; i < count; i++) modulus_pa[i] = after_ramp(&c, ramp_s, time_s[i]);
}

// ---- creep by superposition

bool kn_superposition_open(kn_superposition *m, const kn_curve *curve)
{
    // All arrays, for the nodes and for the pairs of nodes, share one block of memory.
    const int nodes = PHASE * curve->steps + 1;
    const size_t n = (size_t)nodes, pairs = n * (n - 1) / 2;
    *m = (kn_superposition){.curve = curve};
    if (curve->steps > KN_SUPERPOSITION_STEPS) return false;
    m->time_s = calloc(3 * n + 4 * pairs, sizeof *m->time_s);
    if (!m->time_s) return false;
    m->nodes = nodes;
    m->strain = m->time_s + n;
    m->slope = m->strain + n;
    m->lag_s = m->slope + n;
    m->ln_lag = m->lag_s + pairs;
    m->j = m->ln_lag + pairs;
    m->k = m->j + pairs;
    // Place the nodes of each phase (the time between two changes of load). The last node of a phase is also the first
    // node of the next phase.
    for (int i = 0; i < curve->steps; i++) {
        const double from = curve->step[i].time_s;
        const double to = i + 1 < curve->steps ? curve->step[i + 1].time_s : curve->time_s[curve->count - 1];
        for (int k = 0; k <= PHASE; k++)
            m->time_s[PHASE * i + k] = from + (to - from) * pow((double)k / PHASE, GRADING);
    }
    // Compute the lags between all pairs of nodes once. During a fit only the compliance changes.
    for (int a = 1, p = 0; a < nodes; a++)
        for (int b = 0; b < a; b++, p++) {
            m->lag_s[p] = m->time_s[a] - m->time_s[b];
            m->ln_lag[p] = log(m->lag_s[p]);
        }
    return true;
}

void kn_superposition_close(kn_superposition *m)
{
    free(m->time_s);
    *m = (kn_superposition){0};
}

static double stress(const kn_superposition *m, double nominal, double strain)
{
    return m->curve->constant_area ? nominal : nominal * (1 - strain);
}

// Advance the strain over the interval from node n - 1 to node n. `x` is the strain at n that the stress up to node n -
// 1 causes. The area depends on the strain at n, and the slope of the stress in the interval depends on the area. The
// resulting linear equation is solved for the strain at n.
static double step(kn_superposition *m, int n, double x, double nominal, double lag_k, double *p)
{
    const double h = m->time_s[n] - m->time_s[n - 1], k = lag_k / h;
    x = (x + k * (nominal - *p)) / (1 + k * (m->curve->constant_area ? 0 : nominal));
    const double next = stress(m, nominal, x);
    m->slope[n] = (next - *p) / h;
    *p = next;
    return x;
}

// Compute the strain from node to node. jump[i] is the jump of the stress at the change of load i.
static void march(kn_superposition *m)
{
    double p = 0, jump[KN_SUPERPOSITION_STEPS] = {0};
    for (int n = 0, phase = -1; n < m->nodes; n++) {
        const size_t row = n > 0 ? (size_t)n * (size_t)(n - 1) / 2 : 0;
        const double *lag_j = m->j + row, *lag_k = m->k + row;
        double x = 0;
        // Add the strain that all earlier jumps of the stress and all earlier linear pieces of the stress cause.
        for (int i = 0; i <= phase; i++) x += jump[i] * lag_j[PHASE * i];
        for (int i = 1; i < n; i++) x += m->slope[i] * (lag_k[i - 1] - lag_k[i]);
        if (n > 0) x = step(m, n, x, m->curve->step[phase].stress_pa, lag_k[n - 1], &p);
        m->strain[n] = x;
        // At a change of load the stress jumps while the strain is continuous.
        if (phase + 1 == m->curve->steps || n != PHASE * (phase + 1)) continue;
        phase++;
        jump[phase] = stress(m, m->curve->step[phase].stress_pa, x) - p;
        p += jump[phase];
    }
}

// Interpolate the strain in the phase that begins at the node `first`, with Lagrange's cubic through the four nearest
// nodes. `along` is the place in the phase, in the coordinate in which the nodes are evenly spaced.
static double between(const kn_superposition *m, int first, double along)
{
    int i = (int)along - 1;
    i = i < 0 ? 0 : i > PHASE - 3 ? PHASE - 3 : i;
    const double u = along - i, *x = m->strain + first + i;
    return -x[0] * (u - 1) * (u - 2) * (u - 3) / 6 + x[1] * u * (u - 2) * (u - 3) / 2 -
           x[2] * u * (u - 1) * (u - 3) / 2 + x[3] * u * (u - 1) * (u - 2) / 6;
}

bool kn_superposition_creep(kn_superposition *m, kn_superposition_compliance *compliance, const void *of, int count,
                            const double *time_s, double *strain)
{
    compliance(of, m->nodes * (m->nodes - 1) / 2, m->lag_s, m->ln_lag, m->j, m->k);
    march(m);
    for (int i = 0, first = 0; i < count; i++) {
        while (first + PHASE < m->nodes - 1 && time_s[i] > m->time_s[first + PHASE]) first += PHASE;
        const double from = m->time_s[first], to = m->time_s[first + PHASE];
        strain[i] = 0;
        if (time_s[i] > from)
            strain[i] = between(m, first, PHASE * pow((time_s[i] - from) / (to - from), 1.0 / GRADING));
        if (!isfinite(strain[i])) return false;
    }
    return true;
}

// ---- predictions of the yardsticks

// Compute the compliance J = ln(1 + t/tau)/v0 and its integral. For a short lag use the power series, since the closed
// form loses digits by cancellation.
static void logarithm_compliance(const void *of, int count, const double *lag, const double *ln_lag, double *j,
                                 double *k)
{
    const double *v = of;
    (void)ln_lag;
    for (int i = 0; i < count; i++) {
        const double u = lag[i] / v[1], ln = log1p(u);
        j[i] = ln / v[0];
        k[i] = (u < 1e-4 ? u * u * (0.5 - u / 6) : (1 + u) * ln - u) * v[1] / v[0];
    }
}

// Compute the compliance J = t^a/(V Gamma(1+a)) + t^b/(G Gamma(1+b)) and its integral, term by term.
static void fractional_compliance(const void *of, int count, const double *lag, const double *ln_lag, double *j,
                                  double *k)
{
    const kn_fractional_maxwell *f = of;
    const double a = f->v_order, b = f->g_order;
    const double v = 1 / (f->v_pa_s * tgamma(1 + a)), g = 1 / (f->g_pa_s * tgamma(1 + b));
    for (int i = 0; i < count; i++) {
        const double at_v = v * exp(a * ln_lag[i]), at_g = g * exp(b * ln_lag[i]);
        j[i] = at_v + at_g;
        k[i] = lag[i] * (at_v / (1 + a) + at_g / (1 + b));
    }
}

// Compute the modulus a - b ln t, or the mean of this modulus over the rise of the strain.
static void logarithm_relax(const double *v, double ramp_s, int count, const double *t, double *modulus_pa)
{
    for (int i = 0; i < count; i++) {
        const double end = t[i] + ramp_s, from = t[i] > 0 ? t[i] * log(t[i]) : 0;
        const double ln = ramp_s > 1e-6 * t[i] ? (end * log(end) - from) / ramp_s - 1 : log(t[i]);
        modulus_pa[i] = v[0] - v[1] * ln;
    }
}

bool kn_yardstick_predict(const kn_constitutive_model *model, const double *v, kn_compared_curve *c, int count,
                          const double *time_s, double *out)
{
    const bool fractional = model->kind == KN_CONSTITUTIVE_FRACTIONAL;
    kn_fractional_maxwell f = {0};
    // The unknown for the order b is the ratio b/a, so that b < a.
    if (fractional) f = (kn_fractional_maxwell){v[0], v[1], v[2], v[3] * v[1]};
    if (model->relax) {
        if (fractional) kn_fractional_maxwell_relax(&f, c->ramp_s, count, time_s, out);
        else logarithm_relax(v, c->ramp_s, count, time_s, out);
        for (int i = 0; i < count; i++) out[i] *= c->strain;
        return true;
    }
    if (!c->superposition.nodes) return false;
    return fractional ? kn_superposition_creep(&c->superposition, fractional_compliance, &f, count, time_s, out)
                      : kn_superposition_creep(&c->superposition, logarithm_compliance, v, count, time_s, out);
}
