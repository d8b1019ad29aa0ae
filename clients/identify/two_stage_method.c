#include "clients/identify/creep_fit.h"
#include "clients/identify/least_squares.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FEWEST = 10, HALF_LINE = 10, STARTS = 3 };

// ---- stage 1: fit of the first paper's equation 5 to the recovery

typedef struct recovery {
    const kn_curve *curve;
    kn_two_stage stages;
} recovery;

double kn_two_stage_recovered(const kn_two_stage *s, double since_release_s)
{
    const double k1 = s->material.k1_pa;
    return s->release_pa / k1 * -expm1(-k1 / s->material.c1_pa_s * since_release_s);
}

// Compute the residuals of the readings after the release. The unknowns are k1 and c1.
static bool recovery_misfit(void *of, const double *value, double *residual)
{
    recovery *r = of;
    kn_two_stage *s = &r->stages;
    s->material.k1_pa = value[0];
    s->material.c1_pa_s = value[1];
    for (int i = s->count; i < r->curve->count; i++)
        *residual++ = sqrt(r->curve->weight[i]) * (kn_two_stage_recovered(s, r->curve->time_s[i] - s->release_s) -
                                                   (s->release_strain - r->curve->value[i]));
    return true;
}

// Fit equation 5 of the first paper to the readings after the release.
static bool fit_recovery(kn_two_stage *s, const kn_curve *c)
{
    recovery r = {c, *s};
    double back = s->release_strain - c->value[c->count - 1], stiff = s->release_pa / fmax(back, 1e-6);
    double span = c->time_s[c->count - 1] - s->release_s, c1 = stiff * span / 10;
    kn_fit fit = {.unknowns = 2, .readings = c->count - s->count, .misfit = recovery_misfit, .of = &r};
    if (fit.readings < FEWEST || !(back > 0)) return false;
    fit.unknown[0] = (kn_fit_unknown){.name = "k1", .value = stiff, .low = 1e-4 * stiff, .high = 1e4 * stiff};
    fit.unknown[1] = (kn_fit_unknown){.name = "c1", .value = c1, .low = 1e-5 * c1, .high = 1e5 * c1};
    if (!kn_fit_run(&fit)) return false;
    s->material.k1_pa = fit.unknown[0].value;
    s->material.c1_pa_s = fit.unknown[1].value;
    return true;
}

// ---- stage 2: strain of the Voigt element under the measured stress, which is linear between two readings

static void subtract_voigt(kn_two_stage *s, const kn_curve *c)
{
    double k1 = s->material.k1_pa, tau = s->material.c1_pa_s / k1, x = 0, from_s = c->step[0].time_s;
    double from_pa = c->step[0].stress_pa;
    // Add the exact solution of c1 x' + k1 x = P over one interval, in which the stress P is linear in time.
    for (int i = 0; i < s->count; i++) {
        double h = c->time_s[i] - from_s, to_pa = s->stress_pa[i], gone = -expm1(-h / tau);
        double slope = h > 0 ? (to_pa - from_pa) / h : 0;
        x += (from_pa / k1 - x) * gone + slope / k1 * (h - tau * gone);
        s->voigt[i] = x;
        s->damper[i] = c->value[i] - x;
        from_s = c->time_s[i];
        from_pa = to_pa;
    }
}

// ---- stage 3: damping c2 and its law

// Return the slope of the best straight line through HALF_LINE readings on either side of the reading `at`. Thinned
// readings (means) are denser just after the load was applied. There the line takes more readings, so that it spans as
// long a time as with evenly spaced readings.
static double slope_around(const kn_curve *c, const double *x, int count, int at)
{
    const double *t = c->time_s, half_s = 0.999 * HALF_LINE * (t[count - 1] - t[0]) / (count - 1);
    int from = at < HALF_LINE ? 0 : at - HALF_LINE, to = at + HALF_LINE < count ? at + HALF_LINE : count - 1;
    while (from > 0 && t[from - 1] > t[at] - half_s) from--;
    while (to + 1 < count && t[to + 1] < t[at] + half_s) to++;
    double mean_t, mean_x;
    return kn_line_slope(to - from + 1, t + from, x + from, c->weight + from, &mean_t, &mean_x);
}

// Compute the residuals of the first paper's equation 6 for the logarithm of c2. The unknowns are alpha, beta, P0 and
// P1.
static bool damper_misfit(void *of, const double *value, double *residual)
{
    const kn_two_stage *s = of;
    for (int i = 0, n = 0; i < s->count; i++) {
        if (isnan(s->c2_pa_s[i])) continue;
        double p = fmin(fmax(s->stress_pa[i], value[2]), value[3]);
        residual[n++] = log(value[0]) - value[1] * p - log(s->c2_pa_s[i]);
    }
    return true;
}

// Compute c2 = P/v from the slope v of the damper's strain, and fit the first paper's equation 6 to it.
static bool fit_damper(kn_two_stage *s, const kn_curve *c)
{
    double low = INFINITY, high = 0, mean = 0, top = c->step[0].stress_pa;
    int count = 0;
    for (int i = 0; i < s->count; i++) {
        double v = slope_around(c, s->damper, s->count, i);
        s->c2_pa_s[i] = v > 0 && s->stress_pa[i] > 0 ? s->stress_pa[i] / v : (double)NAN;
        if (isnan(s->c2_pa_s[i])) continue;
        low = fmin(low, s->stress_pa[i]);
        high = fmax(high, s->stress_pa[i]);
        mean += log(s->c2_pa_s[i]);
        count++;
    }
    if (count < FEWEST || !(high > low)) return false;
    // Start the fit from several values of beta, with P0 and P1 just outside the range of the measured stresses.
    double alpha = exp(mean / count), start[STARTS][KN_FIT_UNKNOWNS];
    kn_fit fit = {.unknowns = 4, .readings = count, .misfit = damper_misfit, .of = s};
    fit.unknown[0] = (kn_fit_unknown){.name = "alpha", .low = alpha * 1e-6, .high = alpha * 1e12};
    fit.unknown[1] = (kn_fit_unknown){.name = "beta", .low = 1e-4 / top, .high = 100 / top};
    fit.unknown[2] = (kn_fit_unknown){.name = "P0", .low = low / 2, .high = high};
    fit.unknown[3] = (kn_fit_unknown){.name = "P1", .low = low, .high = 1.5 * top};
    for (int k = 0; k < STARTS; k++) {
        double beta = (k + 1) * 2 / top;
        double begin[4] = {alpha * exp(beta * (low + high) / 2), beta, 0.9 * low, 1.1 * high};
        memcpy(start[k], begin, sizeof begin);
    }
    if (!kn_fit_run_from(&fit, STARTS, start)) return false;
    s->material.damper = KN_DAMPER_EXPONENTIAL;
    s->material.alpha_pa_s = fit.unknown[0].value;
    s->material.beta_per_pa = fit.unknown[1].value;
    s->material.p0_pa = fit.unknown[2].value;
    s->material.p1_pa = fmax(fit.unknown[3].value, fit.unknown[2].value * 1.0001);
    return true;
}

// Find strain and stress at the release from the last entry under load. If this entry is a mean of several readings,
// its time is earlier than the release, so its strain is extrapolated. The strain of a single reading is used as it is.
static void at_release(kn_two_stage *s, const kn_curve *c)
{
    const int last = s->count - 1;
    const double on = c->weight[last] > 1 ? slope_around(c, c->value, s->count, last) : 0;
    s->release_strain = c->value[last] + on * (s->release_s - c->time_s[last]);
    s->release_pa = s->stress_pa[last];
    if (!c->constant_area) s->release_pa *= (1 - s->release_strain) / (1 - c->value[last]);
}

bool kn_two_stage_fit(kn_two_stage *s, const kn_curve *c)
{
    *s = (kn_two_stage){.release_s = kn_creep_release(c)};
    while (s->count < c->count && c->time_s[s->count] <= s->release_s) s->count++;
    if (!isfinite(s->release_s) || s->count < FEWEST) return false;
    size_t n = (size_t)s->count;
    s->stress_pa = calloc(4 * (size_t)c->count, sizeof *s->stress_pa);
    if (!s->stress_pa) return false;
    // All arrays share one block of memory. The stress has an entry for every reading of the curve, even after the
    // release.
    s->voigt = s->stress_pa + c->count;
    s->damper = s->voigt + n;
    s->c2_pa_s = s->damper + n;
    kn_creep_stress(c, s->stress_pa);
    at_release(s, c);
    if (fit_recovery(s, c)) {
        subtract_voigt(s, c);
        if (fit_damper(s, c)) return true;
    }
    kn_two_stage_free(s);
    return false;
}

void kn_two_stage_free(kn_two_stage *s)
{
    free(s->stress_pa);
    s->stress_pa = NULL;
}
