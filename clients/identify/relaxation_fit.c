#include "clients/identify/relaxation_fit.h"
#include "clients/identify/element_response.h"
#include "clients/identify/constitutive_models.h"
#include "clients/identify/relaxation_readings.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { K1, C1, ALPHA, BETA, P0, P1, BEGIN };
// lower bound of c1, as a share of the shortest measured time constant; a smaller c1 has no effect
#define NEVER_C1 1e-3
#define INSIDE 1.05 // P0 and P1 must be within the measured stresses by this factor

typedef struct work {
    kn_relaxation_fit *r;
    bool constant_noise;
    kn_fit fit;             // the unknowns are the parameters of the enum, followed by a stress Pi for each curve
    double c1_low, c1_high; // bounds of c1 when it is free; a fixed unknown's bounds are its value
    // lowest: least stress measured in the holds; highest: largest stress measured in holds and rises
    double lowest, highest;
} work;

// ---- the element's stress

// Compute the stress during the rise, and at the first reading of the hold. P1 is limited so that exp(beta P1) does not
// overflow.
static bool by_chain(const double *v, const kn_relaxation_curve *c, double *out)
{
    const kn_voigt_chain row = {.voigts = 1,
                                .k_pa = {v[K1]},
                                .c_pa_s = {v[C1]},
                                .alpha_pa_s = v[ALPHA],
                                .beta_per_pa = v[BETA],
                                .p0_pa = v[P0],
                                .p1_pa = fmin(v[P1], 600 / v[BETA])};
    double time_s[KN_RELAXATION_RISE_BINS + 1];
    for (int i = 0; i < c->rise.count; i++) time_s[i] = c->ramp.end_s + c->rise.time_s[i];
    time_s[c->rise.count] = c->ramp.end_s + c->hold.time_s[0];
    if (row.p0_pa >= row.p1_pa) return false;
    return kn_voigt_chain_stress(&row, c->ramp.steps, c->ramp.step, c->rise.count + 1, time_s, out) &&
           out[c->rise.count] > 0;
}

// Compute the stress of a hold in closed form, from the stress `begin_pa` at the time `begin_s` on.
static void by_hold(const double *v, double begin_pa, double begin_s, const kn_time_bins *b, double *out)
{
    const kn_held_element h = {.begin_pa = begin_pa,
                               .alpha_s = v[ALPHA] / v[K1],
                               .c1_s = v[C1] / v[K1],
                               .beta_per_pa = v[BETA],
                               .p0_pa = v[P0],
                               .p1_pa = v[P1]};
    // out[] holds the times first, then the stresses
    for (int i = 0; i < b->count; i++) out[i] = b->time_s[i] - begin_s;
    kn_held_element_stress(&h, b->count, out, out);
}

// Predict one curve: the rise by the chain and the hold from its last stress, or the hold alone from Pi.
static bool predict(const double *v, const kn_relaxation_curve *c, int number, double *out)
{
    if (!c->rises) {
        by_hold(v, v[BEGIN + number], 0, &c->hold, out);
        return true;
    }
    if (!by_chain(v, c, out)) return false;
    by_hold(v, out[c->rise.count], c->hold.time_s[0], &c->hold, out + c->rise.count);
    return true;
}

// Compute the residuals: of the stress in units of its noise, or of its logarithm.
static bool difference(const work *w, const kn_relaxation_curve *c, const double *fit, double *residual)
{
    for (int part = 0, n = 0; part < 2; part++) {
        const kn_time_bins *b = part ? &c->hold : &c->rise;
        for (int i = 0; i < b->count; i++, n++) {
            if (w->constant_noise) residual[n] = (fit[n] - b->value[i]) * sqrt(b->weight[i]) / c->curve->noise;
            else if (fit[n] > 0) residual[n] = log(fit[n] / b->value[i]);
            else return false;
        }
    }
    return true;
}

static bool misfit(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const work *w = of;
    for (int c = 0, n = 0; c < w->r->curves; c++) {
        const kn_relaxation_curve *k = &w->r->curve[c];
        double *out = residual + n; // out and residual share memory
        if (!predict(value, k, c, out) || !difference(w, k, out, out)) return false;
        n += k->rise.count + k->hold.count;
    }
    return true;
}

// ---- the search

// The first search is for the holds alone, since their closed form is cheap. It uses the starts of laws.h, as one of
// the laws there.
typedef struct holds {
    const work *w;
    kn_constitutive_model law;
    kn_compared_curve curve[KN_RELAXATION_CURVES];
} holds;

// Turn the unknowns of the law into those of this fit, with k1 = 1.
static void expand(const kn_constitutive_model *law, int curves, const double *from, double to[KN_FIT_UNKNOWNS])
{
    int n = 2;
    to[K1] = 1;
    to[ALPHA] = from[0];
    to[BETA] = from[1];
    to[C1] = law->c1 ? from[n++] : 0;
    to[P0] = law->p0 ? from[n++] : 0;
    to[P1] = INFINITY;
    for (int c = 0; c < curves; c++) to[BEGIN + c] = from[n + c];
}

static bool misfit_of_holds(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const holds *f = of;
    const kn_relaxation_fit *r = f->w->r;
    double v[KN_FIT_UNKNOWNS];
    expand(&f->law, r->curves, value, v);
    for (int c = 0, n = 0; c < r->curves; n += r->curve[c++].hold.count) {
        kn_relaxation_curve alone = r->curve[c];
        alone.rise.count = 0;
        by_hold(v, v[BEGIN + c], 0, &alone.hold, residual + n); // result and residual share memory
        if (!difference(f->w, &alone, residual + n, residual + n)) return false;
    }
    return true;
}

// Find the best fit of the holds by this law. Return false if there is none.
static bool fit_holds(const work *w, bool c1, bool p0, double out[KN_FIT_UNKNOWNS])
{
    holds f = {.w = w, .law = {.kind = KN_CONSTITUTIVE_DOUGH, .relax = true, .c1 = c1, .p0 = p0}};
    double start[KN_CONSTITUTIVE_STARTS][KN_FIT_UNKNOWNS], value[KN_FIT_UNKNOWNS];
    kn_fit fit = {.misfit = misfit_of_holds, .of = &f};
    for (int c = 0; c < w->r->curves; c++) {
        const kn_time_bins *b = &w->r->curve[c].hold;
        f.curve[c] = (kn_compared_curve){.curve = w->r->curve[c].curve, .strain = 1};
        f.curve[c].part[0] = (kn_compared_part){b->count, b->time_s, b->value};
        fit.readings += b->count;
    }
    fit.unknowns = kn_constitutive_model_unknowns(&f.law, w->r->curves, f.curve, fit.unknown);
    if (fit.readings <= fit.unknowns) return false;
    const int starts = kn_constitutive_model_starts(&f.law, w->r->curves, f.curve, 0, NULL, start);
    if (!kn_fit_run_from(&fit, starts, (const double(*)[KN_FIT_UNKNOWNS])start)) return false;
    for (int i = 0; i < fit.unknowns; i++) value[i] = fit.unknown[i].value;
    expand(&f.law, w->r->curves, value, out);
    return true;
}

static void leave_out(kn_fit_unknown *u, double value)
{
    u->fixed = true;
    u->value = u->low = u->high = value;
}

// Set the unknowns to these values and bound them around these values. c1, P0 and P1 are fixed.
static void unknowns_around(work *w, const double v[KN_FIT_UNKNOWNS])
{
    static const char *const name[] = {"k1", "c1", "alpha", "beta", "P0", "P1"};
    kn_fit *fit = &w->fit;
    double scale = 1;
    *fit = (kn_fit){.readings = w->r->readings, .misfit = misfit, .of = w, .unknowns = BEGIN + w->r->curves};
    for (int c = 0; c < w->r->curves; c++) // k1 by equation (1) of the header, at the begin of the hold
        if (w->r->curve[c].rises)
            scale = v[BEGIN + c] * (1 + v[C1] / v[ALPHA] * exp(v[BETA] * v[BEGIN + c])) / w->r->curve[c].ramp.strain;
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) {
        const double at = i <= ALPHA ? v[i] * scale : v[i];
        fit->unknown[i] = (kn_fit_unknown){.name = name[i], .value = at, .low = at / 1e4, .high = at * 1e4};
    }
    const double fastest = fit->unknown[ALPHA].value * exp(-v[BETA] * w->highest);
    w->c1_low = NEVER_C1 * fastest;
    w->c1_high = 1e3 * fit->unknown[ALPHA].value;
    // alpha scales with exp(beta P), so its range is far wider.
    fit->unknown[ALPHA].low /= 1e20, fit->unknown[ALPHA].high *= 1e20;
    fit->unknown[K1].fixed = w->r->scale != KN_RELAXATION_RISE;
    for (int c = 0; c < w->r->curves; c++) {
        const double at = v[BEGIN + c], first = w->r->curve[c].hold.value[0];
        fit->unknown[BEGIN + c] = (kn_fit_unknown){"Pi", at, first / 10, first * 10, .fixed = w->r->curve[c].rises};
    }
    leave_out(&fit->unknown[C1], v[C1] * scale);
    leave_out(&fit->unknown[P0], 0);
    leave_out(&fit->unknown[P1], INFINITY);
}

static void let(kn_fit_unknown *u, double low, double high)
{
    u->fixed = false;
    u->low = low;
    u->high = high;
}

static double aicc_of(const kn_fit *fit) { return kn_fit_aicc(fit->readings, fit->readings - fit->freedom, fit->sum); }

// Fit the element without P0 and P1, with or without c1. The starts are the best fit of the holds, with larger k1 and
// c1 if a rise determines them. With c1, the fit without it is a start, too.
static bool fit_base(work *w, bool c1, const kn_fit *without)
{
    static const double more[4] = {1, 1.5, 3, 1}, dash[4] = {1, 1, 1, 4};
    double v[KN_FIT_UNKNOWNS], start[5][KN_FIT_UNKNOWNS];
    if (!fit_holds(w, c1, false, v)) return false;
    unknowns_around(w, v);
    kn_fit_unknown *u = w->fit.unknown;
    int starts = u[K1].fixed ? 1 : 4;
    if (c1) let(&u[C1], w->c1_low, w->c1_high);
    for (int s = 0; s < starts; s++) {
        for (int i = 0; i < w->fit.unknowns; i++) start[s][i] = u[i].value;
        for (int i = K1; i <= ALPHA; i++) start[s][i] *= u[K1].fixed ? 1 : more[s];
        start[s][C1] *= dash[s];
    }
    for (int i = 0; without && i < w->fit.unknowns; i++) start[starts][i] = without->unknown[i].value;
    if (without) start[starts++][C1] = 10 * w->c1_low;
    return kn_fit_run_from(&w->fit, starts, (const double(*)[KN_FIT_UNKNOWNS])start);
}

// Add P0 or P1 to the fit in w->fit. The starts are several shares of the stresses, since a clamp beyond the stresses
// has no gradient.
static bool add_clamp(work *w, int which)
{
    static const double below[3] = {1.15, 1.8, 3.5}, above[2] = {0.85, 0.65};
    const int starts = which == P0 ? 3 : 2;
    double start[3][KN_FIT_UNKNOWNS];
    kn_fit_unknown *u = w->fit.unknown;
    // search only within the measured stresses
    let(&u[which], which == P0 ? w->lowest / 100 : w->lowest, w->highest);
    for (int s = 0; s < starts; s++) {
        for (int i = 0; i < w->fit.unknowns; i++) start[s][i] = u[i].value;
        start[s][which] = which == P0 ? fmin(below[s] * w->lowest, 0.9 * w->highest) : above[s] * w->highest;
    }
    return kn_fit_run_from(&w->fit, starts, (const double(*)[KN_FIT_UNKNOWNS])start);
}

// Find the lowest stress of the holds and the highest of all readings.
static void measured(work *w)
{
    w->lowest = INFINITY;
    for (int c = 0; c < w->r->curves; c++)
        for (int part = 0; part < 2; part++) {
            const kn_time_bins *b = part ? &w->r->curve[c].hold : &w->r->curve[c].rise;
            for (int i = 0; i < b->count; i++) {
                if (part && b->value[i] > 0) w->lowest = fmin(w->lowest, b->value[i]);
                w->highest = fmax(w->highest, b->value[i]);
            }
        }
}

// Find the lowest and highest stress of the fit at the readings.
static void visited(kn_relaxation_fit *r)
{
    r->lowest_pa = INFINITY;
    for (int c = 0; c < r->curves; c++)
        for (int i = 0; i < r->curve[c].rise.count + r->curve[c].hold.count; i++) {
            if (i >= r->curve[c].rise.count) r->lowest_pa = fmin(r->lowest_pa, r->curve[c].fit_pa[i]);
            r->highest_pa = fmax(r->highest_pa, r->curve[c].fit_pa[i]);
        }
}

// Return whether P0 and P1, if they are unknowns, are well within the measured stresses. At the end of the range they
// have no effect.
static bool is_inside(const work *w)
{
    const kn_fit_unknown *p0 = &w->fit.unknown[P0], *p1 = &w->fit.unknown[P1];
    return (p0->fixed || p0->value > INSIDE * w->lowest) && (p1->fixed || p1->value < w->highest / INSIDE);
}

// Keep w->fit as the best if its AICc is lower than the best so far by more than 2. A fit with more parameters must
// achieve that.
static void consider(work *w, bool ok, kn_fit *best, double *least)
{
    if (!ok || !is_inside(w) || !(aicc_of(&w->fit) < *least - (*least < INFINITY ? 2 : 0))) return;
    *least = aicc_of(&w->fit);
    *best = w->fit;
}

// Try P1 as an unknown, then P0, then both. The fit with both starts from the fit with P0.
static void consider_clamps(work *w, const kn_fit *base, kn_fit *best, double *least)
{
    w->fit = *base;
    consider(w, add_clamp(w, P1), best, least);
    w->fit = *base;
    const bool ok = add_clamp(w, P0);
    consider(w, ok, best, least);
    consider(w, ok && add_clamp(w, P1), best, least);
}

// Choose the model. c1 is always an unknown: if the material has a c1, a fit without c1 biases the other unknowns. The
// interval of c1 then shows whether c1 may be 0. The AICc decides whether P0 and P1 are unknowns. w->fit receives the
// best fit.
static bool choose(work *w)
{
    kn_fit best = {0}, base;
    double least = INFINITY;
    measured(w);
    const bool without = fit_base(w, false, NULL);
    base = w->fit;
    if (!fit_base(w, true, without ? &base : NULL)) return false;
    base = w->fit;
    consider(w, true, &best, &least);
    consider_clamps(w, &base, &best, &least);
    w->fit = best;
    w->r->p0 = !best.unknown[P0].fixed, w->r->p1 = !best.unknown[P1].fixed;
    return isfinite(least);
}

// ---- parameters and intervals

// Return by how much the sum of squares S exceeds the rise that chance explains, if this unknown, which the fit does
// not contain, is held at a value. A result above 0 excludes the value.
static double excess(const kn_fit *fit, int unknown, double value, double t)
{
    const double sum = kn_fit_held(fit, unknown, value);
    return isnan(sum) ? 1 : sum - fit->sum - t * t * fit->scale * fit->scale;
}

// Return the bound of an unknown: the value, from `from` (where the unknown has no effect) up to `to`, beyond which the
// data exclude it.
static double bound(const kn_fit *fit, int unknown, double from, double to, double confidence)
{
    const double t = kn_fit_student(confidence, fit->freedom);
    double a = log(from), b = log(to);
    if (excess(fit, unknown, to, t) <= 0) return to;
    for (int i = 0; i < 9; i++) {
        const double middle = (a + b) / 2;
        *(excess(fit, unknown, exp(middle), t) > 0 ? &b : &a) = middle;
    }
    return exp(a);
}

// Store a one-sided bound as the interval, with the reason in words.
static void put_bound(kn_parameter_estimate *n, const char *name, const char *unit, bool at_most, double value,
                      const char *why)
{
    const kn_fit_interval i = {KN_FIT_PROFILE, at_most ? 0 : value, at_most ? value : (double)INFINITY, at_most,
                               !at_most};
    kn_parameter_estimate_set(n, name, unit, value, i);
    snprintf(n->words, sizeof n->words, "%s", why);
}

static void scale_by(kn_parameter_estimate *n, double factor)
{
    n->value *= factor;
    n->interval.low *= factor;
    n->interval.high *= factor;
}

// Return the lower bound (1) of k1 over all curves. Each is a lower bound, so the largest counts.
static double least_k1(const kn_relaxation_fit *r, const kn_fit *fit)
{
    double k1 = 0;
    for (int c = 0; c < r->curves; c++) {
        const double p = r->curve[c].fit_pa[0], inside = fmin(fmax(p, fit->unknown[P0].value), fit->unknown[P1].value);
        const double c2 = fit->unknown[ALPHA].value * exp(-fit->unknown[BETA].value * inside);
        k1 = fmax(k1, p * (1 + fit->unknown[C1].value / c2) / r->curve[c].ramp.strain);
    }
    return k1;
}

// Determine P0 and P1: with an interval if they are in the fit, else with a bound.
static void know_dampers(work *w, const kn_relaxation_fit_options *o)
{
    kn_relaxation_fit *r = w->r;
    kn_parameter_estimate *n = r->number;
    const double lowest = r->lowest_pa, highest = r->highest_pa;
    if (r->p0)
        kn_parameter_estimate_set(&n[P0], "P0", "Pa", w->fit.unknown[P0].value,
                                  kn_fit_interval_of(&w->fit, P0, o->confidence));
    else {
        put_bound(&n[P0], "P0", "Pa", true, bound(&w->fit, P0, lowest, 0.99 * highest, o->confidence),
                  "fitting P0 does not improve the fit; the lowest measured stress is used");
        n[P0].value = lowest;
    }
    if (r->p1)
        kn_parameter_estimate_set(&n[P1], "P1", "Pa", w->fit.unknown[P1].value,
                                  kn_fit_interval_of(&w->fit, P1, o->confidence));
    else {
        put_bound(&n[P1], "P1", "Pa", false, bound(&w->fit, P1, highest, 1.01 * lowest, o->confidence),
                  "fitting P1 does not improve the fit; the highest measured stress is used");
        n[P1].value = highest;
    }
}

// Store c1 with its interval. A c1 that may be 0 is set to 0.
static void know_c1(work *w, const kn_relaxation_fit_options *o, const char *name, const char *unit,
                    kn_parameter_estimate *n)
{
    kn_parameter_estimate_set(n, name, unit, w->fit.unknown[C1].value, kn_fit_interval_of(&w->fit, C1, o->confidence));
    if (n->known != KN_AT_MOST) return;
    n->value = 0;
    snprintf(n->words, sizeof n->words, "cannot be told from 0; 0 is used");
}

// Determine the parameters of a hold without a rise. The fit gives them as ratios to k1. In Pa and Pa s they are given
// for k1 at its lower bound.
static void know_without_rise(work *w, const kn_relaxation_fit_options *o)
{
    kn_relaxation_fit *r = w->r;
    const bool modulus = r->scale == KN_RELAXATION_MODULUS;
    const double k1 = modulus ? 1 : least_k1(r, &w->fit);
    know_c1(w, o, "c1/k1", "s", &r->ratio[0]);
    kn_parameter_estimate_set(&r->ratio[1], "alpha/k1", "s", w->fit.unknown[ALPHA].value,
                              kn_fit_interval_of(&w->fit, ALPHA, o->confidence));
    put_bound(&r->number[K1], "k1", "Pa", false, k1,
              modulus ? "a hold without its strain does not determine it"
                      : "exact if nothing had flowed by the first reading; c1 and alpha scale with it");
    if (modulus) r->number[K1].known = KN_UNKNOWN;
    for (int i = 0; i < 2; i++) {
        r->number[C1 + i] = r->ratio[i];
        r->number[C1 + i].name = i ? "alpha" : "c1";
        r->number[C1 + i].unit = "Pa*s";
        scale_by(&r->number[C1 + i], k1);
        if (modulus) r->number[C1 + i].known = KN_UNKNOWN;
    }
}

// Store all parameters with their intervals.
static void know(work *w, const kn_relaxation_fit_options *o)
{
    kn_relaxation_fit *r = w->r;
    kn_parameter_estimate *n = r->number;
    if (r->scale == KN_RELAXATION_RISE) {
        const double k1 = w->fit.unknown[K1].value;
        kn_parameter_estimate_set(&n[K1], "k1", "Pa", k1, kn_fit_interval_of(&w->fit, K1, o->confidence));
        know_c1(w, o, "c1", "Pa*s", &n[C1]);
        kn_parameter_estimate_set(&n[ALPHA], "alpha", "Pa*s", w->fit.unknown[ALPHA].value,
                                  kn_fit_interval_of(&w->fit, ALPHA, o->confidence));
    } else know_without_rise(w, o);
    kn_parameter_estimate_set(&n[BETA], "beta", "1/Pa", w->fit.unknown[BETA].value,
                              kn_fit_interval_of(&w->fit, BETA, o->confidence));
    know_dampers(w, o);
}

// Store the values only, for repeated fits.
static void know_values(work *w)
{
    static const char *const name[] = {"k1", "c1", "alpha", "beta", "P0", "P1"};
    static const char *const unit[] = {"Pa", "Pa*s", "Pa*s", "1/Pa", "Pa", "Pa"};
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++)
        w->r->number[i] = (kn_parameter_estimate){.name = name[i], .unit = unit[i], .value = w->fit.unknown[i].value};
}

// Compute fit, residuals and misfit of every curve.
static void judge(work *w)
{
    kn_relaxation_fit *r = w->r;
    double value[KN_FIT_UNKNOWNS];
    for (int i = 0; i < w->fit.unknowns; i++) value[i] = w->fit.unknown[i].value;
    for (int c = 0; c < r->curves; c++) {
        kn_relaxation_curve *k = &r->curve[c];
        const int count = k->rise.count + k->hold.count;
        predict(value, k, c, k->fit_pa);
        difference(w, k, k->fit_pa, k->residual);
        k->begin_pa = value[BEGIN + c];
        k->runs = kn_fit_runs(count, k->residual);
        for (int i = 0; i < count; i++) {
            const double at = i < k->rise.count ? k->rise.value[i] : k->hold.value[i - k->rise.count];
            k->misfit += fabs(k->fit_pa[i] / at - 1) / count;
        }
    }
    visited(r);
    r->aicc = aicc_of(&w->fit);
    r->unknowns = w->fit.readings - w->fit.freedom;
}

// Make the material from the parameters, unless the strain is unknown.
static void make_material(kn_relaxation_fit *r)
{
    const kn_parameter_estimate *n = r->number;
    if (r->scale == KN_RELAXATION_MODULUS) return;
    r->material = (kn_material){.k1_pa = n[K1].value,
                                .c1_pa_s = n[C1].value,
                                .damper = KN_DAMPER_EXPONENTIAL,
                                .alpha_pa_s = n[ALPHA].value,
                                .beta_per_pa = n[BETA].value,
                                .p0_pa = fmin(n[P0].value, 0.999 * n[P1].value),
                                .p1_pa = n[P1].value};
}

bool kn_relaxation_fit_run(kn_relaxation_fit *r, int curves, const kn_curve *curve,
                           const kn_relaxation_fit_options *options, char *error, size_t error_size)
{
    *r = (kn_relaxation_fit){0};
    snprintf(error, error_size, "%d curves at once, expected at most %d", curves, KN_RELAXATION_CURVES);
    if (curves > KN_RELAXATION_CURVES) return false;
    if (!kn_relaxation_take(r, curves, curve, options->constant_noise, error, error_size)) return false;
    work w = {.r = r, .constant_noise = options->constant_noise};
    snprintf(error, error_size,
             "%s: no parameters of the element fit; expected a stress that falls while the strain is held",
             curve->file);
    if (!choose(&w)) return false;
    judge(&w);
    if (options->no_intervals) know_values(&w);
    else know(&w, options);
    make_material(r);
    return true;
}

void kn_relaxation_fit_free(kn_relaxation_fit *r)
{
    for (int c = 0; c < r->curves; c++) {
        kn_time_bins_free(&r->curve[c].rise);
        kn_time_bins_free(&r->curve[c].hold);
        free(r->curve[c].fit_pa);
    }
    *r = (kn_relaxation_fit){0};
}
