#include "clients/identify/relaxation_fit.h"
#include "clients/identify/constitutive_models.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { K1, C1, ALPHA, BETA, P0, P1, BEGIN };
_Static_assert((int)P1 == KN_ESTIMATE_P1, "the unknowns begin with the six parameters");
// lower bound of c1, as a share of the shortest measured time constant; a smaller c1 has no effect
#define NEVER_C1 1e-3
#define INSIDE 1.05 // P0 and P1 must be within the measured stresses by this factor

typedef struct work {
    kn_relaxation_fit *r;
    kn_relaxation_fit_options options;
    kn_fit fit;             // the unknowns are K1 to P1, followed by a stress Pi for each curve
    double c1_low, c1_high; // bounds of c1 while it is free; the bounds of a fixed unknown equal its value
    // lowest: least measured stress of the holds; highest: largest measured stress of holds and rises
    double lowest, highest;
} work;

// ---- the stress of the papers' element

// Compute the stress at the means of the rise and at the first mean of the hold. P1 is limited so that exp(beta P1)
// does not overflow.
static bool by_chain(const kn_material *m, const kn_relaxation_curve *c, double *out)
{
    kn_voigt_chain chain = kn_voigt_chain_of(m);
    chain.p1_pa = fmin(m->p1_pa, 600 / m->beta_per_pa);
    double time_s[KN_RELAXATION_RISE_BINS + 1];
    for (int i = 0; i <= c->rise.count; i++) time_s[i] = c->ramp.end_s + c->rise.time_s[i];
    if (chain.p0_pa >= chain.p1_pa) return false;
    return kn_voigt_chain_stress(&chain, c->ramp.steps, c->ramp.step, c->rise.count + 1, time_s, out) &&
           out[c->rise.count] > 0;
}

// Predict the stress of one curve. If the curve has a rise, a Voigt chain computes the rise, and the closed form of the
// hold begins with the last stress of the chain. Otherwise the closed form begins with the unknown Pi.
static bool predict(const double *v, const kn_relaxation_curve *c, int number, double *out)
{
    const kn_material m = kn_estimate_material(v);
    double begin_pa = v[BEGIN + number], begin_s = 0;
    if (c->rises) {
        if (!by_chain(&m, c, out)) return false;
        out += c->rise.count;
        begin_pa = *out;
        begin_s = c->hold.time_s[0];
    }
    const kn_held_element held = kn_held_element_of(&m, begin_pa);
    // out[] first holds the times, and then the stresses in their place
    for (int i = 0; i < c->hold.count; i++) out[i] = c->hold.time_s[i] - begin_s;
    kn_held_element_stress(&held, c->hold.count, out, out);
    return true;
}

static int means(const kn_relaxation_curve *c) { return c->rise.count + c->hold.count; }

// Compute the residuals of one curve. With constant noise they are differences of the stress, in units of the noise.
// Otherwise they are differences of the logarithm of the stress.
static bool difference(const work *w, const kn_relaxation_curve *c, const double *fit, double *residual)
{
    const kn_time_bins *b = &c->rise;
    for (int i = 0; i < means(c); i++) {
        if (w->options.constant_noise) residual[i] = (fit[i] - b->value[i]) * sqrt(b->weight[i]) / c->curve->noise;
        else if (fit[i] > 0) residual[i] = log(fit[i] / b->value[i]);
        else return false;
    }
    return true;
}

static bool misfit(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const work *w = of;
    for (int c = 0, n = 0; c < w->r->curves; c++) {
        const kn_relaxation_curve *k = &w->r->curve[c];
        double *out = residual + n; // the predicted stresses and their residuals share memory
        if (!predict(value, k, c, out) || !difference(w, k, out, out)) return false;
        n += means(k);
    }
    return true;
}

// ---- the search for the parameters

// State of the first search, which fits the holds alone, since the closed form of a hold is cheap to compute. The
// search uses the unknowns and starts of the papers' damper from constitutive_models.h.
typedef struct holds {
    work alone; // state of a fit in which no curve has a rise
    kn_constitutive_model model;
    kn_compared_curve curve[KN_RELAXATION_CURVES];
} holds;

// Convert the unknowns of the constitutive model to the unknowns of this fit, with k1 = 1.
static void expand(const holds *h, const double *from, double to[KN_FIT_UNKNOWNS])
{
    int n = 2;
    to[K1] = 1;
    to[ALPHA] = from[0];
    to[BETA] = from[1];
    to[C1] = h->model.c1 ? from[n++] : 0;
    to[P0] = 0;
    to[P1] = INFINITY;
    for (int c = 0; c < h->alone.r->curves; c++) to[BEGIN + c] = from[n + c];
}

static bool misfit_of_holds(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    holds *h = of;
    double v[KN_FIT_UNKNOWNS];
    expand(h, value, v);
    return misfit(&h->alone, v, residual);
}

// Find the best fit of the holds without P0 and P1. Return false if the search fails.
static bool fit_holds(const work *w, bool c1, double out[KN_FIT_UNKNOWNS])
{
    kn_relaxation_fit r = *w->r;
    holds h = {.alone = {.r = &r, .options = w->options},
               .model = {.kind = KN_CONSTITUTIVE_PAPERS, .relax = true, .c1 = c1}};
    double start[KN_CONSTITUTIVE_STARTS][KN_FIT_UNKNOWNS], value[KN_FIT_UNKNOWNS];
    kn_fit fit = {.misfit = misfit_of_holds, .of = &h};
    for (int c = 0; c < r.curves; c++) {
        const kn_time_bins *b = &r.curve[c].hold;
        r.curve[c].rises = false;
        r.curve[c].rise = *b;
        r.curve[c].rise.count = 0;
        h.curve[c] = (kn_compared_curve){.curve = r.curve[c].curve, .strain = 1};
        h.curve[c].part[0] = (kn_compared_part){.count = b->count, .time_s = b->time_s, .value = b->value};
        fit.readings += b->count;
    }
    fit.unknowns = kn_constitutive_unknowns(&h.model, r.curves, h.curve, fit.unknown);
    if (fit.readings <= fit.unknowns) return false;
    if (!kn_fit_run_from(&fit, kn_constitutive_starts(&h.model, r.curves, h.curve, 0, NULL, start), start))
        return false;
    kn_fit_values(&fit, value);
    expand(&h, value, out);
    return true;
}

static void leave_out(kn_fit_unknown *u, double value)
{
    u->fixed = true;
    u->value = u->low = u->high = value;
}

// Set the unknowns to the values v[], with bounds around these values. c1, P0 and P1 are fixed for now.
static void unknowns_around(work *w, const double v[KN_FIT_UNKNOWNS])
{
    kn_fit *fit = &w->fit;
    double scale = 1;
    *fit = (kn_fit){.readings = w->r->readings, .misfit = misfit, .of = w, .unknowns = BEGIN + w->r->curves};
    // For each curve with a rise, compute k1 by equation (1) of the header, at the start of the hold.
    for (int c = 0; c < w->r->curves; c++)
        if (w->r->curve[c].rises)
            scale = v[BEGIN + c] * (1 + v[C1] / v[ALPHA] * exp(v[BETA] * v[BEGIN + c])) / w->r->curve[c].ramp.strain;
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) {
        const double at = i <= ALPHA ? v[i] * scale : v[i];
        fit->unknown[i] = (kn_fit_unknown){.name = kn_estimate_name[i], .value = at, .low = at / 1e4, .high = at * 1e4};
    }
    const double fastest = fit->unknown[ALPHA].value * exp(-v[BETA] * w->highest);
    w->c1_low = NEVER_C1 * fastest;
    w->c1_high = 1e3 * fit->unknown[ALPHA].value;
    // The search range of alpha is far wider than the other ranges, since alpha scales with exp(beta P).
    fit->unknown[ALPHA].low /= 1e20, fit->unknown[ALPHA].high *= 1e20;
    fit->unknown[K1].fixed = w->r->scale != KN_RELAXATION_RISE;
    for (int c = 0; c < w->r->curves; c++) {
        const double at = v[BEGIN + c], first = w->r->curve[c].hold.value[0];
        fit->unknown[BEGIN + c] = (kn_fit_unknown){
            .name = "Pi", .value = at, .low = first / 10, .high = first * 10, .fixed = w->r->curve[c].rises};
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

// Fit the element without P0 and P1, with or without c1. One start is the best fit of the holds. If a rise determines
// k1 and c1, further starts have larger k1 and c1. If c1 is an unknown, the fit without c1 is one more start.
static bool fit_base(work *w, bool c1, const kn_fit *without)
{
    static const double more[4] = {1, 1.5, 3, 1}, dash[4] = {1, 1, 1, 4};
    double v[KN_FIT_UNKNOWNS], start[5][KN_FIT_UNKNOWNS];
    if (!fit_holds(w, c1, v)) return false;
    unknowns_around(w, v);
    kn_fit_unknown *u = w->fit.unknown;
    int starts = u[K1].fixed ? 1 : 4;
    if (c1) let(&u[C1], w->c1_low, w->c1_high);
    for (int s = 0; s < starts; s++) {
        kn_fit_values(&w->fit, start[s]);
        for (int i = K1; i <= ALPHA; i++) start[s][i] *= u[K1].fixed ? 1 : more[s];
        start[s][C1] *= dash[s];
    }
    if (without) {
        kn_fit_values(without, start[starts]);
        start[starts++][C1] = 10 * w->c1_low;
    }
    return kn_fit_run_from(&w->fit, starts, start);
}

// Make P0 or P1 an unknown of w->fit, starting at several shares of the measured stresses. A start outside the measured
// stresses would have no effect on the fit, so the search could not move it.
static bool add_clamp(work *w, int which)
{
    static const double below[3] = {1.15, 1.8, 3.5}, above[2] = {0.85, 0.65};
    const int starts = which == P0 ? 3 : 2;
    double start[3][KN_FIT_UNKNOWNS];
    kn_fit_unknown *u = w->fit.unknown;
    // search P1 within the measured stresses, and P0 also below them
    let(&u[which], which == P0 ? w->lowest / 100 : w->lowest, w->highest);
    for (int s = 0; s < starts; s++) {
        kn_fit_values(&w->fit, start[s]);
        start[s][which] = which == P0 ? fmin(below[s] * w->lowest, 0.9 * w->highest) : above[s] * w->highest;
    }
    return kn_fit_run_from(&w->fit, starts, start);
}

// Find the lowest measured stress of the holds, and the highest of all readings.
static void measured(work *w)
{
    w->lowest = INFINITY;
    for (int c = 0; c < w->r->curves; c++) {
        const kn_relaxation_curve *k = &w->r->curve[c];
        for (int i = 0; i < means(k); i++) {
            const double p = k->rise.value[i];
            if (i >= k->rise.count && p > 0) w->lowest = fmin(w->lowest, p);
            w->highest = fmax(w->highest, p);
        }
    }
}

// Keep w->fit as the best fit if its AICc is below the least AICc so far by more than 2. A smaller decrease would not
// justify the further parameters. If P0 or P1 is an unknown, it must be well within the measured stresses, since it has
// no effect at the end of their range.
static void consider(work *w, bool ok, kn_fit *best, double *least)
{
    const kn_fit_unknown *p0 = &w->fit.unknown[P0], *p1 = &w->fit.unknown[P1];
    const bool inside = (p0->fixed || p0->value > INSIDE * w->lowest) && (p1->fixed || p1->value < w->highest / INSIDE);
    const double aicc = ok && inside ? aicc_of(&w->fit) : INFINITY;
    if (!(aicc < *least - (*least < INFINITY ? 2 : 0))) return;
    *least = aicc;
    *best = w->fit;
}

// Try P1 as an unknown, then P0, then both. The fit with P0 and P1 starts from the fit with P0 alone.
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

// ---- values and intervals of the parameters

// Hold an unknown at a value and fit the others. Return by how much the sum of squares S then rises beyond the rise
// that chance explains. A result above 0 excludes the value.
static double excess(const kn_fit *fit, int unknown, double value, double t)
{
    const double sum = kn_fit_held(fit, unknown, value);
    return isnan(sum) ? 1 : sum - fit->sum - t * t * fit->scale * fit->scale;
}

// Return the bound of an unknown that is not in the fit: the value beyond which the data exclude it. The bound lies
// between the value `from`, where the unknown has no effect, and the value `to`.
static double bound(const work *w, int unknown, double from, double to)
{
    const double t = kn_fit_student(w->options.confidence, w->fit.freedom);
    double a = log(from), b = log(to);
    if (excess(&w->fit, unknown, to, t) <= 0) return to;
    for (int i = 0; i < 9; i++) {
        const double middle = (a + b) / 2;
        *(excess(&w->fit, unknown, exp(middle), t) > 0 ? &b : &a) = middle;
    }
    return exp(a);
}

// Store the value and the interval of the unknown i.
static void know(const work *w, int i, kn_parameter_estimate *n, const char *name, const char *unit)
{
    kn_parameter_estimate_set(n, name, unit, w->fit.unknown[i].value,
                              kn_fit_interval_of(&w->fit, i, w->options.confidence));
    // A c1 that may be 0 is set to 0.
    if (i != C1 || n->known != KN_AT_MOST) return;
    n->value = 0;
    snprintf(n->words, sizeof n->words, "these curves do not show whether this parameter is above 0; 0 is used");
}

// Store a one-sided bound as the interval of a parameter.
static void put_bound(kn_parameter_estimate *number, int i, bool at_most, double value)
{
    const double low = at_most ? 0 : value, high = at_most ? value : (double)INFINITY;
    kn_parameter_estimate_set(&number[i], kn_estimate_name[i], kn_estimate_unit[i], value,
                              (kn_fit_interval){KN_FIT_PROFILE, low, high, at_most, !at_most});
}

// Return the lower bound of k1 by equation (1) of the header. Every curve gives a lower bound, so return the largest of
// these bounds.
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

// Store P0 or P1: with an interval if it is an unknown of the fit, otherwise with a bound.
static void know_clamp(work *w, int i)
{
    kn_relaxation_fit *r = w->r;
    kn_parameter_estimate *n = &r->number[i];
    const bool p0 = i == P0;
    if (p0 ? r->p0 : r->p1) {
        know(w, i, n, kn_estimate_name[i], kn_estimate_unit[i]);
        return;
    }
    const double idle = p0 ? r->lowest_pa : r->highest_pa; // a value of P0 or P1 without effect on the fit
    put_bound(r->number, i, p0, bound(w, i, idle, p0 ? 0.99 * r->highest_pa : 1.01 * r->lowest_pa));
    n->value = idle;
    snprintf(n->words, sizeof n->words, "fitting %s does not improve the fit; the %s measured stress is used", n->name,
             p0 ? "lowest" : "highest");
}

// Store k1, c1 and alpha of holds without a rise. The fit gives c1 and alpha as ratios to k1. Their values in Pa s are
// for k1 at its lower bound.
static void know_without_rise(work *w)
{
    kn_relaxation_fit *r = w->r;
    kn_parameter_estimate *n = r->number;
    const bool modulus = r->scale == KN_RELAXATION_MODULUS;
    const double k1 = modulus ? 1 : least_k1(r, &w->fit);
    know(w, C1, &r->ratio[0], "c1/k1", "s");
    know(w, ALPHA, &r->ratio[1], "alpha/k1", "s");
    put_bound(n, K1, false, k1);
    snprintf(n[K1].words, sizeof n->words, "%s",
             modulus ? "a hold without its strain does not determine this parameter"
                     : "this bound is exact if nothing had flowed by the first reading; c1 and alpha scale with k1");
    for (int i = C1; i <= ALPHA; i++) {
        n[i] = r->ratio[i - C1];
        n[i].name = kn_estimate_name[i];
        n[i].unit = kn_estimate_unit[i];
        n[i].value *= k1;
        n[i].interval.low *= k1;
        n[i].interval.high *= k1;
    }
    for (int i = K1; modulus && i <= ALPHA; i++) n[i].known = KN_UNKNOWN;
}

// Store all parameters with their intervals. With the option no_intervals, store only the values, for callers that
// repeat the fit many times.
static void know_all(work *w)
{
    kn_parameter_estimate *n = w->r->number;
    if (w->options.no_intervals) {
        for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++)
            n[i] = (kn_parameter_estimate){
                .name = kn_estimate_name[i], .unit = kn_estimate_unit[i], .value = w->fit.unknown[i].value};
        return;
    }
    if (w->r->scale != KN_RELAXATION_RISE) know_without_rise(w);
    for (int i = w->r->scale == KN_RELAXATION_RISE ? K1 : BETA; i <= BETA; i++)
        know(w, i, &n[i], kn_estimate_name[i], kn_estimate_unit[i]);
    know_clamp(w, P0);
    know_clamp(w, P1);
}

// Compute fit, residuals and misfit of every curve, the lowest fitted stress of the holds, and the highest fitted
// stress.
static void judge(work *w)
{
    kn_relaxation_fit *r = w->r;
    double value[KN_FIT_UNKNOWNS];
    kn_fit_values(&w->fit, value);
    r->lowest_pa = INFINITY;
    for (int c = 0; c < r->curves; c++) {
        kn_relaxation_curve *k = &r->curve[c];
        predict(value, k, c, k->fit_pa);
        difference(w, k, k->fit_pa, k->residual);
        k->runs = kn_fit_runs(means(k), k->residual);
        for (int i = 0; i < means(k); i++) {
            k->misfit += fabs(k->fit_pa[i] / k->rise.value[i] - 1) / means(k);
            if (i >= k->rise.count) r->lowest_pa = fmin(r->lowest_pa, k->fit_pa[i]);
            r->highest_pa = fmax(r->highest_pa, k->fit_pa[i]);
        }
    }
}

// Make the material from the parameters, if the strain is known.
static void make_material(kn_relaxation_fit *r)
{
    double value[KN_ESTIMATE_NUMBERS];
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) value[i] = r->number[i].value;
    value[P0] = fmin(value[P0], 0.999 * value[P1]);
    if (r->scale != KN_RELAXATION_MODULUS) r->material = kn_estimate_material(value);
}

bool kn_relaxation_fit_run(kn_relaxation_fit *r, int curves, const kn_curve *curve,
                           const kn_relaxation_fit_options *options, char *error, size_t error_size)
{
    *r = (kn_relaxation_fit){0};
    snprintf(error, error_size, "%d curves at once, expected at most %d", curves, KN_RELAXATION_CURVES);
    if (curves > KN_RELAXATION_CURVES) return false;
    if (!kn_relaxation_take(r, curves, curve, options->constant_noise, error, error_size)) return false;
    work w = {.r = r, .options = *options};
    snprintf(error, error_size,
             "%s: no parameters of the element fit; expected a stress that falls while the strain is held",
             curve->file);
    if (!choose(&w)) return false;
    judge(&w);
    know_all(&w);
    make_material(r);
    return true;
}

void kn_relaxation_fit_free(kn_relaxation_fit *r)
{
    for (int c = 0; c < r->curves; c++) {
        kn_time_bins_free(&r->curve[c].rise);
        free(r->curve[c].fit_pa);
    }
    *r = (kn_relaxation_fit){0};
}
