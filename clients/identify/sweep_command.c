// The command `knead identify sweep`: find springs and dampers from storage and loss modulus over frequency.
#include "clients/identify/identify.h"
#include "clients/identify/constitutive_models.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/result.h"
#include "clients/cli/curve_table.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead identify sweep FILE... [OPTION]...\n\n"
    "Fit springs and dampers to the storage modulus G' and the loss modulus G'' over frequency. All elements of the\n"
    "first paper's figure 2 that a sweep can tell apart are fitted. The output names the element that the data\n"
    "support. A sweep of small amplitude shows a stress-dependent damper only at rest: it gives c2, but not beta, P0\n"
    "and P1. To find these, use knead identify creep or relax.\n\n"
    "A file is a table with a name and a unit above each column: the frequency in Hz or rad/s, and the moduli. The\n"
    "moduli are G' and G'', or |G*| with tan delta or the phase angle. All files must be of one material.\n\n"
    "the readings:\n"
    "  --units NAME=UNIT,...  units of columns that have none, e.g. omega=rad/s,storage=Pa\n"
    KN_IDENTIFY_COLUMN_HELP
    KN_IDENTIFY_SHEAR_HELP
    "\n"
    "results:\n"
    "  --out FILE             the material, for `material: FILE` in a scene, with an interval for every parameter.\n"
    "                         The element is the best supported one that a scene can have: s|d, s-d or (s|d)-d.\n"
    "                         Nothing is written if this element is off by more than 30 % on average\n"
    "  --density D            density of the material, written to the file (default: 1.2 g/cm^3, with a remark)\n"
    "  --report DIR           folder for a page, DIR/index.html, with all results, the plot, the moduli and the\n"
    "                         material\n"
    "  --png FILE             plot of moduli, fit and residuals (needs gnuplot)\n"
    "  --csv FILE             table of moduli and fit\n"
    "  --json                 print the results as JSON\n\n"
    "Examples:\n"
    "    knead sweep dough --frequency 0.001:10 --csv sweep.csv\n"
    "    knead identify sweep sweep.csv --out mine.yaml --png fit.png\n\n"
    "Exit codes: 0 ok, 1 the fit cannot be used in a scene, 2 bad input, 3 a file cannot be written.\n";
// clang-format on

static const char at_rest[] = "a sweep of small amplitude shows c2 = c_max at rest, not how c2 falls with the stress: "
                              "beta, P0 and P1 need creep or relax";

// ---- the fit of springs and dampers

enum { STARTS = 16 };
#define NONE 1e10 // a spring or damper that is stiffer or softer than all measured moduli by this factor has no effect
// relative accuracy of the best rheometer; a smaller misfit comes from rounding and must not decide between elements
#define EXACT 1e-4

typedef struct work {
    const kn_curve *curve;
    int curves, readings;
    const kn_element *element;
} work;

static void modulus(const kn_element *e, const double *moduli, double hz, double *storage, double *loss)
{
    kn_oneport_modulus(e, e->root, moduli, 2 * acos(-1.0) * hz, storage, loss);
}

// Compute storage and loss modulus of a row's fitted element at one frequency.
static void row_modulus(const kn_sweep_fit_row *row, double frequency_hz, double *storage_pa, double *loss_pa)
{
    double moduli[KN_ELEMENT_MAX];
    for (int i = 0; i < row->net.element.leaves; i++) moduli[i] = row->net.part[i].modulus;
    modulus(&row->net.element, moduli, frequency_hz, storage_pa, loss_pa);
}

// Compute the residuals: differences of ln G' at all frequencies, followed by differences of ln G''.
static bool misfit(void *of, const double value[KN_FIT_UNKNOWNS], double *residual)
{
    const work *w = of;
    for (int c = 0, n = 0; c < w->curves; c++)
        for (int i = 0; i < w->curve[c].count; i++, n++) {
            double storage, loss;
            modulus(w->element, value, w->curve[c].time_s[i], &storage, &loss);
            if (!(storage > 0 && loss > 0)) return false;
            residual[n] = log(storage / w->curve[c].value[i]);
            residual[w->readings + n] = log(loss / w->curve[c].other[i]);
        }
    return true;
}

// Add one row for each class of elements in the catalogue. The Voigt form represents the class.
static void add_classes(kn_sweep_fit *s)
{
    kn_element_class class[KN_CATALOGUE];
    s->rows = kn_element_classes(class, false);
    for (int i = 0; i < s->rows; i++) {
        kn_sweep_fit_row *row = &s->row[i];
        char error[64];
        memcpy(row->expression, class[i].name, sizeof row->expression);
        memcpy(row->letters, class[i].letters, sizeof row->letters);
        row->name = kn_oneport_name(&class[i].oneport);
        // parsing cannot fail, since the Voigt form is an expression
        kn_element_parse(&row->net.element, row->expression, error, sizeof error);
        row->parts = row->net.element.leaves;
        row->aicc = INFINITY;
    }
}

// ---- fitting one element

// Return a pseudo-random number in 0..1. Every run gets the same sequence.
static double random_share(unsigned *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (*seed >> 8) / 16777216.0;
}

static bool is_spring(const kn_element *e, int leaf)
{
    for (int i = 0; i < e->nodes; i++)
        if (e->node[i].leaf == leaf && e->node[i].kind == KN_ELEMENT_SPRING) return true;
    return false;
}

// Choose a random start. Each spring gets one of the measured moduli. Each damper gets a measured modulus divided by
// its angular frequency.
static void place(const work *w, unsigned *seed, double start[KN_FIT_UNKNOWNS])
{
    for (int leaf = 0; leaf < w->element->leaves; leaf++) {
        const kn_curve *c = &w->curve[(int)(random_share(seed) * w->curves)];
        const int i = (int)(random_share(seed) * c->count);
        const double size = (random_share(seed) < 0.5 ? c->value[i] : c->other[i]);
        start[leaf] = is_spring(w->element, leaf) ? size : size / (2 * acos(-1.0) * c->time_s[i]);
    }
}

// Set the bounds of every part (spring or damper) far beyond the measured moduli and frequencies.
static void bounds(const work *w, kn_fit *fit)
{
    double least = INFINITY, most = 0, slow = INFINITY, fast = 0;
    for (int c = 0; c < w->curves; c++)
        for (int i = 0; i < w->curve[c].count; i++) {
            least = fmin(least, fmin(w->curve[c].value[i], w->curve[c].other[i]));
            most = fmax(most, fmax(w->curve[c].value[i], w->curve[c].other[i]));
            slow = fmin(slow, 2 * acos(-1.0) * w->curve[c].time_s[i]);
            fast = fmax(fast, 2 * acos(-1.0) * w->curve[c].time_s[i]);
        }
    for (int leaf = 0; leaf < fit->unknowns; leaf++) {
        const bool spring = is_spring(w->element, leaf);
        fit->unknown[leaf] = (kn_fit_unknown){.low = (spring ? least : least / fast) / NONE,
                                              .high = (spring ? most : most / slow) * NONE};
    }
}

// State of a search that places the fitted parts of a smaller element within a larger element. Each part of the smaller
// element takes the place of a part of its kind. The remaining parts are put at a bound where they have no effect. The
// placement with the least sum of squares is kept. If the larger element contains the smaller one, this sum equals that
// of the smaller element.
typedef struct nesting {
    kn_fit *fit; // fit of the larger element
    const kn_element *element;
    const kn_sweep_fit_row *within;
    double at[KN_FIT_UNKNOWNS], *best, least;
} nesting;

// Try all placements by recursion over the leaves (springs and dampers) of the larger element.
static void nest(nesting *n, int leaf, unsigned placed)
{
    const kn_element *small = &n->within->net.element;
    if (leaf == n->element->leaves) {
        const double sum = placed + 1 == 1u << small->leaves ? kn_fit_sum(n->fit, n->at) : (double)NAN;
        if (!(sum < n->least)) return;
        n->least = sum;
        memcpy(n->best, n->at, sizeof n->at);
        return;
    }
    for (int i = 0; i < small->leaves; i++) {
        if (placed & 1u << i || is_spring(small, i) != is_spring(n->element, leaf)) continue;
        n->at[leaf] = n->within->net.part[i].modulus;
        nest(n, leaf + 1, placed | 1u << i);
    }
    for (int high = 0; high < 2; high++) {
        n->at[leaf] = high ? n->fit->unknown[leaf].high : n->fit->unknown[leaf].low;
        nest(n, leaf + 1, placed);
    }
}

// Add starts from the fitted elements with fewer parts. If this element contains such an element, the fit cannot end
// with a larger sum of squares than the fit of the contained element.
static int start_within(kn_fit *fit, const kn_element *element, const kn_sweep_fit *found,
                        double start[][KN_FIT_UNKNOWNS])
{
    int count = 0;
    for (int i = 0; i < found->rows; i++) {
        const kn_sweep_fit_row *row = &found->row[i];
        if (!row->fitted || row->parts >= element->leaves) continue;
        nesting n = {.fit = fit, .element = element, .within = row, .best = start[count], .least = INFINITY};
        nest(&n, 0, 0);
        count += isfinite(n.least);
    }
    return count;
}

// Write the name of a part: k1, c1 or c2 if a scene can have the element, otherwise s1, d1, ...
static void call(const kn_sweep_fit_row *row, int leaf, char name[8])
{
    const double m = row->net.part[leaf].modulus;
    const bool spring = is_spring(&row->net.element, leaf);
    kn_element_leaf_name(&row->net.element, leaf, name);
    if (row->is_material)
        snprintf(name, 8, "%s", spring ? "k1" : row->material.damper && m == row->material.c2_pa_s ? "c2" : "c1");
}

// Fill a row from its finished fit: parts, material, AICc, runs, misfit and intervals.
static void judge(kn_sweep_fit_row *row, kn_fit *fit, double confidence)
{
    static const char *const names[] = {"k1", "c1", "c2", "s1", "s2", "s3", "s4", "d1", "d2", "d3", "d4"};
    double value[KN_FIT_UNKNOWNS], *residual = calloc((size_t)fit->readings, sizeof *residual);
    kn_fit_values(fit, value);
    for (int i = 0; i < fit->unknowns; i++) row->net.part[i].modulus = value[i];
    row->is_material = kn_network_material(&row->net, &row->material);
    row->aicc = kn_fit_aicc(fit->readings, fit->unknowns, fit->sum + fit->readings * EXACT * EXACT);
    row->runs = NAN;
    if (residual && fit->misfit(fit->of, value, residual)) {
        row->runs = kn_fit_runs(fit->readings, residual);
        for (int i = 0; i < fit->readings; i++) row->error += fabs(expm1(residual[i])) / fit->readings;
    }
    free(residual);
    for (int i = 0; i < fit->unknowns; i++) {
        char name[8];
        call(row, i, name);
        size_t n = 0;
        while (n + 1 < sizeof names / sizeof *names && strcmp(names[n], name) != 0) n++;
        kn_parameter_estimate_set(&row->number[i], names[n], is_spring(&row->net.element, i) ? "Pa" : "Pa*s", value[i],
                                  kn_fit_interval_of(fit, i, confidence));
    }
}

// Fit one element from random starts and from the smaller elements that have been fitted.
static void fit_row(const work *all, const kn_sweep_fit *found, kn_sweep_fit_row *row, double confidence)
{
    work w = *all;
    unsigned seed = 1;
    double start[STARTS + KN_SWEEP_FIT_ROWS][KN_FIT_UNKNOWNS];
    w.element = &row->net.element;
    kn_fit fit = {.readings = 2 * w.readings, .unknowns = row->parts, .misfit = misfit, .of = &w};
    bounds(&w, &fit);
    for (int s = 0; s < STARTS; s++) place(&w, &seed, start[s]);
    if (row->parts > KN_SWEEP_FIT_PARTS || fit.readings <= fit.unknowns + 2) return;
    const int starts = STARTS + start_within(&fit, w.element, found, start + STARTS);
    row->fitted = kn_fit_run_from(&fit, starts, start);
    if (row->fitted) judge(row, &fit, confidence);
}

// Choose the row with the fewest parts among those within KN_SWEEP_FIT_NEAR of the least AICc. If `material` is true,
// consider only elements that a scene can have.
static int choose(const kn_sweep_fit *s, bool material)
{
    double least = INFINITY;
    int best = -1;
    for (int i = 0; i < s->rows; i++)
        if (s->row[i].fitted && (s->row[i].is_material || !material)) least = fmin(least, s->row[i].aicc);
    for (int i = 0; i < s->rows; i++) {
        const kn_sweep_fit_row *row = &s->row[i];
        if (!row->fitted || (material && !row->is_material) || row->aicc > least + KN_SWEEP_FIT_NEAR) continue;
        const bool fewer = best < 0 || row->parts < s->row[best].parts;
        if (fewer || (row->parts == s->row[best].parts && row->aicc < s->row[best].aicc)) best = i;
    }
    return best;
}

// Run the fit. `confidence` is the confidence of the intervals, such as 0.95. Return false if memory runs out, or if no
// element could be fitted.
static bool run_fit(kn_sweep_fit *s, int curves, const kn_curve *curve, double confidence)
{
    *s = (kn_sweep_fit){0};
    for (int c = 0; c < curves; c++) s->readings += curve[c].count;
    const work w = {.curve = curve, .curves = curves, .readings = s->readings};
    add_classes(s);
    // fit smaller elements first, since larger elements start from them
    for (int parts = 1; parts <= KN_SWEEP_FIT_PARTS; parts++)
        for (int i = 0; i < s->rows; i++)
            if (s->row[i].parts == parts) fit_row(&w, s, &s->row[i], confidence);
    s->best = choose(s, false);
    s->material = choose(s, true);
    return s->best >= 0;
}

// ---- notes on doubtful results

#define FAR 0.05    // misfit above which noise must explain it, as in relax
#define ABSURD 0.30 // a material whose relative misfit exceeds this limit does not describe the data and is not written
#define FLOOR 1e-3  // a relative misfit below this limit cannot be felt, so it does not lead to a note

static double noise(const kn_identification *w)
{
    double most = 0;
    for (int c = 0; c < w->curves; c++) most = fmax(most, w->curve[c].noise);
    return most;
}

// Return whether the best element that a scene can load fails to describe the data. If it fails, write one sentence on
// its misfit. For normal noise the mean of |x| is 0.8 standard deviations, so a misfit of twice the noise is more than
// noise.
static bool doubt(const kn_identification *w, char *text, size_t size)
{
    const kn_sweep_fit *s = &w->sweep;
    if (s->material < 0) return false;
    const kn_sweep_fit_row *m = &s->row[s->material], *best = &s->row[s->best];
    // The element fails if another element is much better supported, or if its misfit exceeds the noise.
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

// ---- printed results of sweep

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
                 "; but the residuals have long runs of one sign: "
                 "the model's curve does not have the shape of the data, and the intervals are too narrow");
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
    printf("misfit: mean of |model/measured - 1| of both moduli. AICc: difference from the chosen element.\n"
           "runs: standard deviations by which the residuals have fewer runs of one sign than noise has;\n"
           "above 3, the model's curve does not have the shape of the data\n");
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

// ---- files: table, material, plot and page

static bool csv_rows(const kn_identification *w, FILE *f)
{
    for (int k = 0; k < w->curves; k++) {
        const kn_curve *c = &w->curve[k];
        for (int i = 0; i < c->count; i++) {
            double storage, loss;
            row_modulus(&w->sweep.row[w->sweep.best], c->time_s[i], &storage, &loss);
            kn_table_text(c->name, f);
            fprintf(f, ",%.9g,%.9g,%.9g,%.9g,%.9g\n", c->time_s[i], c->value[i], c->other[i], storage, loss);
        }
    }
    return true;
}

// Write the material. An element with a misfit above ABSURD (30 %) is refused.
static int write_material(const kn_identification *w, const char *path)
{
    const kn_sweep_fit_row *row = &w->sweep.row[w->sweep.material];
    char origin[1200], source[KN_SOURCE_MAX], doubts[400];
    if (is_absurd(w))
        return kn_complain(w->opt.subcommand, KN_EXIT_FAILED,
                           "--out %s: not written, %s is %.3g %% off on average: "
                           "no element that a scene can load describes these data",
                           path, row->expression, 100 * row->error);
    snprintf(origin, sizeof origin, "sweep from %s: %s at %d frequencies, mean error %.3g %%.\n# %s.",
             kn_identify_source(w, source), row->expression, w->sweep.readings, 100 * row->error,
             row->material.damper == KN_DAMPER_NONE ? "This element has no damper in series, so no deformation remains"
                                                    : at_rest);
    const size_t n = strlen(origin);
    if (doubt(w, doubts, sizeof doubts)) snprintf(origin + n, sizeof origin - n, "\n# Beware: %s.", doubts);
    return kn_material_file_write(w->opt.subcommand, path, origin, NULL, &row->material, w->opt.density_kg_m3,
                                  row->parts, row->number);
}

typedef struct drawing { // moduli of two elements over frequency
    double hz[KN_IDENTIFY_POINTS], storage[2][KN_IDENTIFY_POINTS], loss[2][KN_IDENTIFY_POINTS];
} drawing;

// Add the moduli of one element as lines: solid for the chosen element, dashed for the other one.
static void add_row(kn_figure_panel *p, drawing *d, const kn_sweep_fit_row *row, int k)
{
    for (int i = 0; i < KN_IDENTIFY_POINTS; i++) row_modulus(row, d->hz[i], &d->storage[k][i], &d->loss[k][i]);
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
        row_modulus(&w->sweep.row[w->sweep.best], c->time_s[i], &storage, &loss);
        left[i] = 100 * (c->value[i] / storage - 1);
        other[i] = 100 * (c->other[i] / loss - 1);
    }
    const char *g[2] = {named ? "G'" : NULL, named ? "G''" : NULL};
    kn_identify_plot(&p[0], g[0], c->count, c->time_s, c->value, 1, KN_FIGURE_POINTS, 1);
    kn_identify_plot(&p[0], g[1], c->count, c->time_s, c->other, 1, KN_FIGURE_POINTS, 2);
    kn_identify_plot(&p[1], g[0], c->count, c->time_s, left, 1, KN_FIGURE_POINTS, 1);
    kn_identify_plot(&p[1], g[1], c->count, c->time_s, other, 1, KN_FIGURE_POINTS, 2);
}

static int draw(kn_identification *w, const char *path)
{
    // the drawing and its panels are too large for the stack
    static drawing d;
    static kn_figure_panel p[2];
    const kn_sweep_fit *s = &w->sweep;
    double low = INFINITY, high = 0;
    // residuals of the storage modulus of all curves, followed by residuals of the loss modulus
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
    // If the nearest element that a scene can have is not the chosen element, draw its moduli, too.
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

// ---- the other steps of the experiment sweep

static int fit(kn_identification *w)
{
    if (run_fit(&w->sweep, w->curves, w->curve, 0.95)) return KN_EXIT_OK;
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
