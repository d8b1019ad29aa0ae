#include "clients/identify/relax_told.h"
#include "clients/report/plot_panels.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define FAR 0.05
#define NUMERICS 5e-4 // largest relative misfit that averages and finite differences leave even for a perfect curve

const char *kn_relax_scale(const kn_relaxation_fit *r)
{
    switch (r->scale) {
    case KN_RELAXATION_RISE: return "The scale, k1, follows from the rise of the stress with the strain.";
    case KN_RELAXATION_BOUND:
        return "A hold determines c1/k1, alpha/k1 and beta, but not k1: this is its lower bound, and c1 and alpha "
               "scale with it.";
    case KN_RELAXATION_MODULUS: break;
    }
    return "Stresses are in units of the modulus: beta, P0 and P1 refer to the stress divided by the held strain, "
           "which --strain gives.";
}

// Return whether there is a material that no scene accepts.
static bool is_refused(const kn_relaxation_fit *r, char *why, size_t size)
{
    return r->scale != KN_RELAXATION_MODULUS && !kn_material_served(&r->material, why, size);
}

void kn_relax_doubts(const kn_relaxation_fit *r, void (*say)(void *to, const char *words), void *to)
{
    char text[400], why[300];
    for (int c = 0; c < r->curves; c++) {
        const kn_relaxation_curve *k = &r->curve[c];
        if (k->misfit > FAR) {
            snprintf(text, sizeof text,
                     "%s: the fit is off by %.2g %% on average: this is not the papers' element, and its parameters "
                     "mean little",
                     k->curve->name, 100 * k->misfit);
            say(to, text);
        }
        // Runs of one sign mean that the model has another shape than the data.
        if (k->runs > 3 && k->misfit > NUMERICS) {
            snprintf(text, sizeof text,
                     "%s: the residuals have runs of one sign (%.2g standard deviations): the model has another shape "
                     "than the data, and the intervals are too narrow",
                     k->curve->name, k->runs);
            say(to, text);
        }
        // The rise follows the strain column instead of a straight line, so the noise of the column affects c1.
        if (k->rises && !k->ramp.straight) {
            snprintf(text, sizeof text,
                     "%s: the strain did not rise in a straight line (%.2g %% off): the recorded strain is used, and "
                     "its noise affects c1",
                     k->curve->name, 100 * k->ramp.apart);
            say(to, text);
        }
        // In a fast rise, c1 carries most of the stress.
        if (k->rises && k->ramp.strain / (k->ramp.end_s - k->ramp.start_s) > 0.05) {
            snprintf(text, sizeof text,
                     "%s: in a rise this fast, %.3g %% a second, c1 carries most of the stress, and little is known of "
                     "the others; about 2 %% a second is best",
                     k->curve->name, 100 * k->ramp.strain / (k->ramp.end_s - k->ramp.start_s));
            say(to, text);
        }
    }
    if (r->scale != KN_RELAXATION_RISE && r->ratio[0].known != KN_KNOWN && r->ratio[1].known != KN_KNOWN) {
        // If beta P stays below 1, the fall is nearly exponential and determines only the sum of the two time
        // constants.
        const double b = r->number[KN_ESTIMATE_BETA].value * r->highest_pa;
        snprintf(text, sizeof text, "c1/k1 and alpha/k1 are not known separately%s",
                 b < 1 ? ": the stress falls exponentially, and their sum is its time constant" : "");
        say(to, text);
    }
    if (is_refused(r, why, sizeof why)) {
        snprintf(text, sizeof text, "no scene accepts this material: %s", why);
        say(to, text);
    }
    if (r->scale == KN_RELAXATION_RISE || r->number[KN_ESTIMATE_C1].value > 0) return;
    say(to, "c1 is 0: with any c1, reaching the strain at once would have taken an infinite stress; the virtual "
            "material has none, and answers at once with a spring");
}

// ---- the plot

enum { POINTS = 200, SHOWN = 4 };

typedef struct drawing {
    double time_s[POINTS], model_pa[SHOWN][POINTS], cut_s[2], cut_pa[2];
    double *left[KN_RELAXATION_CURVES];
} drawing;

// Add a curve's hold with its fit to the first panel, and the residuals to the second.
static void add_curve(kn_figure_panel p[2], const kn_relaxation_curve *k, double *left, int hue)
{
    const double *fit = k->fit_pa + k->rise.count;
    const char *name = k->curve->name;
    for (int i = 0; i < k->hold.count; i++) left[i] = 100 * (k->hold.value[i] / fit[i] - 1);
    kn_figure_add(
        &p[0], (kn_figure_series){name, k->hold.count, k->hold.time_s, k->hold.value, 1, 1e-3, KN_FIGURE_POINTS, hue});
    kn_figure_add(&p[0], (kn_figure_series){"fit", k->hold.count, k->hold.time_s, fit, 1, 1e-3, KN_FIGURE_LINE, 0});
    kn_figure_add(&p[1], (kn_figure_series){name, k->hold.count, k->hold.time_s, left, 1, 1, KN_FIGURE_POINTS, hue});
}

// Add one model's prediction for the first curve.
static void add_model(kn_figure_panel *p, drawing *d, kn_model_comparison *m, int row, int place)
{
    const kn_model_comparison_row *r = &m->row[row];
    double value[KN_FIT_UNKNOWNS];
    for (int i = 0; i < r->unknowns; i++) value[i] = r->unknown[i].value;
    if (!r->fitted || !kn_constitutive_predict(&r->model, value, m->curve, 0, POINTS, d->time_s, d->model_pa[place]))
        return;
    // Values far below the readings would flatten the plot.
    for (int i = 0; i < POINTS; i++)
        if (d->model_pa[place][i] < d->cut_pa[1]) d->model_pa[place][i] = NAN;
    kn_figure_add(p, (kn_figure_series){r->model.name, POINTS, d->time_s, d->model_pa[place], 1, 1e-3,
                                        r->model.yardstick ? KN_FIGURE_DASHES : KN_FIGURE_LINE, place + 2});
}

// Add up to four different models: the best on the later part among all laws, the best among the elements, the next
// best of all, and the best of the springs and dampers.
static void add_models(kn_figure_panel *p, drawing *d, kn_model_comparison *m)
{
    const kn_compared_part *early = &m->curve[0].part[0], *late = &m->curve[0].part[1];
    const double from = early->time_s[0], to = late->count ? late->time_s[late->count - 1] : m->cut_s;
    for (int i = 0; i < POINTS; i++) d->time_s[i] = from * pow(to / from, i / (POINTS - 1.0));
    kn_figure_add(
        p, (kn_figure_series){"fitted", early->count, early->time_s, early->value, 1, 1e-3, KN_FIGURE_POINTS, 1});
    kn_figure_add(
        p, (kn_figure_series){"not fitted", late->count, late->time_s, late->value, 1, 1e-3, KN_FIGURE_POINTS, 8});
    // A dashed vertical line marks the end of the fitted part.
    d->cut_s[0] = d->cut_s[1] = m->cut_s;
    d->cut_pa[0] = early->value[0];
    d->cut_pa[1] = late->count ? late->value[late->count - 1] / 2 : early->value[0] / 10;
    kn_figure_add(p, (kn_figure_series){NULL, 2, d->cut_s, d->cut_pa, 1, 1e-3, KN_FIGURE_DASHES, 0});
    // Choose the models in this order, and draw each model only once.
    bool taken[KN_COMPARISON_MAX] = {false};
    for (int place = 0; place < SHOWN; place++) {
        int best = -1;
        for (int i = 0; i < m->rows; i++) {
            const bool wanted = place == 0 || (place == 1 && !m->row[i].model.yardstick) || place == 2 ||
                                (place == 3 && m->row[i].model.kind == KN_CONSTITUTIVE_UNITS);
            if (!taken[i] && wanted && m->row[i].fitted && (best < 0 || m->row[i].held < m->row[best].held)) best = i;
        }
        if (best < 0) continue;
        taken[best] = true;
        add_model(p, d, m, best, place);
    }
}

int kn_relax_draw(const kn_relax_told *t, const char *path)
{
    drawing *d = calloc(1, sizeof *d);
    kn_figure_panel *p = calloc(3, sizeof *p);
    double *left = NULL;
    int count = 0, code = KN_EXIT_DEVICE;
    for (int c = 0; c < t->fit->curves; c++) count += t->fit->curve[c].hold.count;
    if (d && p && (left = calloc((size_t)count + 1, sizeof *left))) {
        const char *since = "time since the strain was reached, s";
        p[0] = (kn_figure_panel){
            .title = "stress", .x_label = since, .y_label = "stress, kPa", .log_x = true, .log_y = true};
        p[1] =
            (kn_figure_panel){.title = "residuals", .x_label = since, .y_label = "measured/fit - 1, %", .log_x = true};
        p[2] = (kn_figure_panel){.title = "models, fitted left of the dashed line",
                                 .x_label = since,
                                 .y_label = "stress, kPa",
                                 .log_x = true,
                                 .log_y = true};
        for (int c = 0, n = 0; c < t->fit->curves; n += t->fit->curve[c++].hold.count)
            add_curve(p, &t->fit->curve[c], left + n, c + 1);
        if (t->models) add_models(&p[2], d, t->models);
        code = kn_figure_draw(t->opt->subcommand, path, "relaxation, and the papers' element", p, t->models ? 3 : 2, 3);
    } else kn_complain(t->opt->subcommand, KN_EXIT_DEVICE, "out of memory");
    free(left);
    free(p);
    free(d);
    return code;
}

// ---- the report

static void say_doubt(void *to, const char *words) { kn_document_verdict(to, KN_DOCUMENT_BEWARE, "%s", words); }

static void tell_number(kn_document *d, const kn_parameter_estimate *n)
{
    char text[120];
    kn_parameter_estimate_text(n, text, sizeof text);
    kn_document_row(d, "%s\t%s\t%s", n->name, text, n->words);
}

// Write the table of models.
static void tell_models(kn_document *d, const kn_model_comparison *m)
{
    char text[1000];
    kn_document_section(d, "Models that these data support");
    kn_model_comparison_verdict(m, text, sizeof text);
    kn_document_text(d, "Fitted up to %.4g s of the hold, tested on the rest: %s.", m->cut_s, text);
    kn_document_table(
        d, "Models", "llrrrrl",
        "model\tfigure 2\tparameters\terror fitted, %\terror later, %\tAICc above the best\tfitted values");
    for (int i = 0; i < m->rows; i++) {
        const kn_model_comparison_row *r = &m->row[i];
        kn_model_comparison_numbers(r, text, sizeof text);
        if (r->fitted)
            kn_document_row(d, "%s\t%s\t%d\t%.3g\t%.3g\t%.1f\t%s", r->model.name, r->model.letters, r->unknowns,
                            100 * r->early, 100 * r->held, r->aicc - m->row[kn_model_comparison_best(m)].aicc, text);
    }
}

// Write the tables of curves and parameters.
static void tell_fit(kn_document *d, const kn_relaxation_fit *r)
{
    kn_document_section(d, "Measurements");
    kn_document_table(d, "Curves", "lrrrr", "curve\tstrain, %\treadings\tmisfit, %\truns");
    for (int c = 0; c < r->curves; c++) {
        const kn_relaxation_curve *k = &r->curve[c];
        char strain[20] = "unknown", runs[20] = "-";
        if (k->ramp.strain > 0) snprintf(strain, sizeof strain, "%.4g", 100 * k->ramp.strain);
        if (!isnan(k->runs)) snprintf(runs, sizeof runs, "%.2g", k->runs);
        kn_document_row(d, "%s\t%s\t%d\t%.2g\t%s", k->curve->name, strain, k->curve->count, 100 * k->misfit, runs);
    }
    kn_document_section(d, "The material");
    kn_document_text(d, "%s", kn_relax_scale(r));
    kn_document_table(d, "The papers' element", "lrl", "parameter\tbest value and 95 % interval\tremark");
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) tell_number(d, &r->number[i]);
    for (int i = 0; i < 2 && r->scale != KN_RELAXATION_RISE; i++) tell_number(d, &r->ratio[i]);
    kn_relax_doubts(r, say_doubt, d);
}

int kn_relax_report(kn_document *d, const kn_relax_told *t,
                    int (*write_csv)(const kn_relax_told *told, const char *path),
                    int (*write_material)(const kn_relax_told *told, const char *path))
{
    char path[PATH_MAX], why[300];
    tell_fit(d, t->fit);
    int code = kn_relax_draw(t, kn_document_file(d, "fit.png", path));
    if (code == KN_EXIT_OK) {
        kn_document_section(d, "Pictures");
        kn_document_picture(d, "fit.png",
                            "Stress over time since the strain was reached, with the fit; residuals; models",
                            "Points: means of the readings, 20 per decade of time. Lines: the fit.");
    }
    if (t->models) tell_models(d, t->models);
    if (code == KN_EXIT_OK) code = write_csv(t, kn_document_file(d, "readings.csv", path));
    kn_document_section(d, "Files");
    kn_document_link(d, "readings.csv", "readings and fit");
    if (code == KN_EXIT_OK && t->fit->scale != KN_RELAXATION_MODULUS && !is_refused(t->fit, why, sizeof why)) {
        code = write_material(t, kn_document_file(d, "material.yaml", path));
        kn_document_link(d, "material.yaml", "the material, for `material: material.yaml` in a scene");
    }
    return code;
}
