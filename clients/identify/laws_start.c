// Starts for the search of a law's parameters. Several starts are derived from the readings, since the sum of squares
// of exponentials has many minima.
#include "clients/identify/constitutive_models.h"
#include <math.h>
#include <string.h>

typedef double (*places)[KN_FIT_UNKNOWNS];

// ---- relaxation

// Summary of the early readings of all curves: P/strain = a - b ln t by least squares, and the first, the last and a
// middle modulus.
typedef struct look {
    double a, b, first_s, middle_s, last_s, first_pa, middle_pa, last_pa;
} look;

// Return the modulus at the first early reading at or after a time.
static double modulus_near(const kn_compared_curve *c, double time_s)
{
    const kn_compared_part *p = &c->part[0];
    int i = 0;
    while (i + 1 < p->count && p->time_s[i] < time_s) i++;
    return p->value[i] / c->strain;
}

// Fit P/strain = a - b ln t by least squares to the early readings of all curves.
static look look_at(int curves, const kn_compared_curve *curve)
{
    double n = 0, t = 0, y = 0, tt = 0, ty = 0;
    look l = {.first_s = INFINITY};
    for (int c = 0; c < curves; c++)
        for (int i = 0; i < curve[c].part[0].count; i++) {
            const double at = curve[c].part[0].time_s[i], value = curve[c].part[0].value[i] / curve[c].strain;
            if (!(at > 0)) continue;
            l.first_s = fmin(l.first_s, at);
            l.last_s = fmax(l.last_s, at);
            n += 1, t += log(at), y += value, tt += log(at) * log(at), ty += log(at) * value;
        }
    l.b = n * tt - t * t > 0 ? -(n * ty - t * y) / (n * tt - t * t) : 0;
    l.a = n > 0 ? (y + l.b * t) / n : 0;
    l.middle_s = sqrt(l.first_s * l.last_s);
    l.first_pa = modulus_near(curve, l.first_s);
    l.middle_pa = modulus_near(curve, l.middle_s);
    l.last_pa = modulus_near(curve, l.last_s);
    return l;
}

// Spread the relaxation times over the logarithm of the time, in four ways.
static int start_units_relax(const kn_constitutive_model *law, const look *l, places start)
{
    static const double share[4][3] = {{0.3, 0.8, 1}, {0.6, 0.95, 1.2}, {0.1, 0.5, 0.9}, {0.9, 1.2, 1.5}};
    for (int s = 0; s < 4; s++) {
        const double width = log(l->last_s / l->first_s);
        for (int k = 0; k < law->units; k++) {
            start[s][2 * k] = l->first_pa / (law->units + law->spring);
            start[s][2 * k + 1] = l->first_s * exp(share[s][law->units == 1 ? 1 : k] * width);
        }
        if (law->spring) start[s][2 * law->units] = l->last_pa * (s % 2 ? 0.3 : 0.8);
    }
    return law->units ? 4 : 1;
}

// Late in (1) of hold.h, t is alpha/k1 exp(-beta P)/(beta P), so P falls by 1/beta in each factor e of time.
static int start_dough_relax(const kn_constitutive_model *law, const look *l, int curves,
                             const kn_compared_curve *curve, places start)
{
    static const double steeper[2] = {1, 2}, early[4] = {1e-2, 1, 1e2, 1};
    const double strain = curve[0].strain, middle = l->middle_pa * strain;
    const double falls = fmax(l->b, 1e-3 * l->first_pa) * strain;
    int count = 0;
    for (int s = 0; s < 2; s++)
        for (int k = 0; k < 4; k++, count++) {
            const double beta = steeper[s] / falls, x = fmin(beta * middle, 150);
            int n = 0;
            start[count][n++] = l->middle_s * x * exp(x);
            start[count][n++] = beta;
            if (law->c1) start[count][n++] = early[k] * l->first_s / (1 + beta * l->first_pa * strain);
            if (law->p0) start[count][n++] = l->last_pa * strain * (k % 2 ? 1.1 : 1.6);
            for (int c = 0; c < curves && n < KN_FIT_UNKNOWNS; c++)
                start[count][n++] = modulus_near(&curve[c], l->first_s) * curve[c].strain * (k == 3 ? 1.1 : 1);
        }
    return count;
}

// Use the slopes of ln G against ln t at both ends as the orders. Further starts are nearly a Maxwell element, whose
// time is taken from the total fall.
static int start_fractional_relax(const look *l, places start)
{
    const double early = log(l->first_pa / l->middle_pa) / log(l->middle_s / l->first_s);
    const double late = log(l->middle_pa / l->last_pa) / log(l->last_s / l->middle_s);
    const double tau = l->last_s / fmax(log(l->first_pa / l->last_pa), 1e-3);
    for (int s = 0; s < 3; s++) {
        const double b = fmin(fmax(early, 0.01), 0.5),
                     a = s == 2 ? 0.9 : fmin(fmax(late * (s ? 4 : 1.5), 1.5 * b), 0.95);
        start[s][0] = l->last_pa * pow(l->last_s, a) * (s ? 3 : 1);
        start[s][1] = a;
        start[s][2] = l->first_pa * pow(l->first_s, b);
        start[s][3] = fmin(b / a, 0.9);
    }
    for (int s = 3; s < 5; s++) {
        const double a = s == 3 ? 0.97 : 0.7, b = 0.02;
        start[s][0] = l->first_pa * pow(tau, a);
        start[s][1] = a;
        start[s][2] = l->first_pa * pow(l->first_s, b);
        start[s][3] = b / a;
    }
    return 5;
}

static int starts_relax(const kn_constitutive_model *law, int curves, const kn_compared_curve *curve, places start)
{
    const look l = look_at(curves, curve);
    switch (law->kind) {
    case KN_CONSTITUTIVE_UNITS: return start_units_relax(law, &l, start);
    case KN_CONSTITUTIVE_DOUGH: return start_dough_relax(law, &l, curves, curve, start);
    case KN_CONSTITUTIVE_LOGARITHM: start[0][0] = l.a, start[0][1] = l.b; return 1;
    case KN_CONSTITUTIVE_FRACTIONAL: break;
    }
    return start_fractional_relax(&l, start);
}

// ---- creep

// The largest load: its nominal stress, duration, stress and compliance at its end. least_pa is the least of all loads.
typedef struct load {
    double nominal_pa, time_s, stress_pa, compliance, least_pa;
} load;

// Find the largest load of all curves and the strain at its end.
static load largest(int curves, const kn_compared_curve *curve)
{
    load l = {.least_pa = INFINITY};
    for (int c = 0; c < curves; c++)
        for (int k = 0; k < curve[c].curve->steps; k++) {
            const double nominal = curve[c].curve->step[k].stress_pa;
            if (nominal > 0) l.least_pa = fmin(l.least_pa, nominal);
            if (!(nominal > l.nominal_pa)) continue;
            const kn_compared_part *p = &curve[c].part[0];
            const double until = k + 1 < curve[c].curve->steps ? curve[c].curve->step[k + 1].time_s : INFINITY;
            int i = 0;
            while (i + 1 < p->count && p->time_s[i + 1] <= until) i++;
            const double strain = p->count ? fmax(p->value[i], 1e-9) : 1e-9;
            l.nominal_pa = nominal;
            l.time_s = p->count ? fmax(p->time_s[i] - curve[c].curve->step[k].time_s, 1e-9) : 1;
            l.stress_pa = nominal * (curve[c].curve->constant_area ? 1 : fmax(1 - strain, 0.05));
            l.compliance = strain / l.stress_pa;
        }
    return l;
}

// Spread the retardation times over the duration of the load, and share the compliance among the elements.
static int start_units_creep(const kn_constitutive_model *law, const load *l, places start)
{
    static const double share[4][3] = {{0.1, 1, 3}, {0.02, 0.3, 1}, {0.5, 3, 10}, {0.005, 0.1, 1}};
    const double parts = law->units + law->spring + law->damper;
    for (int s = 0; s < 4; s++) {
        int n = 0;
        for (int k = 0; k < law->units; k++) {
            start[s][n++] = parts / l->compliance;
            start[s][n++] = share[s][k] * l->time_s;
        }
        if (law->spring) start[s][n++] = parts / l->compliance * (s % 2 ? 5 : 1);
        if (law->damper) start[s][n++] = parts * l->time_s / l->compliance * (s > 1 ? 5 : 1);
    }
    return 4;
}

// Guess k1, c1, alpha and beta from the compliance at the end of the load.
static int start_dough_creep(const load *l, places start)
{
    static const double thins[2] = {0.7, 3};
    for (int s = 0; s < 4; s++) {
        const double stress = (l->nominal_pa + l->stress_pa) / 2, x = thins[s / 2];
        start[s][0] = 4 / l->compliance;
        start[s][1] = 4 / l->compliance * l->time_s * (s % 2 ? 0.3 : 0.05);
        start[s][2] = 1.5 * l->time_s / l->compliance * exp(x);
        start[s][3] = x / stress;
    }
    return 4;
}

// Add P0 and P1 to the four parameters that were found without them. P1 starts below the largest stress, since a P1
// above has no gradient and would stay there.
static int start_clamps_creep(const kn_constitutive_model *law, const load *l, const kn_fit_unknown *found,
                              places start)
{
    static const double above[3] = {0.6, 0.8, 0.95}, below[3] = {1.2, 0.5, 0.9};
    for (int s = 0; s < 3; s++) {
        int n = 0;
        for (; n < 4; n++) start[s][n] = found[n].value;
        if (law->p0) start[s][n++] = below[s] * l->least_pa;
        if (law->p1) start[s][n] = above[s] * l->nominal_pa;
    }
    return 3;
}

static int starts_creep(const kn_constitutive_model *law, int curves, const kn_compared_curve *curve, int count,
                        const kn_fit_unknown *found, places start)
{
    static const double order[4][2] = {{0.3, 0.3}, {0.6, 0.3}, {0.95, 0.2}, {0.9, 0.6}};
    const load l = largest(curves, curve);
    if (law->kind == KN_CONSTITUTIVE_UNITS) return start_units_creep(law, &l, start);
    if (law->kind == KN_CONSTITUTIVE_DOUGH && (law->p0 || law->p1) && count >= 4)
        return start_clamps_creep(law, &l, found, start);
    if (law->kind == KN_CONSTITUTIVE_DOUGH) return start_dough_creep(&l, start);
    for (int s = 0; s < 4; s++) {
        const double a = order[s][0], b = order[s][1] * a, half = 2 / l.compliance;
        if (law->kind == KN_CONSTITUTIVE_LOGARITHM) {
            const double tau = l.time_s * pow(10, -1 - s);
            start[s][0] = log1p(l.time_s / tau) / l.compliance;
            start[s][1] = tau;
            continue;
        }
        start[s][0] = half * pow(l.time_s, a) / tgamma(1 + a);
        start[s][1] = a;
        start[s][2] = half * pow(l.time_s, b) / tgamma(1 + b);
        start[s][3] = order[s][1];
    }
    return 4;
}

int kn_constitutive_model_starts(const kn_constitutive_model *law, int curves, const kn_compared_curve *curve,
                                 int count, const kn_fit_unknown *found, double start[][KN_FIT_UNKNOWNS])
{
    memset(start, 0, KN_CONSTITUTIVE_STARTS * sizeof *start);
    return law->relax ? starts_relax(law, curves, curve, start) : starts_creep(law, curves, curve, count, found, start);
}
