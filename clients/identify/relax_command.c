// The command `knead identify relax`: find the parameters of the papers' element from a stress that fell while a strain
// was held.
#include "clients/identify/identify.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/result.h"
#include "clients/cli/curve_table.h"
#include <math.h>
#include <stdlib.h>

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead identify relax FILE... [OPTION]...\n\n"
    "Fit a material to the relaxation of a specimen: the stress while it was held compressed. A material is a spring\n"
    "k1 beside a damper c1, which restore the shape, and in series with them a damper that relaxes the stress. The\n"
    "viscosity of this second damper is alpha exp(-beta P). P is the stress, limited to P0 .. P1.\n\n"
    "A file is a table of time and stress, load or modulus, with a name and a unit above each column. Strain,\n"
    "displacement or height may be further columns. Lines before the table may give values for the whole file:\n"
    "    # strain: 10 %       # height: 1 cm       # area: 1 cm^2       # begin: 1.5 s\n"
    "    time (s); load (gf)\n"
    "If the file contains the rise of the strain, rise and hold are fitted together and determine all parameters. A\n"
    "slow rise, about 2 %/s, is best. A hold alone determines c1/k1, alpha/k1 and beta, and a lower bound of k1.\n"
    "This bound is exact if nothing had flowed by the first reading. A modulus without --strain gives no material.\n\n"
    "the readings:\n"
    "  --strain S             held strain, for files that do not state it, e.g. 10% or 0.1\n"
    "  --height H, --area S   initial height and area of the specimen\n"
    "  --units NAME=UNIT,...  units of columns that have none, e.g. time=s,modulus=Pa\n"
    KN_IDENTIFY_COLUMN_HELP
    KN_IDENTIFY_SHEAR_HELP
    "  --constant-area        take stress = load/S0 (default: the section grows as the height falls, S h = S0 h0)\n"
    "  --noise relative       assume noise that is a share of the stress; fit 20 means per decade of time (default)\n"
    "  --noise constant       assume the same noise at all stresses, like an instrument's; weigh all readings equally\n\n"
    "results:\n"
    KN_IDENTIFY_OUTPUT_HELP
    "\n"
    "The 95 % intervals are valid if the model is right and the noise is independent. The output says whether this is\n"
    "so, and which parameters the curves do not determine. Other models are fitted to the early part of the curves\n"
    "and tested on the later part.\n\n"
    "Examples:\n"
    "    knead relax dough --strain 30% --ramp 2%/s --csv relax.csv\n"
    "    knead identify relax relax.csv --height 1cm --area 1cm^2 --out mine.yaml --png fit.png\n\n"
    "Exit codes: 0 ok, 1 the fit cannot be used in a scene, 2 bad input, 3 a file cannot be written.\n";
// clang-format on

#define FAR 0.05
#define NUMERICS 5e-4 // largest relative misfit that averages and finite differences leave even for a perfect curve

// Return a sentence on the scale k1: how well the curves determine k1, and which parameters depend on it.
static const char *scale_words(const kn_relaxation_fit *r)
{
    switch (r->scale) {
    case KN_RELAXATION_RISE: return "The scale, k1, follows from the rise of the stress with the strain.";
    case KN_RELAXATION_BOUND:
        return "A hold determines c1/k1, alpha/k1 and beta, but gives k1 only a lower bound. "
               "The bound is used as k1, and c1 and alpha scale with it.";
    case KN_RELAXATION_MODULUS: break;
    }
    return "Stresses are in units of the modulus: beta, P0 and P1 refer to the stress divided by the held strain. "
           "Use --strain to state the held strain.";
}

// Return whether the fit gives a material that no scene accepts.
static bool is_refused(const kn_relaxation_fit *r, char *why, size_t size)
{
    return r->scale != KN_RELAXATION_MODULUS && !kn_material_served(&r->material, why, size);
}

// Add a note for each doubt about the fit.
static void doubt(kn_identification *w)
{
    const kn_relaxation_fit *r = &w->relax;
    char why[300];
    for (int c = 0; c < r->curves; c++) {
        const kn_relaxation_curve *k = &r->curve[c];
        const char *name = k->curve->name;
        if (k->misfit > FAR)
            kn_identify_note(w,
                             "%s: the fit is off by %.2g %% on average: "
                             "the specimen does not behave as the papers' element, and the parameters mean little",
                             name, 100 * k->misfit);
        // Long runs of one sign mean that the model's curve does not have the shape of the data.
        if (k->runs > 3 && k->misfit > NUMERICS)
            kn_identify_note(w,
                             "%s: the residuals have long runs of one sign (%.2g standard deviations): "
                             "the model's curve does not have the shape of the data, and the intervals are too narrow",
                             name, k->runs);
        // If the strain did not rise in a straight line, the recorded strain is used, and the noise of this strain
        // affects c1.
        if (k->rises && !k->ramp.straight)
            kn_identify_note(w,
                             "%s: the strain did not rise in a straight line (%.2g %% off): "
                             "the recorded strain is used, and its noise affects c1",
                             name, 100 * k->ramp.apart);
        // In a fast rise, c1 carries most of the stress.
        if (k->rises && k->ramp.strain / (k->ramp.end_s - k->ramp.start_s) > 0.05)
            kn_identify_note(w,
                             "%s: in a rise this fast, %.3g %% a second, c1 carries most of the stress, "
                             "so the other parameters are hardly known; about 2 %% a second is best",
                             name, 100 * k->ramp.strain / (k->ramp.end_s - k->ramp.start_s));
    }
    if (r->scale != KN_RELAXATION_RISE && r->ratio[0].known != KN_KNOWN && r->ratio[1].known != KN_KNOWN) {
        // If beta times the stress stays below 1, the fall is nearly exponential and determines only the sum of the two
        // time constants.
        const double b = r->number[KN_ESTIMATE_BETA].value * r->highest_pa;
        kn_identify_note(w, "c1/k1 and alpha/k1 are not known separately%s",
                         b < 1 ? ": the stress falls exponentially, so only the sum of both is known" : "");
    }
    if (is_refused(r, why, sizeof why)) kn_identify_note(w, "no scene accepts this material: %s", why);
    if (r->scale == KN_RELAXATION_RISE || r->number[KN_ESTIMATE_C1].value > 0) return;
    kn_identify_note(
        w,
        "c1 is 0, because the strain was reached at once: with c1 above 0, this would have taken an infinite stress. "
        "The material answers a sudden strain with its spring k1");
}

// ---- printed results of relax

// Print the parameters that the curves determine: in Pa and Pa s after a rise, otherwise as ratios to k1.
static void print_numbers(const kn_relaxation_fit *r)
{
    const bool rise = r->scale == KN_RELAXATION_RISE;
    printf("\n%-9s best value and 95 %% interval\n", "");
    if (r->scale != KN_RELAXATION_MODULUS) kn_identify_print_number(&r->number[KN_ESTIMATE_K1], 9, 0, "");
    for (int i = 0; i < 2; i++)
        kn_identify_print_number(rise ? &r->number[KN_ESTIMATE_C1 + i] : &r->ratio[i], 9, 0, "");
    for (int i = KN_ESTIMATE_BETA; i < KN_ESTIMATE_NUMBERS; i++) kn_identify_print_number(&r->number[i], 9, 0, "");
    printf("%s\n", scale_words(r));
}

static void print_curves(const kn_relaxation_fit *r)
{
    printf("\n%-20s %9s %9s %9s %9s %9s %6s\n", "curve", "strain %", "readings", "rise", "hold", "misfit %", "runs");
    for (int c = 0; c < r->curves; c++) {
        const kn_relaxation_curve *k = &r->curve[c];
        char strain[20] = "-", runs[16];
        if (k->ramp.strain > 0) snprintf(strain, sizeof strain, "%.4g", 100 * k->ramp.strain);
        printf("%-20s %9s %9d %9d %9d %9.2g %6s\n", k->curve->name, strain, k->curve->count, k->rise.count,
               k->hold.count, 100 * k->misfit, kn_identify_runs(k->runs, runs));
    }
    printf("rise, hold: number of fitted means. misfit: mean of |fit/measured - 1|.\n"
           "runs: standard deviations by which the residuals have fewer runs of one sign than noise has;\n"
           "above 3, the model's curve does not have the shape of the data\n");
}

static void tell_json(const kn_relaxation_fit *r)
{
    static const char *const scale[] = {"rise", "bound", "modulus"};
    json_t *to = kn_result();
    kn_identify_tell_numbers(KN_ESTIMATE_NUMBERS, r->number);
    if (r->scale != KN_RELAXATION_RISE) kn_identify_tell_numbers(2, r->ratio);
    kn_result_text(to, "scale", scale[r->scale]);
    kn_result_number(to, "lowest_stress_pa", r->lowest_pa);
    kn_result_number(to, "highest_stress_pa", r->highest_pa);
    for (int c = 0; c < r->curves; c++) {
        json_t *row = kn_result_add("curves");
        kn_result_text(row, "name", r->curve[c].curve->name);
        kn_result_number(row, "strain", r->curve[c].ramp.strain > 0 ? r->curve[c].ramp.strain : (double)NAN);
        kn_result_integer(row, "readings", r->curve[c].curve->count);
        kn_result_number(row, "misfit", r->curve[c].misfit);
        kn_result_number(row, "runs", r->curve[c].runs);
    }
}

// ---- the plot of --png

enum { SHOWN = 4 }; // number of models that are drawn

typedef struct drawing { // values of the plotted models
    double time_s[KN_IDENTIFY_POINTS], model_pa[SHOWN][KN_IDENTIFY_POINTS], cut_s[2], cut_pa[2];
} drawing;

// Add a curve's hold with its fit to the first panel, and the residuals to the second.
static void add_curve(kn_figure_panel p[2], const kn_relaxation_curve *k, double *left, int hue)
{
    const double *fit = k->fit_pa + k->rise.count;
    const char *name = k->curve->name;
    for (int i = 0; i < k->hold.count; i++) left[i] = 100 * (k->hold.value[i] / fit[i] - 1);
    kn_identify_plot(&p[0], name, k->hold.count, k->hold.time_s, k->hold.value, 1e-3, KN_FIGURE_POINTS, hue);
    kn_identify_plot(&p[0], "fit", k->hold.count, k->hold.time_s, fit, 1e-3, KN_FIGURE_LINE, 0);
    kn_identify_plot(&p[1], name, k->hold.count, k->hold.time_s, left, 1, KN_FIGURE_POINTS, hue);
}

// Add one model's prediction for the first curve to the panel of models.
static void add_model(kn_figure_panel *p, drawing *d, kn_model_comparison *m, int row, int place)
{
    const kn_model_comparison_row *r = &m->row[row];
    double value[KN_FIT_UNKNOWNS];
    for (int i = 0; i < r->unknowns; i++) value[i] = r->unknown[i].value;
    if (!r->fitted ||
        !kn_constitutive_predict(&r->model, value, m->curve, 0, KN_IDENTIFY_POINTS, d->time_s, d->model_pa[place]))
        return;
    // Leave out values far below the readings, since they would flatten the plot.
    for (int i = 0; i < KN_IDENTIFY_POINTS; i++)
        if (d->model_pa[place][i] < d->cut_pa[1]) d->model_pa[place][i] = NAN;
    kn_identify_plot(p, r->model.name, KN_IDENTIFY_POINTS, d->time_s, d->model_pa[place], 1e-3,
                     r->model.yardstick ? KN_FIGURE_DASHES : KN_FIGURE_LINE, place + 2);
}

// Add up to four different models. Each is the best on the later part among the models that are not drawn yet. The
// first and the third may be of any kind, the second is no yardstick, and the fourth consists of springs and dampers.
static void add_models(kn_figure_panel *p, drawing *d, kn_model_comparison *m)
{
    const kn_compared_part *early = &m->curve[0].part[0], *late = &m->curve[0].part[1];
    const double from = early->time_s[0], to = late->count ? late->time_s[late->count - 1] : m->cut_s;
    kn_identify_points(from, to, d->time_s);
    kn_identify_plot(p, "fitted", early->count, early->time_s, early->value, 1e-3, KN_FIGURE_POINTS, 1);
    kn_identify_plot(p, "not fitted", late->count, late->time_s, late->value, 1e-3, KN_FIGURE_POINTS, 8);
    // A dashed vertical line marks the end of the fitted part.
    d->cut_s[0] = d->cut_s[1] = m->cut_s;
    d->cut_pa[0] = early->value[0];
    d->cut_pa[1] = late->count ? late->value[late->count - 1] / 2 : early->value[0] / 10;
    kn_identify_plot(p, NULL, 2, d->cut_s, d->cut_pa, 1e-3, KN_FIGURE_DASHES, 0);
    // Draw each model only once.
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

// Draw the panels: stress over time with the fit, residuals, and, if other models were compared, their predictions for
// the first curve.
static int draw(kn_identification *w, const char *path)
{
    static const char since[] = "time since the strain was reached, s";
    const kn_relaxation_fit *r = &w->relax;
    // the drawing and its panels are too large for the stack
    static drawing d;
    static kn_figure_panel p[3];
    int count = 0;
    for (int c = 0; c < r->curves; c++) count += r->curve[c].hold.count;
    double *left = calloc((size_t)count + 1, sizeof *left);
    if (!left) return kn_complain(w->opt.subcommand, KN_EXIT_DEVICE, "out of memory");
    p[0] = p[2] =
        (kn_figure_panel){.title = "stress", .x_label = since, .y_label = "stress, kPa", .log_x = true, .log_y = true};
    p[1] = (kn_figure_panel){.title = "residuals", .x_label = since, .y_label = "measured/fit - 1, %", .log_x = true};
    p[2].title = "models, fitted left of the dashed line";
    for (int c = 0, n = 0; c < r->curves; n += r->curve[c++].hold.count) add_curve(p, &r->curve[c], left + n, c + 1);
    if (w->compared) add_models(&p[2], &d, &w->models);
    int code =
        kn_figure_draw(w->opt.subcommand, path, "relaxation, and the papers' element", p, w->compared ? 3 : 2, 3);
    free(left);
    return code;
}

// ---- the page of --report

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

// Write the tables of curves and parameters, and the notes.
static void tell_fit(kn_document *d, const kn_identification *w)
{
    const kn_relaxation_fit *r = &w->relax;
    char runs[16];
    kn_document_section(d, "Measurements");
    kn_document_table(d, "Curves", "lrrrr", "curve\tstrain, %\treadings\tmisfit, %\truns");
    for (int c = 0; c < r->curves; c++) {
        const kn_relaxation_curve *k = &r->curve[c];
        char strain[20] = "unknown";
        if (k->ramp.strain > 0) snprintf(strain, sizeof strain, "%.4g", 100 * k->ramp.strain);
        kn_document_row(d, "%s\t%s\t%d\t%.2g\t%s", k->curve->name, strain, k->curve->count, 100 * k->misfit,
                        kn_identify_runs(k->runs, runs));
    }
    kn_document_section(d, "The material");
    kn_document_text(d, "%s", scale_words(r));
    kn_document_table(d, "The papers' element", "lrl", "parameter\tbest value and 95 % interval\tremark");
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) kn_identify_page_number(d, &r->number[i]);
    for (int i = 0; i < 2 && r->scale != KN_RELAXATION_RISE; i++) kn_identify_page_number(d, &r->ratio[i]);
    for (int i = 0; i < w->notes; i++) kn_document_verdict(d, KN_DOCUMENT_BEWARE, "%s", w->note[i]);
}

static int report(kn_identification *w, kn_document *d)
{
    char path[PATH_MAX], why[300];
    tell_fit(d, w);
    int code = draw(w, kn_document_file(d, "fit.png", path));
    if (code != KN_EXIT_OK) return code;
    kn_document_section(d, "Pictures");
    kn_document_picture(d, "fit.png", "Stress over time since the strain was reached, with the fit; residuals; models",
                        "Points: means of the readings, 20 per decade of time. Lines: the fit.");
    if (w->compared) tell_models(d, &w->models);
    return kn_identify_page_files(w, d, "readings.csv", "readings and fit",
                                  w->relax.scale != KN_RELAXATION_MODULUS && !is_refused(&w->relax, why, sizeof why));
}

// ---- the other steps of the experiment relax

static int fit(kn_identification *w)
{
    char error[400];
    const kn_relaxation_fit_options how = {.confidence = 0.95, .constant_noise = w->opt.constant_noise};
    if (!kn_relaxation_fit_run(&w->relax, w->curves, w->curve, &how, error, sizeof error))
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE, "%s", error);
    // A modulus gives a material only if the held strain is known.
    if (w->opt.out && w->relax.scale == KN_RELAXATION_MODULUS)
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                           "--out %s: no material without the held strain, expected it in the file or by --strain",
                           w->opt.out);
    return KN_EXIT_OK;
}

static void tell(kn_identification *w)
{
    char error[400];
    print_numbers(&w->relax);
    print_curves(&w->relax);
    doubt(w);
    tell_json(&w->relax);
    if (!kn_identify_compare(w, error)) printf("\nmodels      not compared: %s\n", error);
}

// Write the fitted stress beside the means of the readings to which it was fitted, for all curves.
static bool csv_rows(const kn_identification *w, FILE *f)
{
    for (int c = 0; c < w->relax.curves; c++) {
        const kn_relaxation_curve *k = &w->relax.curve[c];
        for (int i = 0; i < k->rise.count + k->hold.count; i++) {
            const kn_time_bins *b = i < k->rise.count ? &k->rise : &k->hold;
            const int n = i < k->rise.count ? i : i - k->rise.count;
            kn_table_text(k->curve->name, f);
            fprintf(f, ",%.9g,%.9g,%.9g,%.9g\n", b->time_s[n], b->value[n], k->fit_pa[i], b->weight[n]);
        }
    }
    return true;
}

static int write_material(const kn_identification *w, const char *path)
{
    const kn_relaxation_fit *r = &w->relax;
    char origin[800], source[KN_SOURCE_MAX];
    snprintf(origin, sizeof origin, "relax from %s: %d curve%s, stresses %.4g to %.4g Pa.\n# %s",
             kn_identify_source(w, source), r->curves, r->curves > 1 ? "s" : "", r->lowest_pa, r->highest_pa,
             scale_words(r));
    return kn_material_file_write(w->opt.subcommand, path, origin, NULL, &r->material, w->opt.density_kg_m3,
                                  KN_ESTIMATE_NUMBERS, r->number);
}

const kn_identify_experiment kn_identify_relax = {.subcommand = "identify relax",
                                                  .title = "Stress relaxation",
                                                  .help = help,
                                                  .letter = 'r',
                                                  .kind = KN_CURVE_RELAX,
                                                  .fit = fit,
                                                  .tell = tell,
                                                  .csv_head = "curve,held_s,stress_pa,fit_pa,readings",
                                                  .csv_rows = csv_rows,
                                                  .draw = draw,
                                                  .report = report,
                                                  .write_material = write_material};
