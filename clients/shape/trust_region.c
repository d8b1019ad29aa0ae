#include "clients/shape/trust_region.h"
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

// first_trust, most_trust: initial and largest size of the trust region, in the logarithm of an unknown
static const double first_trust = 0.8, most_trust = 1.6;
// secant: length of a new secant; short_secant: longest secant that is trusted when the search ends; both in the
// logarithm of an unknown
static const double secant = 0.2, short_secant = 0.3;
// distances between evaluations, in the logarithm of an unknown. settled: a shorter step ends the search; near:
// evaluations closer than this are treated as one; far: larger than any distance
static const double settled = 0.005, near = 1e-3, far = 1e9;
// the search ends if the next step is shorter than `secant` and its predicted decrease is below this share of the sum
// of squares
static const double promise = 1e-3;
// promise_far replaces `promise` if the sum of squares is above far_off per reading: the residuals are then ten times
// the noise
static const double promise_far = 1e-2, far_off = 100;

void kn_trust_region_free(kn_trust_region *s)
{
    for (int i = 0; i < s->evaluations; i++) free(s->evaluation[i].residual);
    for (int k = 0; k < KN_TRUST_UNKNOWNS; k++) free(s->slope[k]);
    memset(s, 0, sizeof *s);
}

// Return the value of an unknown from its logarithm, within the bounds.
static double value_at(const kn_trust_region *s, int unknown, double at)
{
    return fmin(fmax(exp(at), s->low[unknown]), s->high[unknown]);
}

static double distance(const kn_trust_region *s, const double *a, const double *b)
{
    double sum = 0;
    for (int k = 0; k < s->unknowns; k++) sum += (a[k] - b[k]) * (a[k] - b[k]);
    return sqrt(sum);
}

// Return the index of the evaluation at this place (within the distance `near`). If there is none, evaluate the model.
// Return -1 if memory runs out or if all evaluations are used up.
static int evaluate(kn_trust_region *s, const double at[KN_TRUST_UNKNOWNS])
{
    double value[KN_TRUST_UNKNOWNS] = {0};
    for (int i = 0; i < s->evaluations; i++)
        if (distance(s, s->evaluation[i].at, at) < near) return i;
    if (s->evaluations == KN_TRUST_EVALUATIONS) return -1;
    kn_evaluation *e = &s->evaluation[s->evaluations];
    *e = (kn_evaluation){.residual = calloc((size_t)s->readings + 1, sizeof *e->residual), .sum = INFINITY};
    if (!e->residual) return -1;
    s->evaluations++;
    for (int k = 0; k < s->unknowns; k++) {
        e->at[k] = at[k];
        value[k] = value_at(s, k, at[k]);
    }
    if (!s->misfit(s->of, value, e->residual)) return s->evaluations - 1;
    e->sum = 0;
    for (int i = 0; i < s->readings; i++) e->sum += e->residual[i] * e->residual[i];
    if (!isfinite(e->sum)) e->sum = INFINITY;
    return s->evaluations - 1;
}

static void choose_best(kn_trust_region *s)
{
    for (int i = 0; i < s->evaluations; i++)
        if (s->evaluation[i].sum < s->evaluation[s->best].sum) s->best = i;
}

// ---- the linear model of the residuals

static double cross(const double a[2], const double b[2]) { return a[0] * b[1] - a[1] * b[0]; }

// Find the evaluations nearest to the best one, in as many independent directions as there are unknowns. Return their
// greatest distance, or INFINITY if there are too few.
static double neighbours(const kn_trust_region *s, int number[KN_TRUST_UNKNOWNS])
{
    const double *here = s->evaluation[s->best].at;
    double farthest = 0;
    for (int k = 0; k < s->unknowns; k++) {
        double nearest = INFINITY;
        number[k] = s->best;
        for (int i = 0; i < s->evaluations; i++) {
            const double *there = s->evaluation[i].at, d = distance(s, here, there);
            if (i == s->best || !isfinite(s->evaluation[i].sum) || d >= nearest || d < 10 * near) continue;
            if (k == 1) {
                const double *first = s->evaluation[number[0]].at;
                const double a[2] = {first[0] - here[0], first[1] - here[1]},
                             b[2] = {there[0] - here[0], there[1] - here[1]};
                // The second direction must differ from the first by at least 20 degrees.
                if (fabs(cross(a, b)) < 0.35 * hypot(a[0], a[1]) * d) continue;
            }
            nearest = d;
            number[k] = i;
        }
        farthest = fmax(farthest, nearest);
    }
    return farthest;
}

// Compute the slopes of every residual from its differences to the neighbouring evaluations.
static void find_slopes(kn_trust_region *s, const int number[KN_TRUST_UNKNOWNS])
{
    const kn_evaluation *here = &s->evaluation[s->best];
    double way[2][2] = {{1, 0}, {0, 1}};
    for (int k = 0; k < s->unknowns; k++)
        for (int j = 0; j < s->unknowns; j++) way[k][j] = s->evaluation[number[k]].at[j] - here->at[j];
    const double det = cross(way[0], way[1]);
    for (int i = 0; i < s->readings; i++) {
        double rise[2] = {0};
        for (int k = 0; k < s->unknowns; k++) rise[k] = s->evaluation[number[k]].residual[i] - here->residual[i];
        s->slope[0][i] = (rise[0] * way[1][1] - rise[1] * way[0][1]) / det;
        if (s->unknowns > 1) s->slope[1][i] = (rise[1] * way[0][0] - rise[0] * way[1][0]) / det;
    }
}

// The linear model: residuals of the best evaluation plus slopes times the distance in logarithms.
static bool straight(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const kn_trust_region *s = of;
    const kn_evaluation *here = &s->evaluation[s->best];
    memcpy(residual, here->residual, (size_t)s->readings * sizeof *residual);
    for (int k = 0; k < s->unknowns; k++) {
        const double way = log(value[k]) - here->at[k];
        for (int i = 0; i < s->readings; i++) residual[i] += s->slope[k][i] * way;
    }
    return true;
}

// Set up the fit of the linear model within the trust region.
static kn_fit fit_of(const kn_trust_region *s, double trust)
{
    kn_fit fit = {.unknowns = s->unknowns, .readings = s->readings, .misfit = straight, .of = (void *)(uintptr_t)s};
    for (int k = 0; k < s->unknowns; k++) {
        const double at = s->evaluation[s->best].at[k];
        fit.unknown[k] = (kn_fit_unknown){.name = s->name[k],
                                          .value = exp(at),
                                          .low = fmax(s->low[k], exp(at - trust)),
                                          .high = fmin(s->high[k], exp(at + trust))};
    }
    return fit;
}

// ---- the search for the minimum

// Increase one unknown from the best place and evaluate the model there. If the upper bound is near, decrease the
// unknown instead.
static bool evaluate_beside(kn_trust_region *s, int unknown)
{
    double there[KN_TRUST_UNKNOWNS];
    memcpy(there, s->evaluation[s->best].at, sizeof there);
    there[unknown] += there[unknown] + secant > log(s->high[unknown]) ? -secant : secant;
    return evaluate(s, there) >= 0;
}

// Evaluate the model beside the best place until there are neighbours in all directions within the distance `reach`.
// With two unknowns, the line to the nearest neighbour runs mostly along one of them. If the neighbour is within
// `reach`, vary the other unknown; if the neighbour is farther, vary the unknown of the line. Return false if no
// further evaluation is possible.
static bool evaluate_around(kn_trust_region *s, double reach)
{
    int number[KN_TRUST_UNKNOWNS];
    for (int tries = 0; tries < s->unknowns && neighbours(s, number) > reach; tries++) {
        int unknown = 0;
        if (s->unknowns > 1) {
            const double *here = s->evaluation[s->best].at, *there = s->evaluation[number[0]].at;
            const bool along = fabs(there[0] - here[0]) > fabs(there[1] - here[1]);
            unknown = distance(s, here, there) > reach ? !along : along;
        }
        if (!evaluate_beside(s, unknown)) return false;
    }
    return true;
}

// Take one step and adapt the trust region. Return false if no further decrease is expected or all evaluations are used
// up.
static bool step(kn_trust_region *s, double *trust)
{
    int number[KN_TRUST_UNKNOWNS];
    // Find neighbours of the best evaluation in all directions, at any distance. Do so twice, since a neighbour may
    // become the best evaluation.
    for (int i = 0; i < 2; i++) {
        if (!evaluate_around(s, far)) return false;
        choose_best(s);
    }
    const double reach = neighbours(s, number);
    if (!isfinite(reach)) return false;
    find_slopes(s, number);
    kn_fit fit = fit_of(s, *trust);
    if (!kn_fit_run(&fit)) return false;
    double to[KN_TRUST_UNKNOWNS], way = 0;
    const double before = s->evaluation[s->best].sum;
    for (int k = 0; k < s->unknowns; k++) {
        to[k] = log(fit.unknown[k].value);
        way = fmax(way, fabs(to[k] - s->evaluation[s->best].at[k]));
    }
    // The search ends if the next step is shorter than `settled`, or if the step is shorter than `secant` and its
    // predicted decrease of the sum is too small. However, if the secants are too long to be trusted, evaluate new
    // neighbours and continue the search.
    const double least = before > far_off * s->readings ? promise_far : promise;
    if (way < settled || (way < secant && before - fit.sum < least * before)) {
        const int before_count = s->evaluations;
        s->settled = reach <= short_secant;
        s->early = way >= settled && before - fit.sum >= promise * before;
        if (s->settled || !evaluate_around(s, short_secant)) return false;
        choose_best(s);
        return s->evaluations > before_count;
    }
    const int next = evaluate(s, to);
    if (next < 0) return false;
    // The trust region grows if the actual decrease is more than 3/4 of the predicted one, and shrinks if the actual
    // decrease is less than 1/4 of it.
    const double kept = (before - s->evaluation[next].sum) / fmax(before - fit.sum, 1e-300);
    if (!(kept > 0.25)) *trust = 0.4 * way;
    else if (kept > 0.75) *trust = fmin(2 * fmax(*trust, way), most_trust);
    choose_best(s);
    return *trust > settled;
}

bool kn_trust_region_run(kn_trust_region *s)
{
    double trust = first_trust;
    for (int k = 0; k < s->unknowns; k++)
        if (!(s->slope[k] = calloc((size_t)s->readings + 1, sizeof *s->slope[k]))) return false;
    for (int i = 0; i < s->starts; i++) {
        double at[KN_TRUST_UNKNOWNS] = {0};
        for (int k = 0; k < s->unknowns; k++) at[k] = log(s->start[i][k]);
        if (evaluate(s, at) < 0) return false;
        if (s->unknowns == 0) break;
    }
    choose_best(s);
    if (!isfinite(s->evaluation[s->best].sum)) return false;
    s->settled = s->unknowns == 0;
    if (s->unknowns > 0 && evaluate_around(s, short_secant)) {
        choose_best(s);
        while (step(s, &trust)) continue;
    }
    for (int k = 0; k < s->unknowns; k++) s->value[k] = value_at(s, k, s->evaluation[s->best].at[k]);
    int number[KN_TRUST_UNKNOWNS];
    if (s->unknowns > 0 && isfinite(neighbours(s, number))) find_slopes(s, number);
    return true;
}

kn_fit_interval kn_trust_region_interval(const kn_trust_region *s, int unknown, double independent)
{
    kn_fit fit = fit_of(s, INFINITY);
    kn_fit_interval i = {KN_FIT_CURVATURE, s->low[unknown], s->high[unknown], true, true};
    if (!kn_fit_run(&fit)) return i;
    // The scale widens the interval if the residuals scatter more than their sigmas. The sigmas are known, so a scale
    // below 1 is not used. If the residuals scatter less than their sigmas, this is chance, or the data were simulated
    // with the same lattice.
    const double scale = fmax(fit.scale, 1);
    const double spread = scale * sqrt(fit.covariance[unknown][unknown] * s->readings / fmax(independent, 1));
    const double half = kn_fit_student(0.95, fmax(independent - s->unknowns, 1)) * spread;
    const double value = s->value[unknown];
    if (!isfinite(half)) return i;
    i.open_low = value * exp(-half) <= s->low[unknown];
    i.open_high = value * exp(half) >= s->high[unknown];
    if (!i.open_low) i.low = value * exp(-half);
    if (!i.open_high) i.high = value * exp(half);
    return i;
}
