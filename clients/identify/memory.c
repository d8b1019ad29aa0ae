#include "clients/identify/memory.h"
#include <math.h>
#include <stdlib.h>

enum { PHASE = 40 }; // intervals between two changes of load
#define GRADING 3    // node i of a phase is at (i/PHASE)^GRADING of it: x rises there as a power of time

bool kn_memory_open(kn_memory *m, bool constant_area, int steps, const double *step_s, const double *nominal_pa,
                    double until_s)
{
    *m = (kn_memory){.nodes = PHASE * steps + 1, .steps = steps, .constant_area = constant_area};
    if (steps > KN_MEMORY_STEPS) return false;
    const size_t n = (size_t)m->nodes, pairs = n * (n - 1) / 2;
    m->time_s = calloc(3 * n + 4 * pairs, sizeof *m->time_s);
    if (!m->time_s) return false;
    m->strain = m->time_s + n;
    m->slope = m->strain + n;
    m->lag_s = m->slope + n;
    m->ln_lag = m->lag_s + pairs;
    m->j = m->ln_lag + pairs;
    m->k = m->j + pairs;
    for (int i = 0, at = 0; i < steps; i++) {
        const double from = step_s[i], to = i + 1 < steps ? step_s[i + 1] : until_s;
        m->step[i] = at;
        m->nominal_pa[i] = nominal_pa[i];
        for (int k = 0; k <= PHASE; k++) m->time_s[at + k] = from + (to - from) * pow((double)k / PHASE, GRADING);
        at += PHASE;
    }
    for (int a = 1, p = 0; a < m->nodes; a++)
        for (int b = 0; b < a; b++, p++) {
            m->lag_s[p] = m->time_s[a] - m->time_s[b];
            m->ln_lag[p] = log(m->lag_s[p]);
        }
    return true;
}

void kn_memory_close(kn_memory *m)
{
    free(m->time_s);
    *m = (kn_memory){0};
}

static double stress(const kn_memory *m, double nominal, double strain)
{
    return m->constant_area ? nominal : nominal * (1 - strain);
}

// The step of strain between n - 1 and n: P' there, which the strain at n is part of. x: what came before it makes.
static double step(kn_memory *m, int n, double x, double nominal, double lag_k, double *p)
{
    const double h = m->time_s[n] - m->time_s[n - 1], k = lag_k / h, feedback = m->constant_area ? 0 : nominal;
    x = (x + k * (nominal - *p)) / (1 + k * feedback);
    const double next = stress(m, nominal, x);
    m->slope[n] = (next - *p) / h;
    *p = next;
    return x;
}

// From node to node. jump[i]: by how much the stress changes at once at change i.
static void march(kn_memory *m)
{
    double p = 0, jump[KN_MEMORY_STEPS] = {0};
    for (int n = 0, phase = -1; n < m->nodes; n++) {
        const size_t row = n > 0 ? (size_t)n * (size_t)(n - 1) / 2 : 0;
        const double *lag_j = m->j + row, *lag_k = m->k + row;
        double x = 0;
        for (int i = 0; i <= phase; i++) x += jump[i] * lag_j[m->step[i]];
        for (int i = 1; i < n; i++) x += m->slope[i] * (lag_k[i - 1] - lag_k[i]);
        if (n > 0) x = step(m, n, x, m->nominal_pa[phase], lag_k[n - 1], &p);
        m->strain[n] = x;
        if (phase + 1 == m->steps || n != m->step[phase + 1]) continue;
        phase++;
        jump[phase] = stress(m, m->nominal_pa[phase], x) - p;
        p += jump[phase];
    }
}

// Lagrange's cubic through the four nodes around a place in a phase, in the coordinate in which they lie evenly.
static double between(const kn_memory *m, int first, double along)
{
    int i = (int)along - 1;
    i = i < 0 ? 0 : i > PHASE - 3 ? PHASE - 3 : i;
    const double u = along - i, *x = m->strain + first + i;
    return -x[0] * (u - 1) * (u - 2) * (u - 3) / 6 + x[1] * u * (u - 2) * (u - 3) / 2 -
           x[2] * u * (u - 1) * (u - 3) / 2 + x[3] * u * (u - 1) * (u - 2) / 6;
}

bool kn_memory_creep(kn_memory *m, kn_memory_compliance *compliance, const void *of, int count, const double *time_s,
                     double *strain)
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
