#include "clients/identify/memory.h"
#include <math.h>
#include <stdlib.h>

enum { PHASE = 40 }; // number of intervals between nodes in one phase, the time between two changes of load
// node i of a phase is placed at the share (i/PHASE)^GRADING of the duration of the phase, since the strain rises as a
// power of time after a change of load
#define GRADING 3

bool kn_superposition_open(kn_superposition *m, bool constant_area, int steps, const double *step_s,
                           const double *nominal_pa, double until_s)
{
    // The arrays over nodes and over pairs of nodes share one allocation.
    *m = (kn_superposition){.nodes = PHASE * steps + 1, .steps = steps, .constant_area = constant_area};
    if (steps > KN_SUPERPOSITION_STEPS) return false;
    const size_t n = (size_t)m->nodes, pairs = n * (n - 1) / 2;
    m->time_s = calloc(3 * n + 4 * pairs, sizeof *m->time_s);
    if (!m->time_s) return false;
    m->strain = m->time_s + n;
    m->slope = m->strain + n;
    m->lag_s = m->slope + n;
    m->ln_lag = m->lag_s + pairs;
    m->j = m->ln_lag + pairs;
    m->k = m->j + pairs;
    // Place the nodes of each phase between two changes of load. The last node of a phase is the first of the next.
    for (int i = 0, at = 0; i < steps; i++) {
        const double from = step_s[i], to = i + 1 < steps ? step_s[i + 1] : until_s;
        m->step[i] = at;
        m->nominal_pa[i] = nominal_pa[i];
        for (int k = 0; k <= PHASE; k++) m->time_s[at + k] = from + (to - from) * pow((double)k / PHASE, GRADING);
        at += PHASE;
    }
    // Compute the lags of all pairs once. Only the compliance changes from fit to fit.
    for (int a = 1, p = 0; a < m->nodes; a++)
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
    return m->constant_area ? nominal : nominal * (1 - strain);
}

// Advance the strain over the interval from node n - 1 to n. `x` is the strain at n that is caused by the stress up to
// node n - 1. The area, and so the slope of P in the interval, depends on the strain at n. The resulting linear
// equation is solved for this strain.
static double step(kn_superposition *m, int n, double x, double nominal, double lag_k, double *p)
{
    const double h = m->time_s[n] - m->time_s[n - 1], k = lag_k / h, feedback = m->constant_area ? 0 : nominal;
    x = (x + k * (nominal - *p)) / (1 + k * feedback);
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
        // Add the response to all earlier jumps of stress and to all earlier linear pieces.
        for (int i = 0; i <= phase; i++) x += jump[i] * lag_j[m->step[i]];
        for (int i = 1; i < n; i++) x += m->slope[i] * (lag_k[i - 1] - lag_k[i]);
        if (n > 0) x = step(m, n, x, m->nominal_pa[phase], lag_k[n - 1], &p);
        m->strain[n] = x;
        // At a change of load the stress jumps while the strain is continuous.
        if (phase + 1 == m->steps || n != m->step[phase + 1]) continue;
        phase++;
        jump[phase] = stress(m, m->nominal_pa[phase], x) - p;
        p += jump[phase];
    }
}

// Interpolate with Lagrange's cubic through the four nodes around a place in a phase. `along` is the coordinate in
// which the nodes are evenly spaced.
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
    for (int i = 0, phase = 0; i < count; i++) {
        while (phase + 1 < m->steps && time_s[i] > m->time_s[m->step[phase + 1]]) phase++;
        const int first = m->step[phase];
        const double from = m->time_s[first], to = m->time_s[first + PHASE];
        strain[i] = 0;
        if (time_s[i] > from)
            strain[i] = between(m, first, PHASE * pow((time_s[i] - from) / (to - from), 1.0 / GRADING));
        if (!isfinite(strain[i])) return false;
    }
    return true;
}
