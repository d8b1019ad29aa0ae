#include "clients/identify/creep_fit.h"
#include "clients/identify/element_response.h"
#include "clients/identify/onset.h"
#include "core/order.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// The unknowns of the fit are six parameters, followed by two unknowns for each curve: how much later than the file
// says the load was applied (late_s), and how much longer than the file says the last load lasted (held_s). Both
// together are called the lateness of the curve.
// LATE: index of the first unknown of the first curve; ROW: largest number of neighbouring outliers that are left out
enum { LATE = KN_ESTIMATE_NUMBERS, ROW = 3 };
_Static_assert(LATE + 2 * KN_CURVES_MAX <= KN_FIT_UNKNOWNS, "every curve's load may be late");
_Static_assert(KN_CURVE_STEPS <= KN_VOIGT_CHAIN_STEPS, "a curve's loads are a chain's");

// limit of Huber's loss, in standard deviations of the noise; the influence of a reading on the robust fit does not
// grow beyond this limit
static const double huber = 3;
// limit from which a reading is an outlier, in standard deviations estimated from the curve's median deviation
static const double outlying = 5;
static const double one_stress = 0.97; // ratio of least to largest stress above which the damper is taken as constant

typedef struct joint_work {
    int curves;
    const kn_curve *curve;
    bool robust, late;
    double *strain; // scratch: fitted strain of one curve
    bool *left_out; // [readings of all curves, in order] whether the reading is left out as an outlier
    int most;       // number of readings of the longest curve
} joint_work;

// ---- the curves

typedef struct lateness {
    double late_s, held_s;
} lateness;

// Return the fitted time of a load step, shifted by late_s. The final removal of the load is also shifted by held_s.
static double came(const kn_curve *c, int step, lateness l)
{
    const bool release = step > 0 && step + 1 == c->steps && c->step[step].stress_pa == 0;
    return c->step[step].time_s + l.late_s + (release ? l.held_s : 0);
}

double kn_creep_load(const kn_curve *c, double time_s)
{
    double load = 0;
    for (int i = 0; i < c->steps && c->step[i].time_s < time_s; i++) load = c->step[i].stress_pa;
    return load;
}

double kn_creep_release(const kn_curve *c)
{
    return c->steps > 0 && c->step[c->steps - 1].stress_pa == 0 ? c->step[c->steps - 1].time_s : (double)INFINITY;
}

void kn_creep_stress(const kn_curve *c, double *stress_pa)
{
    for (int i = 0; i < c->count; i++)
        stress_pa[i] = kn_creep_load(c, c->time_s[i]) * (c->constant_area ? 1 : 1 - c->value[i]);
}

static kn_voigt_chain chain_of(const kn_material *m)
{
    return (kn_voigt_chain){.voigts = 1,
                            .k_pa = {m->k1_pa},
                            .c_pa_s = {m->c1_pa_s},
                            .alpha_pa_s = m->alpha_pa_s,
                            .beta_per_pa = m->beta_per_pa,
                            .p0_pa = m->p0_pa,
                            .p1_pa = m->p1_pa};
}

// Compute a material's strain under the curve's loads, shifted by the lateness.
static bool predict(const kn_material *material, const kn_curve *c, lateness l, double *strain)
{
    kn_voigt_chain chain = chain_of(material);
    kn_voigt_chain_step step[KN_CURVE_STEPS];
    for (int i = 0; i < c->steps; i++) step[i] = (kn_voigt_chain_step){came(c, i, l), c->step[i].stress_pa};
    return kn_voigt_chain_creep(&chain, c->constant_area, c->steps, step, c->count, c->time_s, strain);
}

bool kn_creep_fit_predict(const kn_material *material, const kn_curve *c, double *strain)
{
    return predict(material, c, (lateness){0, 0}, strain);
}

// Shift the times of one curve by its fitted lateness, and drop the readings before the first load.
static void settle(kn_curve *c, lateness l)
{
    int early = 0;
    for (int i = 0; i < c->steps; i++) {
        const double moved_s = came(c, i, l) - l.late_s - c->step[i].time_s;
        c->step[i].time_s += moved_s;
        c->step[i].early_s += moved_s;
        c->step[i].late_s += moved_s;
    }
    for (int i = 0; i < c->count; i++) early += (c->time_s[i] -= l.late_s) < 0;
    if (early == c->count) return;
    c->count -= early;
    memmove(c->time_s, c->time_s + early, (size_t)c->count * sizeof *c->time_s);
    memmove(c->value, c->value + early, (size_t)c->count * sizeof *c->value);
    memmove(c->weight, c->weight + early, (size_t)c->count * sizeof *c->weight);
    memmove(c->line, c->line + early, (size_t)c->count * sizeof *c->line);
}

void kn_creep_fit_settle(const kn_creep_fit *j, int curves, kn_curve *curve)
{
    for (int k = 0; k < curves; k++) settle(&curve[k], (lateness){j->late_s[k], j->held_s[k]});
}

// ---- residuals

static kn_material material_of(const double *v)
{
    return (kn_material){.k1_pa = v[KN_ESTIMATE_K1],
                         .c1_pa_s = v[KN_ESTIMATE_C1],
                         .damper = KN_DAMPER_EXPONENTIAL,
                         .alpha_pa_s = v[KN_ESTIMATE_ALPHA],
                         .beta_per_pa = v[KN_ESTIMATE_BETA],
                         .p0_pa = v[KN_ESTIMATE_P0],
                         .p1_pa = v[KN_ESTIMATE_P1]};
}

// Return a residual whose square is Huber's loss: beyond `huber` the square grows like |r|.
static double tame(double r) { return fabs(r) <= huber ? r : copysign(sqrt(2 * huber * fabs(r) - huber * huber), r); }

static lateness lateness_of(const joint_work *w, const double *v, int k)
{
    return w->late ? (lateness){v[LATE + 2 * k], v[LATE + 2 * k + 1]} : (lateness){0, 0};
}

// Compute the residuals of all curves in units of their noise. Readings that were left out have none.
static bool misfit(void *of, const double *value, double *residual)
{
    joint_work *w = of;
    kn_material m = material_of(value);
    const bool *left_out = w->left_out;
    int n = 0;
    for (int k = 0; k < w->curves; left_out += w->curve[k++].count) {
        const kn_curve *c = &w->curve[k];
        if (!predict(&m, c, lateness_of(w, value, k), w->strain)) return false;
        for (int i = 0; i < c->count; i++) {
            if (left_out[i]) continue;
            double r = (w->strain[i] - c->value[i]) * sqrt(c->weight[i]) / c->noise;
            residual[n++] = w->robust ? tame(r) : r;
        }
    }
    return true;
}

// ---- the measured range

// Return the median strain of the last readings up to a time, so that one outlier does not matter. Before the first
// reading return 0.
static double strain_at(const kn_curve *c, double until_s)
{
    enum { LAST = 5 };
    double last[LAST];
    int n = 0, end = 0;
    while (end < c->count && c->time_s[end] <= until_s) end++;
    for (int i = end - 1; i >= 0 && n < LAST; i--) last[n++] = c->value[i];
    qsort(last, (size_t)n, sizeof *last, kn_ascending);
    return n ? last[n / 2] : 0;
}

// Return the time at which a load step ends: the begin of the next step, or the time of the last reading.
static double step_end(const kn_curve *c, int step)
{
    return step + 1 < c->steps ? c->step[step + 1].time_s : c->time_s[c->count - 1];
}

// Extend the range of stresses by one curve's loads. The stresses follow from the strains at the begin and the end of
// each load.
static void visit(kn_creep_fit *j, const kn_curve *c, const double end_strain[KN_CURVE_STEPS])
{
    for (int i = 0; i < c->steps; i++) {
        const double load = c->step[i].stress_pa, begun = i ? end_strain[i - 1] : 0;
        if (load == 0) continue;
        const double first = load * (c->constant_area ? 1 : 1 - begun);
        const double last = load * (c->constant_area ? 1 : 1 - end_strain[i]);
        j->lowest_pa = fmin(j->lowest_pa, fmin(first, last));
        j->highest_pa = fmax(j->highest_pa, fmax(first, last));
    }
}

static void visit_all(kn_creep_fit *j, int curves, const double (*end_strain)[KN_CURVE_STEPS], const kn_curve *curve)
{
    j->lowest_pa = INFINITY;
    j->highest_pa = 0;
    for (int k = 0; k < curves; k++) visit(j, &curve[k], end_strain[k]);
    // A wrong strain, near or above 1, at the end of a load must not make the least stress 0.
    j->lowest_pa = fmin(fmax(j->lowest_pa, 1e-3 * j->highest_pa), j->highest_pa);
}

// Estimate the range of stresses under load from the measured strains. The estimate is accurate enough to begin a
// search.
static void visited(kn_creep_fit *j, int curves, const kn_curve *curve)
{
    double end_strain[KN_CURVES_MAX][KN_CURVE_STEPS];
    for (int k = 0; k < curves; k++)
        for (int i = 0; i < curve[k].steps; i++) end_strain[k][i] = strain_at(&curve[k], step_end(&curve[k], i));
    visit_all(j, curves, end_strain, curve);
}

static double largest_strain(int curves, const kn_curve *curve)
{
    double most = 0;
    for (int k = 0; k < curves; k++)
        for (int i = 0; i < curve[k].count; i++) most = fmax(most, curve[k].value[i]);
    return most;
}

static double longest(int curves, const kn_curve *curve)
{
    double most = 0;
    for (int k = 0; k < curves; k++) most = fmax(most, curve[k].time_s[curve[k].count - 1]);
    return most;
}

// Return whether all stresses are nearly equal. The data then do not determine beta, P0 and P1.
static bool constant(const kn_creep_fit *j) { return j->lowest_pa > one_stress * j->highest_pa; }

// Set the bounds of all unknowns, decades around the size of the measured values.
static void bound(kn_fit *fit, const kn_creep_fit *j, int curves, const kn_curve *curve)
{
    static const char *const name[] = {"k1", "c1", "alpha", "beta", "P0", "P1"};
    double stiff = j->highest_pa / largest_strain(curves, curve), viscous = stiff * longest(curves, curve);
    double top = j->highest_pa;
    const double low[] = {1e-5 * stiff, 1e-8 * viscous, 1e-7 * viscous, 1e-3 / top, 0.1 * j->lowest_pa, j->lowest_pa};
    const double high[] = {1e6 * stiff, 1e4 * viscous, 1e15 * viscous, 100 / top, top, 3 * top};
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++)
        fit->unknown[i] = (kn_fit_unknown){.name = name[i], .low = low[i], .high = high[i]};
    // well below the least stress, so that P0 has no effect on the readings
    fit->unknown[KN_ESTIMATE_P0].value = 0.5 * j->lowest_pa;
    fit->unknown[KN_ESTIMATE_P1].value = top;
    fit->unknown[KN_ESTIMATE_P0].fixed = fit->unknown[KN_ESTIMATE_P1].fixed = true;
    fit->unknowns = KN_ESTIMATE_NUMBERS;
    if (!constant(j)) return;
    fit->unknown[KN_ESTIMATE_ALPHA].name = "c2";
    fit->unknown[KN_ESTIMATE_BETA].low = fit->unknown[KN_ESTIMATE_BETA].value = 0;
    fit->unknown[KN_ESTIMATE_BETA].fixed = true;
}

// ---- the search

static void values(const kn_fit *fit, double out[KN_FIT_UNKNOWNS])
{
    for (int i = 0; i < fit->unknowns; i++) out[i] = fit->unknown[i].value;
}

// Compute starts for k1, c1, alpha and beta. One comes from the two stages of the curve with the largest load that was
// released, the others from the size of the values. P0 and P1 are outside the measured stresses, where they have no
// effect.
static int guesses(const kn_fit *fit, const kn_creep_fit *j, int curves, const kn_curve *curve,
                   double start[4][KN_FIT_UNKNOWNS])
{
    double top = j->highest_pa, stiff = top / largest_strain(curves, curve), seconds = longest(curves, curve);
    const kn_curve *best = NULL;
    int count = 0;
    for (int k = 0; k < curves; k++)
        if (isfinite(kn_creep_release(&curve[k])) && (!best || curve[k].step[0].stress_pa > best->step[0].stress_pa))
            best = &curve[k];
    kn_two_stage s;
    if (best && kn_two_stage_fit(&s, best)) {
        values(fit, start[count]);
        const kn_material *m = &s.material;
        memcpy(start[count++], (double[]){m->k1_pa, m->c1_pa_s, m->alpha_pa_s, m->beta_per_pa}, 4 * sizeof(double));
        kn_two_stage_free(&s);
    }
    for (int k = 0; k < 3; k++) {
        double k1 = 3 * stiff, beta = (double[]){1, 4, 8}[k] / top;
        values(fit, start[count]);
        memcpy(start[count++], (double[]){k1, k1 * seconds / 20, stiff * seconds * exp(beta * top / 2), beta},
               4 * sizeof(double));
    }
    for (int k = 0; k < count && constant(j); k++) {
        start[k][KN_ESTIMATE_ALPHA] = stiff * seconds * (double[]){1, 1, 10, 100}[k];
        start[k][KN_ESTIMATE_BETA] = 0;
    }
    return count;
}

// Sort the two best starts to the front. Return how many of them there are.
static int best_two(kn_fit *fit, int starts, double start[4][KN_FIT_UNKNOWNS])
{
    double sum[4];
    for (int k = 0; k < starts; k++) sum[k] = kn_fit_sum(fit, start[k]);
    for (int k = 0; k < 2 && k < starts; k++)
        for (int i = k + 1; i < starts; i++) {
            if (!(sum[i] < sum[k]) && !(isnan(sum[k]) && !isnan(sum[i]))) continue;
            double better[KN_FIT_UNKNOWNS], lower = sum[i];
            memcpy(better, start[i], sizeof better);
            memcpy(start[i], start[k], sizeof better);
            memcpy(start[k], better, sizeof better);
            sum[i] = sum[k];
            sum[k] = lower;
        }
    return starts < 2 ? starts : 2;
}

// Compute the range of stresses in the fitted element. The last reading before a release is not the end of the load,
// and readings have noise and outliers. P0, which the search kept below all stresses, is then raised to the least
// stress. This changes no fitted value at the readings.
static bool visited_by_fit(kn_creep_fit *j, joint_work *w, kn_fit *fit)
{
    double end_strain[KN_CURVES_MAX][KN_CURVE_STEPS], end_s[KN_CURVE_STEPS], value[KN_FIT_UNKNOWNS];
    values(fit, value);
    const kn_material m = material_of(value);
    for (int k = 0; k < w->curves; k++) {
        const lateness l = lateness_of(w, value, k);
        kn_curve ends = w->curve[k];
        // The ends of the loads serve as readings, at their fitted times.
        for (int i = 0; i < ends.steps; i++)
            end_s[i] = i + 1 < ends.steps ? came(&ends, i + 1, l) : fmax(step_end(&ends, i), i ? end_s[i - 1] : 0);
        ends.time_s = end_s;
        ends.count = ends.steps;
        if (!predict(&m, &ends, l, end_strain[k])) return false;
    }
    visit_all(j, w->curves, end_strain, w->curve);
    kn_fit_unknown *p0 = &fit->unknown[KN_ESTIMATE_P0];
    p0->low = 0.1 * j->lowest_pa;
    p0->value = j->lowest_pa;
    fit->unknown[KN_ESTIMATE_P1].low = fmin(j->lowest_pa, fit->unknown[KN_ESTIMATE_P1].value);
    return true;
}

// Make P1 an unknown. Start from several shares of the largest stress and keep the best fit.
static bool seek_p1(kn_fit *fit, const kn_creep_fit *j)
{
    static const double share[] = {0.6, 0.8, 0.93};
    double start[4][KN_FIT_UNKNOWNS];
    int count = 0;
    for (int k = 0; k < 3; k++) {
        values(fit, start[count]);
        start[count][KN_ESTIMATE_P1] = share[k] * j->highest_pa;
        if (start[count][KN_ESTIMATE_P1] > 1.02 * j->lowest_pa) count++;
    }
    values(fit, start[count]); // a further start: P1 beyond the largest stress, where P1 has no effect
    start[count++][KN_ESTIMATE_P1] = 1.1 * j->highest_pa;
    fit->unknown[KN_ESTIMATE_P1].fixed = false;
    return kn_fit_run_from(fit, count, start);
}

// Make P0 an unknown. Start above the least stress. Keep P0 as an unknown only if chance does not explain the gain.
static bool seek_p0(kn_fit *fit, const kn_creep_fit *j, double confidence)
{
    kn_fit other = *fit;
    double start[3][KN_FIT_UNKNOWNS], t = kn_fit_student(confidence, fit->freedom);
    int count = 0;
    for (int k = 0; k < 2; k++) {
        values(fit, start[count]);
        start[count][KN_ESTIMATE_P0] = j->lowest_pa * (double[]){1.3, 2.5}[k];
        if (start[count][KN_ESTIMATE_P0] < 0.9 * fit->unknown[KN_ESTIMATE_P1].value) count++;
    }
    other.unknown[KN_ESTIMATE_P0].fixed = false;
    if (count == 0 || !kn_fit_run_from(&other, count, start)) return true;
    bool seen = fit->sum - other.sum > t * t * other.scale * other.scale;
    seen = seen && other.unknown[KN_ESTIMATE_P0].value > 1.001 * j->lowest_pa;
    long spent = other.evaluations;
    if (seen) *fit = other;
    fit->evaluations = spent;
    return true;
}

// ---- outliers

// Compute the deviations of one curve's readings from the fit, scaled by their median so that 1 is the standard
// deviation of normal noise.
static bool deviations(const joint_work *w, const kn_fit *fit, int k, double *out)
{
    const kn_curve *c = &w->curve[k];
    double value[KN_FIT_UNKNOWNS], *size = malloc((size_t)c->count * sizeof *size);
    values(fit, value);
    kn_material m = material_of(value);
    bool ok = size && predict(&m, c, lateness_of(w, value, k), w->strain);
    for (int i = 0; ok && i < c->count; i++) {
        out[i] = (w->strain[i] - c->value[i]) * sqrt(c->weight[i]);
        size[i] = fabs(out[i]);
    }
    if (ok) qsort(size, (size_t)c->count, sizeof *size, kn_ascending);
    double usual = ok ? fmax(1.4826 * size[c->count / 2], c->noise) : 1;
    for (int i = 0; ok && i < c->count; i++) out[i] /= usual;
    free(size);
    return ok;
}

// Return the length of the series of neighbouring readings around the reading `at` that deviate by more than half of
// the limit for outliers. The reading `at` is included.
static int beside(const double *d, int n, int at)
{
    int from = at, to = at;
    while (from > 0 && fabs(d[from - 1]) > outlying / 2) from--;
    while (to + 1 < n && fabs(d[to + 1]) > outlying / 2) to++;
    return to - from + 1;
}

// Leave out the outliers of all curves, except outliers in a series of more than ROW neighbouring ones.
static int leave_out(kn_creep_fit *j, const joint_work *w, const kn_fit *fit)
{
    int count = 0;
    double *d = malloc((size_t)w->most * sizeof *d);
    bool *left_out = w->left_out;
    for (int k = 0; d && k < w->curves; left_out += w->curve[k++].count) {
        int n = w->curve[k].count;
        if (!deviations(w, fit, k, d)) continue;
        for (int i = 0; i < n && j->outliers < KN_CREEP_OUTLIERS; i++) {
            if (fabs(d[i]) <= outlying || beside(d, n, i) > ROW) continue;
            left_out[i] = true;
            j->outlier[j->outliers++] = (kn_creep_outlier){k, i, w->curve[k].line[i], fabs(d[i])};
            count++;
        }
    }
    free(d);
    return count;
}

// ---- results

// Compute the interval of one parameter.
static void interval(kn_creep_fit *j, kn_fit *fit, int i, const kn_creep_fit_options *opt)
{
    static const char *const unit[] = {"Pa", "Pa*s", "Pa*s", "1/Pa", "Pa", "Pa"};
    const kn_fit_unknown *u = &fit->unknown[i];
    kn_fit_interval known = {.low = u->low, .high = u->high, .open_low = true, .open_high = true};
    if (constant(j) && i >= KN_ESTIMATE_BETA) {   // a constant damper has no beta, P0 or P1
    } else if (i == KN_ESTIMATE_P0 && u->fixed) { // the interval states how high P0 could be
        kn_fit free_of = *fit;
        free_of.unknown[i].fixed = false;
        free_of.unknown[i].low = 0.999 * j->lowest_pa; // every P0 below the least stress fits equally well
        if (!opt->no_intervals) known = kn_fit_interval_by(&free_of, i, opt->confidence, KN_FIT_PROFILE);
        fit->evaluations = free_of.evaluations;
        known.open_low = true;
    } else if (!opt->no_intervals) {
        // the likelihood of P0 and P1 has a kink at the end of the measured stresses, so use the profile
        bool bent = i >= KN_ESTIMATE_P0;
        known = bent ? kn_fit_interval_by(fit, i, opt->confidence, KN_FIT_PROFILE)
                     : kn_fit_interval_of(fit, i, opt->confidence);
    }
    // Every P1 beyond the largest stress fits equally well, so the interval ends at the largest stress.
    if (i == KN_ESTIMATE_P1 && !known.open_high) known.high = fmin(known.high, fmax(j->highest_pa, u->value));
    kn_parameter_estimate_set(&j->number[i], u->name, unit[i], u->value, known);
}

// Set the words of each parameter that is not known: the reason, or the value used instead.
static void say(kn_creep_fit *j)
{
    if (constant(j)) {
        snprintf(j->number[KN_ESTIMATE_BETA].words, sizeof j->number[0].words,
                 "only one stress: these curves do not show how the damper depends on it; it is taken as constant");
        return;
    }
    kn_parameter_estimate *p0 = &j->number[KN_ESTIMATE_P0], *p1 = &j->number[KN_ESTIMATE_P1];
    if (p0->known != KN_KNOWN)
        snprintf(p0->words, sizeof p0->words,
                 "no load was below %.4g Pa; this value is used and not extrapolated; measure a smaller load",
                 j->lowest_pa);
    if (p1->known != KN_KNOWN)
        snprintf(p1->words, sizeof p1->words,
                 "the largest stress, %.4g Pa, did not last; measure a larger load, sampled faster at its start",
                 j->highest_pa);
    for (int i = KN_ESTIMATE_K1; i <= KN_ESTIMATE_BETA; i++) {
        kn_parameter_estimate *n = &j->number[i];
        if (n->known == KN_AT_MOST) snprintf(n->words, sizeof n->words, "these curves cannot tell it from 0");
        else if (n->known == KN_AT_LEAST)
            snprintf(n->words, sizeof n->words, "these curves cannot tell it from infinity");
        else if (n->known == KN_UNKNOWN)
            snprintf(n->words, sizeof n->words, "these curves do not determine it on its own");
    }
}

// Derive material, intervals, residuals and runs from the finished fit.
static bool conclude(kn_creep_fit *j, joint_work *w, kn_fit *fit, const kn_creep_fit_options *opt)
{
    double(*c)[KN_FIT_UNKNOWNS] = fit->covariance, value[KN_FIT_UNKNOWNS];
    const int a = KN_ESTIMATE_ALPHA, b = KN_ESTIMATE_BETA;
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) interval(j, fit, i, opt);
    values(fit, value);
    j->material = material_of(value);
    j->material.p1_pa = fmax(j->material.p1_pa, 1.0001 * j->material.p0_pa);
    if (constant(j)) {
        j->material.damper = KN_DAMPER_CONSTANT;
        j->material.c2_pa_s = j->material.alpha_pa_s;
    }
    j->sum = fit->sum;
    j->scale = fit->scale;
    j->readings = fit->readings;
    j->unknowns = fit->readings - fit->freedom;
    j->evaluations = fit->evaluations;
    // Correlation of alpha and beta from the covariance.
    j->alpha_beta = c[a][a] > 0 && c[b][b] > 0 ? c[a][b] / sqrt(c[a][a] * c[b][b]) : 0;
    say(j);
    const bool *left_out = w->left_out;
    for (int k = 0; k < w->curves; left_out += w->curve[k++].count) {
        const kn_curve *curve = &w->curve[k];
        const lateness l = lateness_of(w, value, k);
        j->late_s[k] = l.late_s;
        j->held_s[k] = l.held_s;
        if (!predict(&j->material, curve, l, w->strain)) return false;
        double sum = 0;
        int n = 0;
        for (int i = 0; i < curve->count; i++) {
            if (left_out[i]) continue;
            // Collect the residuals without the outliers, for rms and runs.
            w->strain[n] = w->strain[i] - curve->value[i];
            sum += curve->weight[i] * w->strain[n] * w->strain[n];
            n++;
        }
        j->rms[k] = sqrt(sum / n);
        j->runs[k] = kn_fit_runs(n, w->strain);
    }
    return true;
}

// Estimate the lateness for the start: where the strain begins, if that is later than the load is said to have come.
// The release was either late by the same time or at the noted time. The start is the case that is nearer to the time
// of the largest strain.
static lateness late_at_first(const kn_curve *c)
{
    double least_s;
    const double at_s = kn_onset(c->count, c->time_s, c->value, c->noise, &least_s);
    if (!(least_s > 0)) return (lateness){0, 0};
    const double release_s = kn_creep_release(c);
    int peak = 0;
    for (int i = 0; i < c->count; i++)
        if (c->value[i] > c->value[peak]) peak = i;
    const bool as_noted = fabs(c->time_s[peak] - release_s) < fabs(c->time_s[peak] - release_s - at_s);
    return (lateness){at_s, as_noted ? -at_s : 0};
}

// Add the lateness of each curve to the unknowns, but keep it fixed for now.
static void begin_late(joint_work *w, kn_fit *fit)
{
    w->late = true;
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        const lateness l = late_at_first(c);
        const double long_s = c->time_s[c->count - 1];
        const double load_s = isfinite(kn_creep_release(c)) ? kn_creep_release(c) - c->step[c->steps - 2].time_s : 0;
        kn_fit_unknown *u = &fit->unknown[LATE + 2 * k];
        u[0] = (kn_fit_unknown){.name = "late", .low = -long_s, .high = long_s, .linear = true, .fixed = true};
        u[1] = (kn_fit_unknown){.name = "held", .low = -0.9 * load_s, .high = load_s, .linear = true, .fixed = true};
        // Start from the estimate, within the bounds.
        u[0].value = fmin(l.late_s, u[0].high);
        u[1].value = fmax(l.held_s, u[1].low);
    }
    fit->unknowns = LATE + 2 * w->curves;
}

// Make the lateness of all curves unknown and fit once more. A load that was never removed has no duration to fit.
static bool seek_late(joint_work *w, kn_fit *fit)
{
    int held = 0;
    for (int k = 0; k < w->curves; k++) {
        fit->unknown[LATE + 2 * k].fixed = false;
        fit->unknown[LATE + 2 * k + 1].fixed = !isfinite(kn_creep_release(&w->curve[k]));
    }
    for (int i = 0; i < fit->unknowns; i++) held += fit->unknown[i].fixed;
    return fit->readings > fit->unknowns - held && kn_fit_run(fit);
}

// Search in stages: a robust fit from the best starts, then P1. Leave out the outliers, fit with plain squares, then
// try P0 and the lateness.
static bool search(kn_creep_fit *j, joint_work *w, kn_fit *fit, const kn_creep_fit_options *opt)
{
    double start[4][KN_FIT_UNKNOWNS];
    if (opt->late) begin_late(w, fit);
    int starts = guesses(fit, j, w->curves, w->curve, start);
    w->robust = true;
    if (!kn_fit_run_from(fit, best_two(fit, starts, start), start)) return false;
    if (!constant(j) && !seek_p1(fit, j)) return false;
    w->robust = false;
    fit->readings -= leave_out(j, w, fit);
    if (fit->readings <= KN_ESTIMATE_NUMBERS || !kn_fit_run(fit) || !visited_by_fit(j, w, fit)) return false;
    if (!constant(j) && !seek_p0(fit, j, opt->confidence)) return false;
    return !opt->late || seek_late(w, fit);
}

bool kn_creep_fit_run(kn_creep_fit *joint, int curves, const kn_curve *curve, const kn_creep_fit_options *opt)
{
    *joint = (kn_creep_fit){.outliers = 0};
    joint_work w = {.curves = curves, .curve = curve};
    kn_fit fit = {.misfit = misfit, .of = &w};
    for (int k = 0; k < curves; k++) {
        fit.readings += curve[k].count;
        w.most = curve[k].count > w.most ? curve[k].count : w.most;
    }
    w.strain = calloc((size_t)w.most + 1, sizeof *w.strain);
    w.left_out = calloc((size_t)fit.readings + 1, sizeof *w.left_out);
    visited(joint, curves, curve);
    bound(&fit, joint, curves, curve);
    bool ok = w.strain && w.left_out && fit.readings > KN_ESTIMATE_NUMBERS;
    ok = ok && search(joint, &w, &fit, opt) && conclude(joint, &w, &fit, opt);
    free(w.strain);
    free(w.left_out);
    return ok;
}
