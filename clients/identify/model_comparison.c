#include "clients/identify/model_comparison.h"
#include "clients/identify/relaxation_fit.h"
#include "clients/cli/result.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <stdarg.h>
#include <string.h>

enum { EARLY, LATE };

#define RUNS 3.0 // limit of kn_fit_runs, in standard deviations; residuals above the limit are not noise
// The data support a model as well as the best model if its AICc is at most this much above the least AICc (Burnham and
// Anderson, Model selection, 2.6)
#define NEAR_AICC 2
// NEAR_HELD: a model is as good as the best model on the late part if its error there is at most this many times the
// least error. BELOW: the late stresses count as lower than the early ones if the least late stress is below this share
// of the least early stress.
#define NEAR_HELD 1.1
#define BELOW 0.98

// ---- early and late readings

// Allocate the arrays of both parts of a curve, in one block of memory.
static bool room(kn_compared_curve *c, int count)
{
    double *block = calloc(4 * (size_t)count + 1, sizeof *block);
    for (int part = EARLY; block && part <= LATE; part++, block += 2 * count)
        c->part[part] = (kn_compared_part){.time_s = block, .value = block + count, .least = INFINITY};
    return block;
}

static void put(kn_compared_curve *c, int part, double time_s, double value)
{
    kn_compared_part *p = &c->part[part];
    p->time_s[p->count] = time_s;
    p->value[p->count++] = value;
    p->least = fmin(p->least, value);
    c->largest = fmax(c->largest, fabs(value));
}

// Take the means of a relaxation over bins of time. Time counts from the end of the rise of the strain, if the curve
// has a rise.
static bool take_relax(kn_compared_curve *c, double cut_option_s, double *cut_s)
{
    kn_time_bins b;
    kn_strain_ramp ramp;
    double begin = c->curve->begin_s;
    if (kn_strain_ramp_of(&ramp, c->curve)) {
        c->strain = ramp.strain;
        c->ramp_s = ramp.end_s - ramp.start_s;
        if (c->ramp_s > 0) begin = ramp.end_s;
    } else c->strain = c->curve->strain > 0 ? c->curve->strain : 1;
    if (!kn_time_bins_make(&b, c->curve, begin)) return false;
    const bool ok = room(c, b.count);
    const double last = b.count ? b.time_s[b.count - 1] : 0;
    // Without a given cut, the early part ends at a tenth of the last time if the readings span two decades of time;
    // otherwise it ends at half of the last time.
    *cut_s = cut_option_s > 0 ? cut_option_s : b.count && last >= 100 * b.time_s[0] ? last / 10 : last / 2;
    for (int i = 0; ok && i < b.count; i++) put(c, b.time_s[i] <= *cut_s ? EARLY : LATE, b.time_s[i], b.value[i]);
    kn_time_bins_free(&b);
    return ok;
}

// Take the readings of a creep curve. Each span between two changes of load has an early half and a late half.
static bool take_creep(kn_compared_curve *c, double cut_option_s, double *cut_s)
{
    const kn_curve *curve = c->curve;
    const double end = curve->time_s[curve->count - 1];
    if (!room(c, curve->count)) return false;
    for (int i = 0, k = 0; i < curve->count; i++) {
        while (k + 1 < curve->steps && curve->time_s[i] > curve->step[k + 1].time_s) k++;
        const double from = curve->step[k].time_s;
        const double until = k + 1 < curve->steps ? fmin(curve->step[k + 1].time_s, end) : end;
        // Find the load of this reading. The reading is early if its time since the last change of load is at most the
        // cut.
        const double cut = cut_option_s > 0 ? cut_option_s : (until - from) / 2;
        if (k == 0) *cut_s = cut;
        put(c, curve->time_s[i] - from <= cut ? EARLY : LATE, curve->time_s[i], curve->value[i]);
    }
    // Opening the superposition fails if the load changes too often. The two yardstick models then have no solution.
    kn_superposition_open(&c->superposition, curve);
    return true;
}

// Split all curves into early and late readings.
static bool take(kn_model_comparison *m, int curves, const kn_curve *curve, double cut_s)
{
    m->early_pa = m->late_pa = INFINITY;
    m->relax = curve->kind == KN_CURVE_RELAX;
    for (int c = 0; c < curves; c++) {
        kn_compared_curve *to = &m->curve[m->curves++];
        double cut;
        *to = (kn_compared_curve){.curve = &curve[c], .strain = 1};
        if (!(m->relax ? take_relax : take_creep)(to, cut_s, &cut)) return false;
        if (c == 0) m->cut_s = cut;
        m->early += to->part[EARLY].count;
        m->late += to->part[LATE].count;
        m->early_pa = fmin(m->early_pa, to->part[EARLY].least);
        m->late_pa = fmin(m->late_pa, to->part[LATE].least);
    }
    return true;
}

// ---- fitting one model

typedef struct work {
    kn_model_comparison *m;
    const kn_constitutive_model *model;
    double *scratch;
} work;

// Compute the residuals of one part (early or late) of all curves. If `scale` is true, the residuals are in the units
// of the fit. Otherwise they are shares of the reading (relaxation) or of the curve's largest strain (creep).
static bool residuals(const work *w, const double *value, int part, bool scale, double *residual)
{
    for (int c = 0, n = 0; c < w->m->curves; c++) {
        kn_compared_curve *curve = &w->m->curve[c];
        const kn_compared_part *p = &curve->part[part];
        const double most = curve->largest;
        // A creep residual is divided by the noise, or by a small share of the largest strain if this share is larger.
        const double unit = scale ? fmax(curve->curve->noise, KN_COMPARISON_COARSE * most) : most;
        if (!kn_constitutive_predict(w->model, value, w->m->curve, c, p->count, p->time_s, w->scratch)) return false;
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

// Return the relative error of one part: the mean absolute error in relaxation, the root mean square error in creep.
static double error_of(const work *w, const double *value, int part, double *residual)
{
    const int count = part == EARLY ? w->m->early : w->m->late;
    double sum = 0;
    if (!residuals(w, value, part, false, residual)) return INFINITY;
    for (int i = 0; i < count; i++) sum += w->m->relax ? fabs(residual[i]) : residual[i] * residual[i];
    return w->m->relax ? sum / count : sqrt(sum / count);
}

// Return whether the data leave the unknown undetermined: its best value is at a bound, or its standard deviation is
// too large. The limit of the standard deviation is 1 if the unknown is fitted as a logarithm; if the unknown is
// linear, the limit is its value.
static bool is_loose(const kn_fit *fit, int unknown)
{
    const kn_fit_unknown *u = &fit->unknown[unknown];
    const double off = fit->scale * sqrt(fit->covariance[unknown][unknown]);
    return u->at_bound || !(off < (u->linear ? fabs(u->value) : 1));
}

// Return the AICc of a fit. Misfits below KN_COMPARISON_FINE count as equal, so that numerical errors do not decide
// between models.
static double aicc_of(const kn_model_comparison *m, const kn_fit *fit)
{
    // residual of size KN_COMPARISON_FINE, in the units of the fit
    const double fine = KN_COMPARISON_FINE / (m->relax ? 1 : KN_COMPARISON_COARSE);
    return kn_fit_aicc(fit->readings, fit->unknowns, fmax(fit->sum, fit->readings * fine * fine));
}

// Fit one model to the early part and judge it by the late part.
static void fit_model(kn_model_comparison *m, const kn_constitutive_model *model, kn_model_comparison_row *row,
                      double *scratch)
{
    double start[KN_CONSTITUTIVE_STARTS][KN_FIT_UNKNOWNS], value[KN_FIT_UNKNOWNS];
    double *residual = scratch + m->early + m->late;
    work w = {m, model, scratch};
    kn_fit fit = {.readings = m->early, .misfit = misfit, .of = &w};
    *row =
        (kn_model_comparison_row){.model = *model, .aicc = INFINITY, .early = INFINITY, .held = INFINITY, .runs = NAN};
    row->unknowns = fit.unknowns = kn_constitutive_unknowns(model, m->curves, m->curve, fit.unknown);
    if (fit.unknowns + 2 >= m->early) return;
    // the previous row, which may hold a variant of this model with fewer parameters
    const kn_model_comparison_row *last = m->rows ? &m->row[m->rows - 1] : NULL;
    // The search of a model with more parameters may start from the fit of the model with fewer parameters.
    const bool follows = last && last->fitted && last->model.kind == model->kind;
    const int starts = kn_constitutive_starts(model, m->curves, m->curve, follows ? last->unknowns : 0,
                                              follows ? last->unknown : NULL, start);
    if (!kn_fit_run_from(&fit, starts, start)) return;
    row->fitted = true;
    memcpy(row->unknown, fit.unknown, sizeof row->unknown);
    for (int i = 0; i < fit.unknowns; i++) row->loose[i] = is_loose(&fit, i);
    row->aicc = aicc_of(m, &fit);
    kn_fit_values(&fit, value);
    if (residuals(&w, value, EARLY, true, residual)) row->runs = kn_fit_runs(m->early, residual);
    row->early = error_of(&w, value, EARLY, residual);
    row->held = error_of(&w, value, LATE, residual);
}

// Fit all models of the experiment in turn. Variants of a model that share a name get one row. The row keeps the
// variant with the lower AICc on the early part.
static bool fit_all(kn_model_comparison *m)
{
    kn_constitutive_model model[KN_CONSTITUTIVE_MAX];
    const int models = kn_constitutive_models(model, m->relax);
    double *scratch = calloc(2 * ((size_t)m->early + (size_t)m->late), sizeof *scratch);
    for (int i = 0; scratch && i < models; i++) {
        kn_model_comparison_row row, *before = m->rows ? &m->row[m->rows - 1] : NULL;
        fit_model(m, &model[i], &row, scratch);
        if (before && !strcmp(row.model.name, before->model.name)) {
            if (row.aicc < before->aicc) *before = row;
        } else if (m->rows < KN_COMPARISON_MAX) m->row[m->rows++] = row;
    }
    const bool ok = scratch;
    free(scratch);
    return ok;
}

bool kn_model_comparison_run(kn_model_comparison *m, int curves, const kn_curve *curve, double cut_s, char *error,
                             size_t error_size)
{
    // Each message is written to `error` before the check to which it belongs.
    *m = (kn_model_comparison){0};
    snprintf(error, error_size, "%d relaxation curves at once, expected at most %d", curves, KN_COMPARISON_HOLDS);
    if (curve->kind == KN_CURVE_RELAX && curves > KN_COMPARISON_HOLDS) return false;
    snprintf(error, error_size, "out of memory");
    if (!take(m, curves, curve, cut_s)) return false;
    snprintf(error, error_size,
             "%d readings before the cut and %d after it are too few to compare models, expected 8 and 3", m->early,
             m->late);
    if (m->early < 8 || m->late < 3) return false;
    for (int c = 0; m->relax && c < curves; c++) {
        snprintf(error, error_size, "%s falls to 0 or below, so relative errors are undefined", curve[c].name);
        if (!(m->curve[c].part[EARLY].least > 0 && m->curve[c].part[LATE].least > 0)) return false;
    }
    snprintf(error, error_size, "out of memory");
    return fit_all(m);
}

void kn_model_comparison_free(kn_model_comparison *m)
{
    for (int c = 0; c < m->curves; c++) {
        free(m->curve[c].part[EARLY].time_s);
        kn_superposition_close(&m->curve[c].superposition);
    }
    *m = (kn_model_comparison){0};
}

// ---- the results as a table, a sentence and JSON

int kn_model_comparison_best(const kn_model_comparison *m)
{
    int best = 0;
    for (int i = 1; i < m->rows; i++)
        if (m->row[i].aicc < m->row[best].aicc) best = i;
    return best;
}

// Return the error of the late part. An error below KN_COMPARISON_SAME is raised to this limit, so that all such errors
// are equal.
static double held_of(const kn_model_comparison_row *row) { return fmax(row->held, KN_COMPARISON_SAME); }

// Return the row with the least error on the late part, or -1. `yardsticks`: whether the yardstick models are included.
static int best_held(const kn_model_comparison *m, bool yardsticks)
{
    int best = -1;
    for (int i = 0; i < m->rows; i++) {
        if (m->row[i].model.yardstick && !yardsticks) continue;
        if (m->row[i].fitted && (best < 0 || held_of(&m->row[i]) < held_of(&m->row[best]))) best = i;
    }
    return best;
}

__attribute__((format(printf, 3, 4))) static void append(char *text, size_t size, const char *format, ...)
{
    const size_t n = strlen(text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text + n, size - n, format, arguments);
    va_end(arguments);
}

static void append_name(char *text, size_t size, const kn_model_comparison_row *row)
{
    const char *letters = row->model.letters;
    append(text, size, "%s%s%s%s", row->model.name, *letters ? " (" : "", letters, *letters ? ")" : "");
}

// Return whether the row describes the early part as well as the best row does.
static bool describes(const kn_model_comparison *m, int i)
{
    const kn_model_comparison_row *row = &m->row[i], *best = &m->row[kn_model_comparison_best(m)];
    const bool both_fine = row->early < KN_COMPARISON_FINE && best->early < KN_COMPARISON_FINE;
    return row->fitted && (both_fine || row->aicc <= best->aicc + NEAR_AICC);
}

// Return whether the row describes both parts as well as the best row of each part does.
static bool supported(const kn_model_comparison *m, int i)
{
    return describes(m, i) && held_of(&m->row[i]) <= NEAR_HELD * held_of(&m->row[best_held(m, true)]);
}

// Append the names of the rows for which the function `those` returns true. Return the number of these rows.
static int append_names(const kn_model_comparison *m, bool (*those)(const kn_model_comparison *m, int i), char *text,
                        size_t size)
{
    int count = 0;
    for (int i = 0; i < m->rows; i++) {
        if (!those(m, i)) continue;
        append(text, size, "%s", count++ ? ", " : "");
        append_name(text, size, &m->row[i]);
    }
    return count;
}

// Return whether the models with the papers' damper fail only at stresses below all fitted stresses. A P0 above these
// low stresses would give the damper another value there. A failure at such stresses therefore does not exclude the
// papers' damper.
static bool is_below_all(const kn_model_comparison *m)
{
    bool any = false;
    for (int i = 0; i < m->rows; i++) {
        if (supported(m, i)) return false;
        any |= describes(m, i) && m->row[i].model.kind == KN_CONSTITUTIVE_PAPERS;
    }
    return any && m->relax && m->late_pa < BELOW * m->early_pa;
}

// Name the rows that are as good as the best on both parts. If there are none, name the best rows of the early part,
// and the best row of the late part.
static void say_support(const kn_model_comparison *m, char *text, size_t size)
{
    bool any = false;
    for (int i = 0; i < m->rows; i++) any |= supported(m, i);
    if (any) {
        append(text, size, "the data support ");
        append_names(m, supported, text, size);
        append(text, size,
               ": best on the fitted part (AICc at most 2 above the least) and on the later part (error at most 1.1 "
               "times the least)");
        return;
    }
    const int count = append_names(m, describes, text, size);
    append(text, size, " describe%s the fitted part best, ", count > 1 ? "" : "s");
    append_name(text, size, &m->row[best_held(m, true)]);
    append(text, size, " the later part%s", is_below_all(m) ? "" : ": no model does both");
}

// If a yardstick is best on the later part, also name the best model of springs and dampers.
static void say_elements(const kn_model_comparison *m, char *text, size_t size)
{
    const int element = best_held(m, false), any = best_held(m, true);
    if (element < 0 || element == any) return;
    append(text, size, "; a yardstick wins; among springs and dampers, ");
    append_name(text, size, &m->row[element]);
    append(text, size, " comes nearest: its error on the later part is %.3g %%, that of the yardstick %.3g %%",
           100 * m->row[element].held, 100 * m->row[any].held);
}

void kn_model_comparison_verdict(const kn_model_comparison *m, char *text, size_t size)
{
    bool noise = false, known = false;
    *text = '\0';
    if (best_held(m, true) < 0) {
        append(text, size, "no model could be fitted");
        return;
    }
    say_support(m, text, size);
    say_elements(m, text, size);
    // If the models fail because the later stresses are below the fitted ones, say so.
    if (is_below_all(m))
        append(text, size,
               ". The later stresses (down to %.3g Pa) are below all fitted stresses (%.3g Pa and more). "
               "The fit shows neither the damper at such stresses nor a P0 above them. "
               "So the failure does not rule out a thinning damper; a later --cut shows more",
               m->late_pa, m->early_pa);
    for (int i = 0; i < m->rows; i++) {
        // Runs of one sign in the residuals of all models mean that no model has the shape of the data.
        known |= !isnan(m->row[i].runs);
        noise |= m->row[i].runs <= RUNS || m->row[i].early < KN_COMPARISON_FINE;
    }
    if (known && !noise)
        append(text, size,
               ". The residuals of all models have long runs of one sign, unlike noise: none of them describes the "
               "material");
}

void kn_model_comparison_numbers(const kn_model_comparison_row *row, char *text, size_t size)
{
    *text = '\0';
    for (int i = 0; i < row->unknowns; i++) {
        const kn_fit_unknown *u = &row->unknown[i];
        append(text, size, "%s%s %.3g%s%s%s", i ? ", " : "", u->name, u->value, *u->unit ? " " : "", u->unit,
               row->loose[i] ? " (?)" : "");
    }
}

// Print the row of one model in the table of models.
static void print_row(const kn_model_comparison *m, const kn_model_comparison_row *row)
{
    char name[120] = "", numbers[400], runs[16] = "-";
    append_name(name, sizeof name, row);
    if (!row->fitted) {
        printf("%-42s %2d  no fit\n", name, row->unknowns);
        return;
    }
    kn_model_comparison_numbers(row, numbers, sizeof numbers);
    if (!isnan(row->runs)) snprintf(runs, sizeof runs, "%.1f", row->runs);
    printf("%-42s %2d %9.3g %9.3g %9.1f %5s  %s\n", name, row->unknowns, 100 * row->early, 100 * row->held,
           row->aicc - m->row[kn_model_comparison_best(m)].aicc, runs, numbers);
}

void kn_model_comparison_print(const kn_model_comparison *m)
{
    char text[1000];
    printf("\nmodels      fitted to %d readings up to %.4g s%s, tested on the %d later readings\n", m->early, m->cut_s,
           m->relax ? " of the hold" : " of each load", m->late);
    printf("            %s\n", m->relax
                                   ? "errors: mean of |model/measured - 1|; readings are means in 20 bins per decade"
                                   : "errors: root mean square, relative to the curve's largest strain");
    printf("%-42s %2s %9s %9s %9s %5s\n", "", "n", "fitted %", "later %", "AICc", "runs");
    for (int i = 0; i < m->rows; i++) print_row(m, &m->row[i]);
    printf(
        "letters: elements in figure 2 of the first paper. n: number of parameters. AICc: difference from the best.\n"
        "runs: standard deviations by which the residuals have fewer runs of one sign than noise has;\n"
        "above 3, the model's curve does not have the shape of the data. (?): not determined by the fitted part\n");
    kn_model_comparison_verdict(m, text, sizeof text);
    printf("verdict     %s.\n", text);
}

void kn_model_comparison_tell(const kn_model_comparison *m)
{
    char text[1000];
    if (!kn_result()) return;
    for (int i = 0; i < m->rows; i++) {
        const kn_model_comparison_row *row = &m->row[i];
        json_t *to = kn_result_add("models"), *numbers = json_object();
        kn_result_text(to, "name", row->model.name);
        kn_result_text(to, "letters", row->model.letters);
        kn_result_bool(to, "yardstick", row->model.yardstick);
        kn_result_bool(to, "supported", supported(m, i));
        kn_result_number(to, "fitted_error", row->early);
        kn_result_number(to, "later_error", row->held);
        kn_result_number(to, "aicc", row->aicc);
        kn_result_number(to, "runs", row->runs);
        for (int k = 0; row->fitted && k < row->unknowns; k++)
            kn_result_number(numbers, row->unknown[k].name, row->unknown[k].value);
        json_object_set_new(to, "numbers", numbers);
        json_t *loose = json_array();
        for (int k = 0; row->fitted && k < row->unknowns; k++)
            if (row->loose[k]) json_array_append_new(loose, json_string(row->unknown[k].name));
        json_object_set_new(to, "not_known", loose);
    }
    kn_model_comparison_verdict(m, text, sizeof text);
    kn_result_text(kn_result(), "verdict", text);
    kn_result_number(kn_result(), "models_cut_s", m->cut_s);
}
