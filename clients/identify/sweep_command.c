// The command `knead identify sweep`: find springs and dampers from storage and loss modulus over frequency.
#include "clients/identify/identify.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/result.h"
#include "clients/cli/curve_table.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead identify sweep FILE... [OPTION]...\n\n"
    "Fit springs and dampers to the storage modulus G' and the loss modulus G'' over frequency. Every element of the first\n"
    "paper's figure 2 that such a measurement can distinguish is fitted, and the output names the one that the data support.\n\n"
    "    knead identify sweep sweep.csv --out putty.yaml --png fit.png\n\n"
    "A file is a table with a name and a unit above each column: frequency, Hz or rad/s; G' and G'', or |G*| with tan\n"
    "delta or the phase angle. Several files are of one material.\n\n"
    "  --shear           read the moduli as moduli of shear; the result is for compression, three times as much for a\n"
    "                    material that keeps its volume\n"
    "  --units NAME=UNIT,...  units of columns that have none, e.g. omega=rad/s,storage=Pa\n"
    "  --out FILE        the material, for `material: FILE` in a scene, every parameter with its interval beside it; the\n"
    "                    best supported of the elements that a scene can have: s|d, s-d, (s|d)-d; nothing is written if the\n"
    "                    element is off by more than 30 % on average\n"
    "  --density D       density of the material, written to the file (default: 1.2 g/cm^3, with a remark)\n"
    "  --report DIR      folder for a page, DIR/index.html, with all results, the plot, the moduli and the material\n"
    "  --png FILE        plot of moduli, fit and residuals, by gnuplot\n"
    "  --csv FILE        table of moduli and fit\n"
    "  --json            print the results as JSON\n\n"
    "In a sweep of small amplitude, a damper that depends on the stress shows c2 at rest, but not beta, P0 and P1. For these\n"
    "use knead identify creep or relax.\n"
    "Exit codes: 0 ok, 1 the fit cannot be used in a scene, 2 bad input, 3 a file cannot be written.\n";
// clang-format on

static const char at_rest[] =
    "a sweep of small amplitude shows the damper at rest, c2 = c_max, not how it thins: beta, P0 "
    "and P1 need creep or relax";

#define FAR 0.05    // misfit above which noise must explain it, as in relax
#define ABSURD 0.30 // a material whose relative misfit exceeds this limit does not describe the data and is not written
#define FLOOR 1e-3  // a relative misfit below this limit cannot be felt, so it does not lead to a note

// ---- notes on what is doubtful

static double noise(const kn_identification *w)
{
    double most = 0;
    for (int c = 0; c < w->curves; c++) most = fmax(most, w->curve[c].noise);
    return most;
}

// Return whether the element that a scene can load does not fit the data, with one sentence on its misfit. The mean of
// |x| of normal deviates is 0.8 of their standard deviation, so a misfit of twice the noise is more than noise.
static bool doubt(const kn_identification *w, char *text, size_t size)
{
    const kn_sweep_fit *s = &w->sweep;
    if (s->material < 0) return false;
    const kn_sweep_fit_row *m = &s->row[s->material], *best = &s->row[s->best];
    // The element is rejected if another element is much better supported, or if its misfit exceeds the noise.
    const bool rejected = m->error > FLOOR && m->aicc > best->aicc + KN_SWEEP_FIT_NEAR;
    const bool beyond_noise = m->error > FAR && m->error > 2 * noise(w);
    if (!rejected && !beyond_noise) return false;
    snprintf(text, size, "%s, which a scene can load, does not describe these data: it is %.3g %% off on average",
             m->expression, 100 * m->error);
    const size_t n = strlen(text);
    if (m != best && m->error > 1.1 * best->error)
        snprintf(text + n, size - n, ", %s %.3g %%", best->expression, 100 * best->error);
    return true;
}

static bool is_absurd(const kn_identification *w)
{
    return w->sweep.material >= 0 && w->sweep.row[w->sweep.material].error > ABSURD;
}

static bool is_served(const kn_identification *w, char *why, size_t size)
{
    return w->sweep.material < 0 || kn_material_served(&w->sweep.row[w->sweep.material].material, why, size);
}

// ---- printed results

static void numbers_of(const kn_sweep_fit_row *row, char *text, size_t size)
{
    *text = '\0';
    for (int i = 0; i < row->parts; i++) {
        char one[120];
        const size_t n = strlen(text);
        kn_parameter_estimate_text(&row->number[i], one, sizeof one);
        snprintf(text + n, size - n, "%s%s %s", i ? ", " : "", row->number[i].name, one);
    }
}

// State which element the data support, which others are as well supported, and the nearest material of a scene.
static void verdict(const kn_sweep_fit *s, char *text, size_t size)
{
    const kn_sweep_fit_row *best = &s->row[s->best];
    snprintf(text, size, "the data support %s (%s), mean error %.3g %%", best->expression, best->letters,
             100 * best->error);
    for (int i = 0; i < s->rows; i++) {
        const size_t n = strlen(text);
        if (i != s->best && s->row[i].fitted && s->row[i].aicc < best->aicc + KN_SWEEP_FIT_NEAR)
            snprintf(text + n, size - n, "; equally %s (%s)", s->row[i].expression, s->row[i].letters);
    }
    size_t n = strlen(text);
    if (best->runs > 3 && best->error > 5e-4)
        snprintf(text + n, size - n,
                 "; but the residuals have runs of one sign: the model has another shape than the data, and the "
                 "intervals are too narrow");
    n = strlen(text);
    if (s->material >= 0 && s->material != s->best)
        snprintf(text + n, size - n,
                 "; a scene cannot have this element; the nearest one that it can have is %s, mean error %.3g %%",
                 s->row[s->material].expression, 100 * s->row[s->material].error);
}

static void print(kn_identification *w)
{
    const kn_sweep_fit *s = &w->sweep;
    char text[700], why[300], runs[16];
    printf("\n%-16s %-9s %2s %8s %9s %6s  %s\n", "element", "figure 2", "n", "misfit %", "AICc", "runs",
           "parameters with 95 % intervals");
    for (int i = 0; i < s->rows; i++) {
        const kn_sweep_fit_row *r = &s->row[i];
        numbers_of(r, text, sizeof text);
        printf("%-16s %-9s %2d %8.3g %9.1f %6s  %s\n", r->expression, r->letters, r->parts, 100 * r->error,
               r->aicc - s->row[s->best].aicc, kn_identify_runs(r->runs, runs), text);
    }
    printf("misfit: mean of |model/measured - 1| of both moduli. AICc: difference from the chosen element. runs: "
           "number of sign\n"
           "runs of the residuals, in standard deviations below that of noise; above 3 the model has another shape "
           "than the data\n");
    verdict(s, text, sizeof text);
    printf("verdict     %s.\n", text);
    if (doubt(w, text, sizeof text)) kn_identify_note(w, "%s", text);
    if (!is_served(w, why, sizeof why)) kn_identify_note(w, "no scene accepts this material: %s", why);
    if (s->material >= 0 && s->row[s->material].material.damper != KN_DAMPER_NONE) kn_identify_note(w, "%s", at_rest);
}

// Write all elements to --json.
static void tell_json(const kn_sweep_fit *s)
{
    char text[700];
    if (!kn_result()) return;
    for (int i = 0; i < s->rows; i++) {
        const kn_sweep_fit_row *r = &s->row[i];
        json_t *to = kn_result_add("elements"), *numbers = json_object();
        kn_result_text(to, "expression", r->expression);
        kn_result_text(to, "letters", r->letters);
        if (r->name) kn_result_text(to, "name", r->name);
        kn_result_number(to, "misfit", r->error);
        kn_result_number(to, "aicc", r->aicc);
        kn_result_number(to, "runs", r->runs);
        for (int k = 0; r->fitted && k < r->parts; k++) kn_parameter_estimate_tell(numbers, &r->number[k]);
        json_object_set_new(to, "numbers", numbers);
    }
    verdict(s, text, sizeof text);
    kn_result_text(kn_result(), "best", s->row[s->best].expression);
    if (s->material >= 0) kn_result_text(kn_result(), "material", s->row[s->material].expression);
    kn_result_text(kn_result(), "verdict", text);
}

// ---- files

static bool csv_rows(const kn_identification *w, FILE *f)
{
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        for (int i = 0; i < c->count; i++) {
            double storage, loss;
            kn_sweep_fit_modulus(&w->sweep.row[w->sweep.best], c->time_s[i], &storage, &loss);
            kn_table_text(c->name, f);
            fprintf(f, ",%.9g,%.9g,%.9g,%.9g,%.9g\n", c->time_s[i], w->modulus_scale * c->value[i],
                    w->modulus_scale * c->other[i], storage, loss);
        }
    }
    return true;
}

// Write the material. An element with a misfit above ABSURD is refused.
static int write_material(const kn_identification *w, const char *path)
{
    const kn_sweep_fit_row *row = &w->sweep.row[w->sweep.material];
    char origin[1200], source[KN_SOURCE_MAX], doubts[400];
    if (is_absurd(w))
        return kn_complain(w->opt.subcommand, KN_EXIT_FAILED,
                           "--out %s: not written, %s is %.3g %% off on average: no element that a scene can load "
                           "describes these data",
                           path, row->expression, 100 * row->error);
    snprintf(origin, sizeof origin, "sweep from %s: %s at %d frequencies, mean error %.3g %%%s.\n# %s.",
             kn_material_source(w->opt.file[0], w->opt.files, source), row->expression, w->sweep.readings,
             100 * row->error, w->modulus_scale > 1 ? ", moduli of shear times 3" : "",
             row->material.damper == KN_DAMPER_NONE ? "It has no damper in series, so no deformation remains"
                                                    : at_rest);
    const size_t n = strlen(origin);
    if (doubt(w, doubts, sizeof doubts)) snprintf(origin + n, sizeof origin - n, "\n# Beware: %s.", doubts);
    return kn_material_file_write(w->opt.subcommand, path, origin, &row->material, w->opt.density_kg_m3, row->parts,
                                  row->number);
}

typedef struct drawing { // moduli of two elements
    double hz[KN_IDENTIFY_POINTS], storage[2][KN_IDENTIFY_POINTS], loss[2][KN_IDENTIFY_POINTS];
} drawing;

// Add the moduli of one element as lines: the chosen one solid, the other one dashed.
static void add_row(kn_figure_panel *p, drawing *d, const kn_sweep_fit_row *row, int k)
{
    for (int i = 0; i < KN_IDENTIFY_POINTS; i++) kn_sweep_fit_modulus(row, d->hz[i], &d->storage[k][i], &d->loss[k][i]);
    const kn_figure_look look = k ? KN_FIGURE_DASHES : KN_FIGURE_LINE;
    kn_identify_plot(p, row->expression, KN_IDENTIFY_POINTS, d->hz, d->storage[k], 1, look, k ? 8 : 0);
    kn_identify_plot(p, NULL, KN_IDENTIFY_POINTS, d->hz, d->loss[k], 1, look, k ? 8 : 0);
}

// Add a curve's moduli, and the residuals of the chosen element.
static void add_curve(const kn_identification *w, kn_figure_panel p[2], const kn_curve *c, double *left, bool named)
{
    double *other = left + w->sweep.readings;
    for (int i = 0; i < c->count; i++) {
        double storage, loss;
        kn_sweep_fit_modulus(&w->sweep.row[w->sweep.best], c->time_s[i], &storage, &loss);
        left[i] = 100 * (w->modulus_scale * c->value[i] / storage - 1);
        other[i] = 100 * (w->modulus_scale * c->other[i] / loss - 1);
    }
    const char *g[2] = {named ? "G'" : NULL, named ? "G''" : NULL};
    kn_identify_plot(&p[0], g[0], c->count, c->time_s, c->value, w->modulus_scale, KN_FIGURE_POINTS, 1);
    kn_identify_plot(&p[0], g[1], c->count, c->time_s, c->other, w->modulus_scale, KN_FIGURE_POINTS, 2);
    kn_identify_plot(&p[1], g[0], c->count, c->time_s, left, 1, KN_FIGURE_POINTS, 1);
    kn_identify_plot(&p[1], g[1], c->count, c->time_s, other, 1, KN_FIGURE_POINTS, 2);
}

static int draw(kn_identification *w, const char *path)
{
    static drawing d; // too large for the stack, as are the panels
    static kn_figure_panel p[2];
    const kn_sweep_fit *s = &w->sweep;
    double low = INFINITY, high = 0;
    // residuals of storage, then of loss, of all curves
    double *left = calloc(2 * (size_t)s->readings + 1, sizeof *left);
    if (!left) return kn_complain(w->opt.subcommand, KN_EXIT_DEVICE, "out of memory");
    p[0] = (kn_figure_panel){
        .title = "moduli", .x_label = "frequency, Hz", .y_label = "modulus, Pa", .log_x = true, .log_y = true};
    p[1] = (kn_figure_panel){
        .title = "residuals", .x_label = "frequency, Hz", .y_label = "measured/fit - 1, %", .log_x = true};
    for (int c = 0, n = 0; c < w->curves; n += w->curve[c++].count) {
        add_curve(w, p, &w->curve[c], left + n, c == 0);
        low = fmin(low, w->curve[c].time_s[0]);
        high = fmax(high, w->curve[c].time_s[w->curve[c].count - 1]);
    }
    kn_identify_points(low, high, d.hz);
    add_row(&p[0], &d, &s->row[s->best], 0);
    // Draw the nearest material of a scene, too, if it is another element.
    if (s->material >= 0 && s->material != s->best) add_row(&p[0], &d, &s->row[s->material], 1);
    int code = kn_figure_draw(w->opt.subcommand, path, "storage and loss modulus", p, 2, 2);
    free(left);
    return code;
}

// Write the page: verdict, elements, notes, plot and files.
static int report(kn_identification *w, kn_document *d)
{
    char path[PATH_MAX], text[700], why[300], runs[16];
    const kn_sweep_fit *s = &w->sweep;
    kn_document_section(d, "Elements that these data support");
    verdict(s, text, sizeof text);
    kn_document_text(d, "%d frequencies: %s.", s->readings, text);
    kn_document_table(d, "Elements", "llrrrl",
                      "element\tfigure 2\tmisfit, %\tAICc above the chosen one\truns\tparameters with 95 % intervals");
    for (int i = 0; i < s->rows; i++) {
        const kn_sweep_fit_row *r = &s->row[i];
        numbers_of(r, text, sizeof text);
        kn_document_row(d, "%s\t%s\t%.3g\t%.1f\t%s\t%s", r->expression, r->letters, 100 * r->error,
                        r->aicc - s->row[s->best].aicc, kn_identify_runs(r->runs, runs), text);
    }
    const bool served = is_served(w, why, sizeof why);
    if (doubt(w, text, sizeof text)) kn_document_verdict(d, KN_DOCUMENT_BEWARE, "%s", text);
    if (!served) kn_document_verdict(d, KN_DOCUMENT_BEWARE, "No scene accepts this material: %s", why);
    kn_document_verdict(d, KN_DOCUMENT_BEWARE, "%s", at_rest);
    int code = draw(w, kn_document_file(d, "fit.png", path));
    if (code != KN_EXIT_OK) return code;
    kn_document_picture(d, "fit.png", "Storage and loss modulus over frequency, the fit, and the residuals",
                        "Points: measured. Lines: the element with the most support.");
    return kn_identify_page_files(w, d, "moduli.csv", "moduli and fit", s->material >= 0 && served && !is_absurd(w));
}

// ---- the other steps of the experiment

static int fit(kn_identification *w)
{
    w->modulus_scale = w->opt.shear ? 3 : 1;
    if (kn_sweep_fit_run(&w->sweep, w->curves, w->curve, w->modulus_scale, 0.95)) return KN_EXIT_OK;
    return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                       "%s: no element fits; expected storage and loss moduli at 4 frequencies or more",
                       w->opt.file[0]);
}

static void tell(kn_identification *w)
{
    print(w);
    tell_json(&w->sweep);
}

const kn_identify_experiment kn_identify_sweep = {
    .subcommand = "identify sweep",
    .title = "Frequency sweep",
    .help = help,
    .letter = 's',
    .kind = KN_CURVE_SWEEP,
    .fit = fit,
    .tell = tell,
    .csv_head = "curve,frequency_hz,storage_pa,loss_pa,fit_storage_pa,fit_loss_pa",
    .csv_rows = csv_rows,
    .draw = draw,
    .report = report,
    .write_material = write_material};
