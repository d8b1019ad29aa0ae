#include "clients/identify/model_comparison.h"
#include "clients/identify/relaxation_fit.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { EARLY, LATE };

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// ---- early and late readings

// Allocate both parts of a curve.
static bool room(kn_compared_curve *c, int count)
{
    for (int part = EARLY; part <= LATE; part++) {
        c->part[part].time_s = calloc(2 * (size_t)count + 1, sizeof *c->part[part].time_s);
        if (!c->part[part].time_s) return false;
        c->part[part].value = c->part[part].time_s + count;
    }
    return true;
}

static void put(kn_compared_curve *c, int part, double time_s, double value)
{
    kn_compared_part *p = &c->part[part];
    p->time_s[p->count] = time_s;
    p->value[p->count++] = value;
}

// Take the bins of a relaxation. Time counts from the end of the rise, if the strain has one.
static bool take_relax(kn_compared_curve *c, const kn_model_comparison_options *options, double *cut_s)
{
    kn_time_bins b;
    kn_strain_ramp ramp;
    double begin = c->curve->begin_s;
    if (kn_strain_ramp_of(&ramp, c->curve)) {
        c->strain = ramp.strain;
        c->ramp_s = ramp.end_s - ramp.start_s;
        if (c->ramp_s > 0) begin = ramp.end_s;
    } else c->strain = c->curve->strain > 0 ? c->curve->strain : 1;
    if (!kn_time_bins_make(&b, c->curve, begin, NAN)) return false;
    const bool ok = room(c, b.count);
    const double last = b.count ? b.time_s[b.count - 1] : 0;
    // Early is up to a tenth of the time if two decades were measured, else up to half of it.
    *cut_s = options->cut_s > 0 ? options->cut_s : b.count && last >= 100 * b.time_s[0] ? last / 10 : last / 2;
    for (int i = 0; ok && i < b.count; i++) put(c, b.time_s[i] <= *cut_s ? EARLY : LATE, b.time_s[i], b.value[i]);
    kn_time_bins_free(&b);
    return ok;
}

// Take the readings of a creep curve. Every load has an early half and a late half.
static bool take_creep(kn_compared_curve *c, const kn_model_comparison_options *options, double *cut_s)
{
    const kn_curve *curve = c->curve;
    const double end = curve->time_s[curve->count - 1];
    double from[KN_CURVE_STEPS], stress[KN_CURVE_STEPS];
    if (!room(c, curve->count)) return false;
    for (int k = 0; k < curve->steps; k++) from[k] = curve->step[k].time_s, stress[k] = curve->step[k].stress_pa;
    for (int i = 0, k = 0; i < curve->count; i++) {
        while (k + 1 < curve->steps && curve->time_s[i] > from[k + 1]) k++;
        const double until = k + 1 < curve->steps ? fmin(from[k + 1], end) : end;
        // Find the load of this reading. The reading is early if its time since the change of load is below the cut.
        const double cut = options->cut_s > 0 ? options->cut_s : (until - from[k]) / 2;
        if (k == 0) *cut_s = cut;
        put(c, curve->time_s[i] - from[k] <= cut ? EARLY : LATE, curve->time_s[i], curve->value[i]);
    }
    // This fails if there are too many changes of load. The two yardsticks (laws.h) then have no solution.
    kn_superposition_open(&c->memory, curve->constant_area, curve->steps, from, stress, end);
    return true;
}

static double largest(const kn_compared_curve *c)
{
    double most = 0;
    for (int part = EARLY; part <= LATE; part++)
        for (int i = 0; i < c->part[part].count; i++) most = fmax(most, fabs(c->part[part].value[i]));
    return most;
}

static double least(const kn_model_comparison *m, int part)
{
    double pa = INFINITY;
    for (int c = 0; c < m->curves; c++)
        for (int i = 0; i < m->curve[c].part[part].count; i++) pa = fmin(pa, m->curve[c].part[part].value[i]);
    return pa;
}

// Split all curves into early and late readings.
static bool take(kn_model_comparison *m, int curves, const kn_curve *curve, const kn_model_comparison_options *options)
{
    m->relax = curve->kind == KN_CURVE_RELAX;
    for (int c = 0; c < curves; c++) {
        kn_compared_curve *to = &m->curve[m->curves++];
        double cut;
        *to = (kn_compared_curve){.curve = &curve[c], .strain = 1};
        if (!(m->relax ? take_relax : take_creep)(to, options, &cut)) return false;
        if (c == 0) m->cut_s = cut;
        m->early += to->part[EARLY].count;
        m->late += to->part[LATE].count;
    }
    if (m->relax) m->early_pa = least(m, EARLY), m->late_pa = least(m, LATE);
    return true;
}

// ---- one fit

typedef struct work {
    kn_model_comparison *m;
    const kn_constitutive_model *law;
    double *scratch;
} work;

// Compute the residuals of one part of all curves. With `scale`, they are in the units of the fit, else shares of the
// reading or of the curve's largest strain.
static bool residuals(const work *w, const double *value, int part, bool scale, double *residual)
{
    for (int c = 0, n = 0; c < w->m->curves; c++) {
        kn_compared_curve *curve = &w->m->curve[c];
        const kn_compared_part *p = &curve->part[part];
        const double most = w->m->relax ? 0 : largest(curve);
        // A creep residual is divided by the noise, or by a small share of the largest strain if that is larger.
        const double unit = scale ? fmax(curve->curve->noise, KN_COMPARISON_COARSE * most) : most;
        if (!kn_constitutive_model_predict(w->law, value, w->m->curve, c, p->count, p->time_s, w->scratch))
            return false;
        for (int i = 0; i < p->count; i++, n++) {
            if (!w->m->relax) residual[n] = (w->scratch[i] - p->value[i]) / unit;
            else if (!scale) residual[n] = w->scratch[i] / p->value[i] - 1;
            else if (w->scratch[i] > 0) residual[n] = log(w->scratch[i] / p->value[i]);
            else return false;
        }
    }
    return true;
}

static bool misfit(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    return residuals(of, value, EARLY, true, residual);
}

// Return the error of one part: a mean of shares in relaxation, a root mean square in creep.
static double error_of(const work *w, const double *value, int part, double *residual)
{
    const int count = part == EARLY ? w->m->early : w->m->late;
    double sum = 0;
    if (!residuals(w, value, part, false, residual)) return INFINITY;
    for (int i = 0; i < count; i++) sum += w->m->relax ? fabs(residual[i]) : residual[i] * residual[i];
    return w->m->relax ? sum / count : sqrt(sum / count);
}

// Compute the runs and the errors of both parts.
static void judge(const work *w, kn_model_comparison_row *row, double *residual)
{
    double value[KN_FIT_UNKNOWNS];
    for (int i = 0; i < row->unknowns; i++) value[i] = row->unknown[i].value;
    row->runs = residuals(w, value, EARLY, true, residual) ? kn_fit_runs(w->m->early, residual) : NAN;
    row->early = error_of(w, value, EARLY, residual);
    row->held = error_of(w, value, LATE, residual);
}

// Return whether the data leave the unknown undetermined: it is at a bound, or its standard deviation is at least 1
// (logarithm) or at least the value itself (linear unknown).
static bool is_loose(const kn_fit *fit, int unknown)
{
    const kn_fit_unknown *u = &fit->unknown[unknown];
    const double off = fit->scale * sqrt(fit->covariance[unknown][unknown]);
    return u->at_bound || !(off < (u->linear ? fabs(u->value) : 1));
}

// Return the AICc of a fit. Misfits below KN_COMPARISON_FINE count as equal, so that numerical errors do not decide between
// models.
static double aicc_of(const kn_model_comparison *m, const kn_fit *fit)
{
    // residual of size KN_COMPARISON_FINE, in the units of the fit
    const double fine = KN_COMPARISON_FINE / (m->relax ? 1 : KN_COMPARISON_COARSE);
    return kn_fit_aicc(fit->readings, fit->unknowns, fmax(fit->sum, fit->readings * fine * fine));
}

// Fit one law to the early part and judge it by the late part.
static void fit_law(kn_model_comparison *m, const kn_constitutive_model *law, kn_model_comparison_row *row,
                    double *scratch)
{
    double start[KN_CONSTITUTIVE_STARTS][KN_FIT_UNKNOWNS];
    work w = {m, law, scratch};
    kn_fit fit = {.readings = m->early, .misfit = misfit, .of = &w};
    *row = (kn_model_comparison_row){
        .law = *law, .readings = m->early, .aicc = INFINITY, .early = INFINITY, .held = INFINITY, .runs = NAN};
    row->unknowns = fit.unknowns = kn_constitutive_model_unknowns(law, m->curves, m->curve, fit.unknown);
    if (fit.unknowns + 2 >= m->early) return;
    // row that was fitted before, which may be the same law with fewer parameters
    const kn_model_comparison_row *last = m->rows ? &m->row[m->rows - 1] : NULL;
    // The search of a law with more parameters may continue from the fit with fewer.
    const bool follows = last && last->fitted && last->law.kind == law->kind;
    const int starts = kn_constitutive_model_starts(law, m->curves, m->curve, follows ? last->unknowns : 0,
                                                    follows ? last->unknown : NULL, start);
    if (!kn_fit_run_from(&fit, starts, start)) return;
    row->fitted = true;
    memcpy(row->unknown, fit.unknown, sizeof row->unknown);
    for (int i = 0; i < fit.unknowns; i++) row->loose[i] = is_loose(&fit, i);
    row->aicc = aicc_of(m, &fit);
    judge(&w, row, scratch + m->early + m->late);
}

// Keep one row for the variants that share a name: the one with the lower AICc on the early part.
static void keep(kn_model_comparison *m, const kn_model_comparison_row *row)
{
    kn_model_comparison_row *before = m->rows ? &m->row[m->rows - 1] : NULL;
    if (before && !strcmp(row->law.name, before->law.name)) {
        if (row->aicc < before->aicc) *before = *row;
    } else if (m->rows < KN_COMPARISON_MAX) m->row[m->rows++] = *row;
}

// Fit all laws of the experiment in turn.
static bool fit_all(kn_model_comparison *m)
{
    kn_constitutive_model law[KN_CONSTITUTIVE_MAX];
    const int laws = kn_constitutive_models(law, m->relax);
    double *scratch = calloc(2 * ((size_t)m->early + (size_t)m->late), sizeof *scratch);
    for (int i = 0; scratch && i < laws; i++) {
        kn_model_comparison_row row;
        fit_law(m, &law[i], &row, scratch);
        keep(m, &row);
    }
    const bool ok = scratch != NULL;
    free(scratch);
    return ok;
}

bool kn_model_comparison_run(kn_model_comparison *m, int curves, const kn_curve *curve,
                             const kn_model_comparison_options *options, char *error, size_t error_size)
{
    // Each message is written to `error` before the check that may fail with it.
    const double begin = now_s();
    *m = (kn_model_comparison){0};
    snprintf(error, error_size, "%d relaxation curves at once, expected at most %d", curves, KN_COMPARISON_HOLDS);
    if (curve->kind == KN_CURVE_RELAX && curves > KN_COMPARISON_HOLDS) return false;
    snprintf(error, error_size, "out of memory");
    if (!take(m, curves, curve, options)) return false;
    snprintf(error, error_size,
             "%d readings before the cut and %d after it are too few to compare models, expected 8 and 3", m->early,
             m->late);
    if (m->early < 8 || m->late < 3) return false;
    for (int c = 0; m->relax && c < curves; c++)
        for (int part = EARLY; part <= LATE; part++)
            for (int i = 0; i < m->curve[c].part[part].count; i++)
                if (!(m->curve[c].part[part].value[i] > 0)) {
                    snprintf(error, error_size, "%s falls to 0 or below, so relative errors are undefined",
                             curve[c].name);
                    return false;
                }
    snprintf(error, error_size, "out of memory");
    const bool ok = fit_all(m);
    m->took_s = now_s() - begin;
    return ok;
}

void kn_model_comparison_free(kn_model_comparison *m)
{
    for (int c = 0; c < m->curves; c++) {
        for (int part = EARLY; part <= LATE; part++) free(m->curve[c].part[part].time_s);
        kn_superposition_close(&m->curve[c].memory);
    }
    *m = (kn_model_comparison){0};
}
