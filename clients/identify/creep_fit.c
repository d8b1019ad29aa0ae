#include "clients/identify/creep_fit.h"
#include "clients/identify/measured_curve_parts.h"
#include "core/algebra/algebra.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// The unknowns of the fit are six parameters, followed by two unknowns for each curve: how much later than the file
// says the load was applied (late_s), and how much longer than the file says the last load lasted (held_s). Both
// together are called the lateness of the curve.
// LATE: index of the first unknown of the first curve; ROW: largest number of neighbouring outliers that are left out
enum { LATE = KN_ESTIMATE_NUMBERS, ROW = 3, STARTS = 4 };
_Static_assert(LATE + 2 * KN_CURVES_MAX <= KN_FIT_UNKNOWNS, "a fit must have room for the lateness of every curve");
_Static_assert(KN_CURVE_STEPS <= KN_VOIGT_CHAIN_STEPS, "a chain must have room for all load steps of a curve");

// limit of Huber's loss, in standard deviations of the noise; in the robust fit, a residual beyond this limit has no
// more influence than a residual at the limit
static const double huber = 3;
// a reading farther than this from the fit is an outlier; unit: standard deviations, estimated from the median
// deviation of the curve's readings
static const double outlying = 5;
// if the least stress is above this share of the largest stress, the damper is taken as constant
static const double one_stress = 0.97;

typedef struct work {
    kn_creep_fit *joint;
    kn_creep_fit_options options;
    int curves;
    const kn_curve *curve;
    kn_fit fit;
    bool robust, late;
    double *strain; // scratch: fitted strain of one curve
    bool *left_out; // [readings of all curves, curve after curve] true: the reading is left out as an outlier
    int most;       // number of readings of the longest curve
} work;

// ---- curves and their loads

typedef struct lateness {
    double late_s, held_s;
} lateness;

// Return the fitted time of a load step: its noted time plus late_s. If the step is the final removal of the load,
// held_s is added, too.
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

// Compute the strain of a Voigt chain at `count` times under the curve's loads, after the lateness `l` has shifted
// these loads.
static bool strain_of(const kn_voigt_chain *chain, const kn_curve *c, lateness l, int count, const double *time_s,
                      double *strain)
{
    kn_voigt_chain_step step[KN_CURVE_STEPS];
    for (int i = 0; i < c->steps; i++) step[i] = (kn_voigt_chain_step){came(c, i, l), c->step[i].stress_pa};
    return kn_voigt_chain_creep(chain, c->constant_area, c->steps, step, count, time_s, strain);
}

bool kn_creep_strain(const kn_voigt_chain *chain, const kn_curve *c, int count, const double *time_s, double *strain)
{
    return strain_of(chain, c, (lateness){0, 0}, count, time_s, strain);
}

// Compute the strain of a material at the readings of the curve, under the curve's loads shifted by the lateness `l`.
static bool predict(const kn_material *material, const kn_curve *c, lateness l, double *strain)
{
    const kn_voigt_chain chain = kn_voigt_chain_of(material);
    return strain_of(&chain, c, l, c->count, c->time_s, strain);
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

// ---- residuals of the fit

// Return a residual whose square is Huber's loss: r^2 up to the limit `huber`, and proportional to |r| far beyond this
// limit.
static double tame(double r) { return fabs(r) <= huber ? r : copysign(sqrt(2 * huber * fabs(r) - huber * huber), r); }

static lateness lateness_of(const work *w, const double *v, int k)
{
    return w->late ? (lateness){v[LATE + 2 * k], v[LATE + 2 * k + 1]} : (lateness){0, 0};
}

// Compute the residuals of all curves in units of the noise. A reading that was left out as an outlier has no residual.
static bool misfit(void *of, const double *value, double *residual)
{
    work *w = of;
    const kn_material m = kn_estimate_material(value);
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

// ---- the range of measured stresses

// Return the median strain of the last five readings at or before the time until_s, so that one outlier has no effect.
// Return 0 if there is no such reading.
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

// Return the time at which a load step ends: the start of the next step, or the time of the last reading.
static double step_end(const kn_curve *c, int step)
{
    return step + 1 < c->steps ? c->step[step + 1].time_s : c->time_s[c->count - 1];
}

// Set the range of stresses under load from the strains at the start and at the end of each load.
static void set_range(work *w, double end_strain[KN_CURVES_MAX][KN_CURVE_STEPS])
{
    double lowest = INFINITY, highest = 0;
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        for (int i = 0; i < c->steps; i++) {
            const double load = c->step[i].stress_pa, begun = i ? end_strain[k][i - 1] : 0;
            if (load == 0) continue;
            const double first = load * (c->constant_area ? 1 : 1 - begun);
            const double last = load * (c->constant_area ? 1 : 1 - end_strain[k][i]);
            lowest = fmin(lowest, fmin(first, last));
            highest = fmax(highest, fmax(first, last));
        }
    }
    // If the strain at the end of a load is wrong and near or above 1, the least stress must not become 0.
    w->joint->lowest_pa = fmin(fmax(lowest, 1e-3 * highest), highest);
    w->joint->highest_pa = highest;
}

// Estimate the range of stresses under load from the measured strains, accurately enough to begin a search.
static void measured_range(work *w)
{
    double end_strain[KN_CURVES_MAX][KN_CURVE_STEPS];
    for (int k = 0; k < w->curves; k++)
        for (int i = 0; i < w->curve[k].steps; i++)
            end_strain[k][i] = strain_at(&w->curve[k], step_end(&w->curve[k], i));
    set_range(w, end_strain);
}

// Return whether all stresses are nearly equal. The data then do not determine beta, P0 and P1.
static bool constant(const work *w) { return w->joint->lowest_pa > one_stress * w->joint->highest_pa; }

// Return the typical stiffness, largest stress over largest strain, and set the duration of the longest curve.
static double stiffness(const work *w, double *seconds)
{
    double most = 0;
    *seconds = 0;
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        for (int i = 0; i < c->count; i++) most = fmax(most, c->value[i]);
        *seconds = fmax(*seconds, c->time_s[c->count - 1]);
    }
    return w->joint->highest_pa / most;
}

// Set the bounds of all unknowns. For k1, c1, alpha and beta the bounds are powers of ten below and above the measured
// values; for P0 and P1 they are near the measured stresses.
static void bound(work *w)
{
    const double least = w->joint->lowest_pa, top = w->joint->highest_pa;
    double seconds, stiff = stiffness(w, &seconds), viscous = stiff * seconds;
    const double low[] = {1e-5 * stiff, 1e-8 * viscous, 1e-7 * viscous, 1e-3 / top, 0.1 * least, least};
    const double high[] = {1e6 * stiff, 1e4 * viscous, 1e15 * viscous, 100 / top, top, 3 * top};
    kn_fit_unknown *u = w->fit.unknown;
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++)
        u[i] = (kn_fit_unknown){.name = kn_estimate_name[i], .low = low[i], .high = high[i]};
    // P0 and P1 stay fixed at first, at values without effect on the strain: below the least stress and at the largest
    // stress
    u[KN_ESTIMATE_P0].value = 0.5 * least;
    u[KN_ESTIMATE_P1].value = top;
    u[KN_ESTIMATE_P0].fixed = u[KN_ESTIMATE_P1].fixed = true;
    w->fit.unknowns = KN_ESTIMATE_NUMBERS;
    if (!constant(w)) return;
    u[KN_ESTIMATE_ALPHA].name = "c2";
    u[KN_ESTIMATE_BETA].low = u[KN_ESTIMATE_BETA].value = 0;
    u[KN_ESTIMATE_BETA].fixed = true;
}

// ---- the search for the parameters

// Compute starts for k1, c1, alpha and beta. One start comes from the two-stage method, for the curve with the largest
// load that was removed. The other starts follow from the size of the measured values. In all of them P0 and P1 have
// values without effect on the strain.
static int guesses(const work *w, double start[STARTS][KN_FIT_UNKNOWNS])
{
    double top = w->joint->highest_pa, seconds, stiff = stiffness(w, &seconds);
    const kn_curve *best = NULL;
    int count = 0;
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        if (isfinite(kn_creep_release(c)) && (!best || c->step[0].stress_pa > best->step[0].stress_pa)) best = c;
    }
    kn_two_stage s;
    if (best && kn_two_stage_fit(&s, best)) {
        kn_fit_values(&w->fit, start[count]);
        const kn_material *m = &s.material;
        memcpy(start[count++], (double[]){m->k1_pa, m->c1_pa_s, m->alpha_pa_s, m->beta_per_pa}, 4 * sizeof(double));
        kn_two_stage_free(&s);
    }
    for (int k = 0; k < 3; k++) {
        double k1 = 3 * stiff, beta = (double[]){1, 4, 8}[k] / top;
        kn_fit_values(&w->fit, start[count]);
        memcpy(start[count++], (double[]){k1, k1 * seconds / 20, stiff * seconds * exp(beta * top / 2), beta},
               4 * sizeof(double));
    }
    for (int k = 0; k < count && constant(w); k++) {
        start[k][KN_ESTIMATE_ALPHA] = stiff * seconds * (double[]){1, 1, 10, 100}[k];
        start[k][KN_ESTIMATE_BETA] = 0;
    }
    return count;
}

// Copy the two starts with the least sums of squares, and return how many were copied.
static int best_two(const kn_fit *fit, int starts, double start[STARTS][KN_FIT_UNKNOWNS],
                    double best[2][KN_FIT_UNKNOWNS])
{
    double sum[STARTS];
    int order[STARTS], count = starts < 2 ? starts : 2;
    for (int k = 0; k < starts; k++) {
        sum[k] = kn_fit_sum(fit, start[k]);
        order[k] = k;
    }
    for (int k = 0; k < count; k++) {
        for (int i = k + 1; i < starts; i++) {
            const int before = order[k], other = order[i];
            if (!(sum[other] < sum[before]) && !(isnan(sum[before]) && !isnan(sum[other]))) continue;
            order[k] = other;
            order[i] = before;
        }
        memcpy(best[k], start[order[k]], sizeof best[k]);
    }
    return count;
}

// Compute the range of stresses under load from the fit, not from the readings: the last reading before a release is
// taken before the load ends, and readings have noise and outliers. Then raise P0, which the search kept below all
// stresses, to the least stress. This changes no fitted value at the readings.
static bool fitted_range(work *w)
{
    double end_strain[KN_CURVES_MAX][KN_CURVE_STEPS], end_s[KN_CURVE_STEPS], value[KN_FIT_UNKNOWNS];
    kn_fit_values(&w->fit, value);
    const kn_material m = kn_estimate_material(value);
    const kn_voigt_chain chain = kn_voigt_chain_of(&m);
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        const lateness l = lateness_of(w, value, k);
        // Compute the strain at the fitted end of each load.
        for (int i = 0; i < c->steps; i++)
            end_s[i] = i + 1 < c->steps ? came(c, i + 1, l) : fmax(step_end(c, i), i ? end_s[i - 1] : 0);
        if (!strain_of(&chain, c, l, c->steps, end_s, end_strain[k])) return false;
    }
    set_range(w, end_strain);
    kn_fit_unknown *p0 = &w->fit.unknown[KN_ESTIMATE_P0], *p1 = &w->fit.unknown[KN_ESTIMATE_P1];
    p0->low = 0.1 * w->joint->lowest_pa;
    p0->value = w->joint->lowest_pa;
    p1->low = fmin(w->joint->lowest_pa, p1->value);
    return true;
}

// Make P1 an unknown. Start from several shares of the largest stress and keep the best fit.
static bool seek_p1(work *w)
{
    static const double share[] = {0.6, 0.8, 0.93};
    double start[STARTS][KN_FIT_UNKNOWNS];
    int count = 0;
    for (int k = 0; k < 3; k++) {
        kn_fit_values(&w->fit, start[count]);
        start[count][KN_ESTIMATE_P1] = share[k] * w->joint->highest_pa;
        if (start[count][KN_ESTIMATE_P1] > 1.02 * w->joint->lowest_pa) count++;
    }
    kn_fit_values(&w->fit, start[count]); // one more start: P1 beyond the largest stress, where P1 has no effect
    start[count++][KN_ESTIMATE_P1] = 1.1 * w->joint->highest_pa;
    w->fit.unknown[KN_ESTIMATE_P1].fixed = false;
    return kn_fit_run_from(&w->fit, count, start);
}

// Make P0 an unknown that starts above the least stress. Keep P0 as an unknown only if the fit improves by more than
// chance explains.
static void seek_p0(work *w)
{
    const double least = w->joint->lowest_pa;
    kn_fit other = w->fit;
    double start[2][KN_FIT_UNKNOWNS], t = kn_fit_student(w->options.confidence, w->fit.freedom);
    int count = 0;
    for (int k = 0; k < 2; k++) {
        kn_fit_values(&w->fit, start[count]);
        start[count][KN_ESTIMATE_P0] = least * (double[]){1.3, 2.5}[k];
        if (start[count][KN_ESTIMATE_P0] < 0.9 * w->fit.unknown[KN_ESTIMATE_P1].value) count++;
    }
    other.unknown[KN_ESTIMATE_P0].fixed = false;
    if (count == 0 || !kn_fit_run_from(&other, count, start)) return;
    const bool seen = w->fit.sum - other.sum > t * t * other.scale * other.scale;
    if (seen && other.unknown[KN_ESTIMATE_P0].value > 1.001 * least) w->fit = other;
}

// ---- outliers among the readings

// Compute how far the readings of one curve deviate from the fit, in standard deviations. The standard deviation is
// estimated from the median deviation, but is at least the noise of the curve.
static bool deviations(const work *w, int k, double *out)
{
    const kn_curve *c = &w->curve[k];
    double value[KN_FIT_UNKNOWNS], *size = malloc((size_t)c->count * sizeof *size);
    kn_fit_values(&w->fit, value);
    const kn_material m = kn_estimate_material(value);
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

// Return the length of the series of readings around the reading `at` that all deviate by more than half of the limit
// for outliers. The reading `at` belongs to the series.
static int beside(const double *d, int n, int at)
{
    int from = at, to = at;
    while (from > 0 && fabs(d[from - 1]) > outlying / 2) from--;
    while (to + 1 < n && fabs(d[to + 1]) > outlying / 2) to++;
    return to - from + 1;
}

// Leave out the outliers of all curves, but keep an outlier in a series of more than ROW deviating readings: there the
// model is wrong, not the readings.
static void leave_out(work *w)
{
    kn_creep_fit *j = w->joint;
    double *d = malloc((size_t)w->most * sizeof *d);
    bool *left_out = w->left_out;
    for (int k = 0; d && k < w->curves; left_out += w->curve[k++].count) {
        int n = w->curve[k].count;
        if (!deviations(w, k, d)) continue;
        for (int i = 0; i < n && j->outliers < KN_CREEP_OUTLIERS; i++) {
            if (fabs(d[i]) <= outlying || beside(d, n, i) > ROW) continue;
            left_out[i] = true;
            j->outlier[j->outliers++] = (kn_creep_outlier){k, i, w->curve[k].line[i], fabs(d[i])};
            w->fit.readings--;
        }
    }
    free(d);
}

// ---- lateness of the loads

// Estimate the lateness from which the search starts. If the strain begins later than the noted time of the load, this
// difference is late_s. The release was either late by the same time, or came at the noted time. Choose the case in
// which the release is nearer to the largest strain.
static lateness late_at_first(const kn_curve *c)
{
    double least_s;
    const double at_s = kn_strain_onset(c->count, c->time_s, c->value, c->noise, &least_s);
    if (!(least_s > 0)) return (lateness){0, 0};
    const double release_s = kn_creep_release(c);
    const int peak = kn_curve_peak(c);
    const bool as_noted = fabs(c->time_s[peak] - release_s) < fabs(c->time_s[peak] - release_s - at_s);
    return (lateness){at_s, as_noted ? -at_s : 0};
}

// Add the lateness of each curve to the unknowns, but keep it fixed for now.
static void begin_late(work *w)
{
    w->late = true;
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        const lateness l = late_at_first(c);
        const double long_s = c->time_s[c->count - 1];
        const double load_s = isfinite(kn_creep_release(c)) ? kn_creep_release(c) - c->step[c->steps - 2].time_s : 0;
        kn_fit_unknown *u = &w->fit.unknown[LATE + 2 * k];
        u[0] = (kn_fit_unknown){.name = "late", .low = -long_s, .high = long_s, .linear = true, .fixed = true};
        u[1] = (kn_fit_unknown){.name = "held", .low = -0.9 * load_s, .high = load_s, .linear = true, .fixed = true};
        // Start from the estimate, limited to the bounds.
        u[0].value = fmin(l.late_s, u[0].high);
        u[1].value = fmax(l.held_s, u[1].low);
    }
    w->fit.unknowns = LATE + 2 * w->curves;
}

// Make the lateness of all curves unknown and fit once more. If a load was never removed, its held_s stays fixed.
static bool seek_late(work *w)
{
    int held = 0;
    for (int k = 0; k < w->curves; k++) {
        w->fit.unknown[LATE + 2 * k].fixed = false;
        w->fit.unknown[LATE + 2 * k + 1].fixed = !isfinite(kn_creep_release(&w->curve[k]));
    }
    for (int i = 0; i < w->fit.unknowns; i++) held += w->fit.unknown[i].fixed;
    return w->fit.readings > w->fit.unknowns - held && kn_fit_run(&w->fit);
}

// ---- results of the fit

// Compute the interval of the parameter with the index i.
static void interval(work *w, int i)
{
    const kn_fit_unknown *u = &w->fit.unknown[i];
    const double confidence = w->options.confidence;
    kn_fit_interval known = {.low = u->low, .high = u->high, .open_low = true, .open_high = true};
    if (w->options.no_intervals || (constant(w) && i >= KN_ESTIMATE_BETA)) {
        // no interval: none was requested, or the damper is constant and thus has no beta, P0 or P1
    } else if (i == KN_ESTIMATE_P0 && u->fixed) { // P0 has no effect; find how high it could be
        kn_fit free_of = w->fit;
        free_of.unknown[i].fixed = false;
        free_of.unknown[i].low = 0.999 * w->joint->lowest_pa; // every P0 below the least stress fits equally well
        known = kn_fit_interval_by(&free_of, i, confidence, KN_FIT_PROFILE);
        known.open_low = true;
    } else if (i >= KN_ESTIMATE_P0) {
        // use the profile, since the likelihood has a kink where P0 or P1 reaches the end of the measured stresses
        known = kn_fit_interval_by(&w->fit, i, confidence, KN_FIT_PROFILE);
    } else known = kn_fit_interval_of(&w->fit, i, confidence);
    // Every P1 beyond the largest stress fits equally well, so the interval ends at the largest stress.
    if (i == KN_ESTIMATE_P1 && !known.open_high) known.high = fmin(known.high, fmax(w->joint->highest_pa, u->value));
    kn_parameter_estimate_set(&w->joint->number[i], u->name, kn_estimate_unit[i], u->value, known);
}

// For each parameter that is not known, set the text that stands beside it: why it is unknown, or which value is used
// instead.
static void say(const work *w)
{
    static const char *const why[] = {"", "these curves do not show whether this parameter is above 0",
                                      "these curves do not show whether this parameter is finite",
                                      "these curves do not determine this parameter on its own"};
    kn_parameter_estimate *n = w->joint->number, *p0 = &n[KN_ESTIMATE_P0], *p1 = &n[KN_ESTIMATE_P1];
    if (constant(w)) {
        snprintf(n[KN_ESTIMATE_BETA].words, sizeof n->words,
                 "all stresses are nearly equal: these curves do not show how the damper depends on the stress, "
                 "so it is taken as constant");
        return;
    }
    if (p0->known != KN_KNOWN)
        snprintf(p0->words, sizeof p0->words,
                 "the least stress under load, %.4g Pa, is used, since the curves show nothing below it; "
                 "measure a smaller load",
                 w->joint->lowest_pa);
    if (p1->known != KN_KNOWN)
        snprintf(p1->words, sizeof p1->words,
                 "the largest stress, %.4g Pa, lasted only a short time; measure a larger load and sample faster at "
                 "its start",
                 w->joint->highest_pa);
    for (int i = KN_ESTIMATE_K1; i <= KN_ESTIMATE_BETA; i++)
        snprintf(n[i].words, sizeof n->words, "%s", why[n[i].known]);
}

// Compute lateness, residuals and runs of one curve without the curve's outliers.
static bool judge(work *w, int k, const double *value, const bool *left_out)
{
    const kn_curve *c = &w->curve[k];
    kn_creep_fit *j = w->joint;
    const lateness l = lateness_of(w, value, k);
    double sum = 0;
    int n = 0;
    j->late_s[k] = l.late_s;
    j->held_s[k] = l.held_s;
    if (!predict(&j->material, c, l, w->strain)) return false;
    for (int i = 0; i < c->count; i++) {
        if (left_out[i]) continue;
        w->strain[n] = w->strain[i] - c->value[i];
        sum += c->weight[i] * w->strain[n] * w->strain[n];
        n++;
    }
    j->rms[k] = sqrt(sum / n);
    j->runs[k] = kn_fit_runs(n, w->strain);
    return true;
}

// Derive material, intervals, residuals and runs from the finished fit.
static bool conclude(work *w)
{
    kn_creep_fit *j = w->joint;
    double(*c)[KN_FIT_UNKNOWNS] = w->fit.covariance, value[KN_FIT_UNKNOWNS];
    const int a = KN_ESTIMATE_ALPHA, b = KN_ESTIMATE_BETA;
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) interval(w, i);
    kn_fit_values(&w->fit, value);
    j->material = kn_estimate_material(value);
    j->material.p1_pa = fmax(j->material.p1_pa, 1.0001 * j->material.p0_pa);
    if (constant(w)) {
        j->material.damper = KN_DAMPER_CONSTANT;
        j->material.c2_pa_s = j->material.alpha_pa_s;
    }
    j->scale = w->fit.scale;
    j->readings = w->fit.readings;
    // Compute the correlation of alpha and beta from the covariance.
    j->alpha_beta = c[a][a] > 0 && c[b][b] > 0 ? c[a][b] / sqrt(c[a][a] * c[b][b]) : 0;
    say(w);
    const bool *left_out = w->left_out;
    for (int k = 0; k < w->curves; left_out += w->curve[k++].count)
        if (!judge(w, k, value, left_out)) return false;
    return true;
}

// Search in stages: a robust fit from the best starts, then P1 as an unknown. Leave out the outliers and fit with plain
// squares. Then try P0 and the lateness as unknowns.
static bool search(work *w)
{
    double start[STARTS][KN_FIT_UNKNOWNS], best[2][KN_FIT_UNKNOWNS];
    if (w->options.late) begin_late(w);
    const int starts = guesses(w, start);
    w->robust = true;
    if (!kn_fit_run_from(&w->fit, best_two(&w->fit, starts, start, best), best)) return false;
    if (!constant(w) && !seek_p1(w)) return false;
    w->robust = false;
    leave_out(w);
    if (w->fit.readings <= KN_ESTIMATE_NUMBERS || !kn_fit_run(&w->fit) || !fitted_range(w)) return false;
    if (!constant(w)) seek_p0(w);
    return !w->options.late || seek_late(w);
}

bool kn_creep_fit_run(kn_creep_fit *joint, int curves, const kn_curve *curve, const kn_creep_fit_options *options)
{
    *joint = (kn_creep_fit){.outliers = 0};
    work w = {.joint = joint, .options = *options, .curves = curves, .curve = curve};
    w.fit = (kn_fit){.misfit = misfit, .of = &w};
    for (int k = 0; k < curves; k++) {
        w.fit.readings += curve[k].count;
        w.most = curve[k].count > w.most ? curve[k].count : w.most;
    }
    w.strain = calloc((size_t)w.most + 1, sizeof *w.strain);
    w.left_out = calloc((size_t)w.fit.readings + 1, sizeof *w.left_out);
    measured_range(&w);
    bound(&w);
    const bool ok = w.strain && w.left_out && w.fit.readings > KN_ESTIMATE_NUMBERS && search(&w) && conclude(&w);
    free(w.strain);
    free(w.left_out);
    return ok;
}
