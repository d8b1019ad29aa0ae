#include "clients/identify/profile_interval.h"
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

enum { CORRECTIONS = 8, ENDS_TRIED = 10 };

#define REACH 0.3  // within which the others stay, in their logarithms
#define STRIDE 0.7 // largest step along a profile, in the logarithm of the unknown

// Values on the way to one end of an interval, and the model linearised about them.
typedef struct place {
    kn_fit about;
    double *at, *slope; // [readings], [unknowns][readings]
    // [unknowns] where the unknowns should stay, in the variables of the search, and how far they may go from there
    double near[KN_FIT_UNKNOWNS], reach;
} place;

// One end of the profile interval of an unknown: the value at which the sum of squares has risen by t standard
// deviations, while the others are fitted anew. The ends are found side by side, each in a thread.
typedef struct profile {
    const kn_fit *best;
    const double *at; // [readings] residuals at the best values
    double scale, t;
    int unknown, side;
    place now, inner;              // where the search is; the outermost place whose sum has not risen enough
    double along[KN_FIT_UNKNOWNS]; // how the others follow the unknown
    kn_fit trial;                  // scratch, as is `residual`
    double *residual;
    double end; // result; open: the sum does not rise enough before the bound
    bool open;
    double least, lower[KN_FIT_UNKNOWNS]; // least sum of squares that was met, and the values there
} profile;

static double width(const kn_fit_unknown *u) { return u->linear ? u->high - u->low : 1; } // makes unknowns comparable

// Compute the residuals of the linearised model, and after them the distances from `near`.
static bool misfit_straight(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const place *l = of;
    const int unknowns = l->about.unknowns, readings = l->about.readings;
    memcpy(residual, l->at, (size_t)readings * sizeof *residual);
    for (int k = 0; k < unknowns; k++) {
        const kn_fit_unknown *u = &l->about.unknown[k];
        const double to = kn_fit_inwards(u, value[k]), way = to - kn_fit_inwards(u, u->value);
        for (int i = 0; i < readings; i++) residual[i] += l->slope[k * readings + i] * way;
        residual[readings + k] = (to - l->near[k]) / (l->reach * width(u));
    }
    return true;
}

static void copy_place(const profile *p, place *to, const place *from)
{
    const size_t readings = (size_t)p->best->readings * sizeof(double);
    to->about = from->about;
    memcpy(to->at, from->at, readings);
    memcpy(to->slope, from->slope, (size_t)p->best->unknowns * readings);
}

// Correct the slopes by what other values have changed (Broyden), and go there unless `stay`: the valley of a poorly
// determined pair of numbers, such as alpha and beta, is long and bent.
static void go_to(const profile *p, place *now, const double *value, const double *residual, bool stay)
{
    const int unknowns = p->best->unknowns, readings = p->best->readings;
    double way[KN_FIT_UNKNOWNS], share[KN_FIT_UNKNOWNS], size = 1e-300;
    for (int u = 0; u < unknowns; u++) {
        kn_fit_unknown *is = &now->about.unknown[u];
        way[u] = kn_fit_inwards(is, value[u]) - kn_fit_inwards(is, is->value);
        share[u] = way[u] / pow(width(is), 2);
        size += way[u] * share[u];
        if (!stay) is->value = value[u];
    }
    for (int i = 0; i < readings; i++) {
        double left = residual[i] - now->at[i];
        for (int u = 0; u < unknowns; u++) left -= now->slope[u * readings + i] * way[u];
        for (int u = 0; u < unknowns; u++) now->slope[u * readings + i] += left * share[u] / size;
        if (!stay) now->at[i] = residual[i];
    }
}

// Move the unknown to `to` and let the others follow, in up to CORRECTIONS presses. Along a flat valley the others stay
// near where the last steps predict them. Return by how many standard deviations the sum of squares is then above
// the least.
static double risen(profile *p, double to)
{
    const kn_fit_unknown *u = p->now.about.unknown;
    const int unknowns = p->best->unknowns, readings = p->best->readings;
    double value[KN_FIT_UNKNOWNS], *near = p->now.near, sum = INFINITY;
    const double way = kn_fit_inwards(&u[p->unknown], to) - kn_fit_inwards(&u[p->unknown], u[p->unknown].value);
    for (int k = 0; k < unknowns; k++)
        near[k] = kn_fit_inwards(&u[k], u[k].value) + fmin(fmax(p->along[k] * way, -1), 1);
    p->now.reach = REACH / p->scale;
    for (int turn = 0; turn < CORRECTIONS; turn++) {
        p->trial = p->now.about;
        p->trial.misfit = misfit_straight, p->trial.of = &p->now, p->trial.readings = readings + unknowns;
        p->trial.jacobian = NULL, p->trial.coarse = p->trial.concurrent = false;
        p->trial.unknown[p->unknown].value = to;
        p->trial.unknown[p->unknown].fixed = true;
        if (!kn_fit_run(&p->trial)) break;
        kn_fit_values(&p->trial, value);
        if (!p->best->misfit(p->best->of, value, p->residual)) break;
        const double now = kn_fit_squares(p->residual, readings);
        if (!isfinite(now)) break;
        if (now < p->least) p->least = now, memcpy(p->lower, value, sizeof value);
        const double gain = sum - now;
        go_to(p, &p->now, value, p->residual, turn > 0 && gain < 0);
        if (gain < 0) p->now.reach /= 3;
        else sum = now;
        for (int k = 0; k < unknowns; k++) near[k] = kn_fit_inwards(&u[k], u[k].value);
        if (fabs(gain) < 0.1 * p->t * p->t * p->scale * p->scale) break;
    }
    return sqrt(fmax(sum - p->best->sum, 0)) / p->scale;
}

// Compute the slopes at the inner place anew.
static void refresh(profile *p)
{
    double value[KN_FIT_UNKNOWNS];
    kn_fit_values(&p->inner.about, value);
    for (int k = 0; k < p->best->unknowns; k++) {
        const kn_fit_unknown *u = &p->inner.about.unknown[k];
        const double old = value[k], step = 0.01 * width(u);
        if (u->fixed) continue;
        value[k] = u->linear ? old - step : old * exp(-step);
        const bool good = value[k] >= u->low && p->best->misfit(p->best->of, value, p->residual);
        value[k] = old;
        for (int i = 0; i < p->best->readings && good; i++)
            p->inner.slope[k * p->best->readings + i] = (p->inner.at[i] - p->residual[i]) / step;
    }
}

// Find the end. Distances are in the variable of the search, from the best value outwards.
static void *find_end(void *of)
{
    profile *p = of;
    const kn_fit_unknown *u = &p->best->unknown[p->unknown];
    const double here = kn_fit_inwards(u, u->value), bound = p->side ? u->high : u->low, sign = p->side ? 1 : -1;
    const double farthest = fmin(sign * (kn_fit_inwards(u, bound) - here), u->linear ? INFINITY : log(KN_PROFILE_FAR));
    double inner = 0, inner_rise = 0, outer = INFINITY, outer_rise = 0;
    const double *covariance = p->best->covariance[p->unknown], stride = u->linear ? INFINITY : STRIDE;
    double next = fmin(fmin(p->t * p->scale * sqrt(covariance[p->unknown]), farthest), stride);
    copy_place(p, &p->now, &p->inner);
    for (int k = 0; k < p->best->unknowns; k++) {
        p->along[k] = covariance[k] / covariance[p->unknown];
        if (!isfinite(p->along[k])) p->along[k] = 0;
    }
    for (int i = 0; i < ENDS_TRIED && outer - inner > 0.1 * inner; i++) {
        const double to = here + sign * next, rise = risen(p, u->linear ? to : exp(to));
        if (rise < p->t) {
            for (int k = 0; k < p->best->unknowns; k++) {
                const kn_fit_unknown *from = &p->inner.about.unknown[k], *now = &p->now.about.unknown[k];
                p->along[k] =
                    (kn_fit_inwards(now, now->value) - kn_fit_inwards(from, from->value)) / (sign * (next - inner));
            }
            inner = next, inner_rise = rise;
            if (next >= farthest) break;
            copy_place(p, &p->inner, &p->now);
            if (!isfinite(outer)) {
                next = fmin(fmin(inner * fmin(fmax(1.1 * p->t / rise, 1.5), 2), inner + stride), farthest);
                continue;
            }
        } else {
            if (!isfinite(outer)) refresh(p);
            outer = next, outer_rise = fmin(rise, 4 * p->t);
            if (rise < 1.2 * p->t) break;
            copy_place(p, &p->now, &p->inner);
        }
        next = inner + 0.5 * (outer - inner);
    }
    p->open = !isfinite(outer) && inner >= farthest;
    double way = inner + (p->t - inner_rise) / (outer_rise - inner_rise) * (outer - inner);
    if (!isfinite(outer)) way = fmin(inner * p->t / fmax(inner_rise, 0.5 * p->t), farthest);
    p->end = p->open ? bound : u->linear ? here + sign * way : exp(here + sign * way);
    return NULL;
}

static bool make_profile(profile *p)
{
    const size_t readings = (size_t)p->best->readings, unknowns = (size_t)p->best->unknowns;
    p->residual = malloc((3 + 2 * unknowns) * readings * sizeof *p->residual);
    if (!p->residual) return false;
    p->now.at = p->residual + readings, p->inner.at = p->now.at + readings;
    p->now.slope = p->inner.at + readings, p->inner.slope = p->now.slope + unknowns * readings;
    p->inner.about = *p->best;
    memcpy(p->inner.at, p->at, readings * sizeof *p->at);
    memcpy(p->inner.slope, p->best->jacobian, unknowns * readings * sizeof *p->inner.slope);
    return true;
}

int kn_profile_run(kn_fit *fit, const double *residual, double scale, int count, kn_fit_interval *interval)
{
    const int ends = 2 * count;
    profile *all = calloc((size_t)ends, sizeof *all), *better = NULL;
    pthread_t thread[2 * KN_FIT_UNKNOWNS];
    bool made = all, started[2 * KN_FIT_UNKNOWNS] = {false};
    const double t = kn_fit_student(0.95, fit->freedom), less = fit->sum - 0.1 * scale * scale;
    for (int i = 0; i < ends && made; i++) {
        const kn_fit_unknown *u = &fit->unknown[i / 2];
        profile *p = &all[i];
        p->best = fit, p->at = residual, p->scale = scale, p->t = t, p->least = less;
        p->unknown = i / 2, p->side = i % 2, p->end = u->value;
        made = u->fixed || make_profile(p);
    }
    for (int i = 0; i < ends && made; i++) {
        if (fit->unknown[i / 2].fixed) continue;
        started[i] = pthread_create(&thread[i], NULL, find_end, &all[i]) == 0;
        if (!started[i]) find_end(&all[i]);
    }
    for (int i = 0; i < ends && all; i++) {
        const profile *p = &all[i];
        if (started[i]) pthread_join(thread[i], NULL);
        free(p->residual);
        kn_fit_interval *to = &interval[i / 2];
        to->how = KN_FIT_PROFILE;
        if (p->side) to->high = p->end, to->open_high = p->open;
        else to->low = p->end, to->open_low = p->open;
        if (p->least < less && (!better || p->least < better->least)) better = &all[i];
    }
    for (int u = 0; u < fit->unknowns && made && better; u++) fit->unknown[u].value = better->lower[u];
    const int done = !made ? -1 : !better;
    free(all);
    return done;
}
