// The command `knead identify relax`: find the parameters of the papers' element from a stress that fell while a strain
// was held.
#include "clients/identify/experiments.h"
#include "clients/identify/relax_told.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/output.h"
#include "clients/knead/plot.h"
#include "clients/knead/result.h"
#include "clients/knead/table.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: knead identify relax FILE... [OPTION]...\n\n"
    "Fit the material of a virtual object to stress relaxation: how the stress fell while a specimen was held "
    "compressed.\n"
    "The result is k1 and c1, which restore the shape, and the damper alpha exp(-beta P) between P0 and P1, which "
    "relaxes\n"
    "the stress.\n\n"
    "    knead identify relax ramp.csv --height 1cm --area 1cm^2 --out dough.yaml\n"
    "    knead identify relax modulus.csv --strain 5% --png fit.png\n\n"
    "A file is a table with a name and a unit above each column: time; stress, load or modulus; and strain, "
    "displacement or\n"
    "height if they were recorded. Lines before the table may give values that hold for the whole file:\n"
    "    # strain: 10 %       # height: 1 cm       # area: 1 cm^2       # begin: 1.5 s\n"
    "    time (s); load (gf)\n"
    "If the file contains the rise to the strain, rise and hold are fitted together and determine all parameters; a "
    "slow\n"
    "rise, about 2 %/s, is best. A hold alone determines c1/k1, alpha/k1 and beta, and a lower bound of k1, which is "
    "exact\n"
    "if nothing had flowed by the first reading. A modulus without --strain gives no material.\n\n"
    "  --strain S             held strain, for files that do not state it, e.g. 10% or 0.1\n"
    "  --height H, --area S   initial height and area of the specimen\n"
    "  --units NAME=UNIT,...  units of columns that have none, e.g. time=s,modulus=Pa\n"
    "  --constant-area        stress is load/S0 (default: the section grows as the height falls, S h = S0 h0)\n"
    "  --noise relative       weight residuals relative to the stress, over readings averaged in 20 bins per decade "
    "of\n"
    "                         time, so that each decade counts the same (default)\n"
    "  --noise constant       weight residuals in Pa, each reading the same: for noise of the "
    "instrument\n" KN_IDENTIFY_OUTPUT_HELP
    "\nThe output gives the best parameters with 95 % intervals. The intervals are valid if the model is right and the "
    "noise\n"
    "is independent; the output tells if that is so, and which parameters these curves cannot determine. It also "
    "compares\n"
    "other models, which are fitted to the early part and tested on the later one.\n"
    "Exit codes: 0 ok, 1 the fit cannot be used in a scene, 2 bad input, 3 a file cannot be written.\n";

typedef struct work {
    kn_identify_options opt;
    kn_curve curve[KN_CURVES_MAX];
    int curves;
    kn_relaxation_fit fit;
    kn_model_comparison models;
    bool compared;
} work;

// ---- printed results

static void print_number(const kn_parameter_estimate *n)
{
    char text[120];
    kn_parameter_estimate_text(n, text, sizeof text);
    printf("%-9s %s\n", n->name, text);
    if (*n->words) printf("          %s\n", n->words);
}

// Print the parameters that this experiment determines: in Pa after a rise, else the ratios to k1.
static void print_numbers(const kn_relaxation_fit *r)
{
    printf("\n%-9s best value and 95 %% interval\n", "");
    if (r->scale != KN_RELAXATION_MODULUS) {
        print_number(&r->number[KN_ESTIMATE_K1]);
        if (r->scale == KN_RELAXATION_RISE)
            for (int i = KN_ESTIMATE_C1; i <= KN_ESTIMATE_ALPHA; i++) print_number(&r->number[i]);
    }
    if (r->scale != KN_RELAXATION_RISE)
        for (int i = 0; i < 2; i++) print_number(&r->ratio[i]);
    for (int i = KN_ESTIMATE_BETA; i < KN_ESTIMATE_NUMBERS; i++) print_number(&r->number[i]);
    printf("%s\n", kn_relax_scale(r));
}

static void print_curves(const kn_relaxation_fit *r)
{
    printf("\n%-20s %9s %9s %9s %9s %9s %6s\n", "curve", "strain %", "readings", "rise", "hold", "misfit %", "runs");
    for (int c = 0; c < r->curves; c++) {
        const kn_relaxation_curve *k = &r->curve[c];
        char strain[20] = "-", runs[20] = "-";
        if (k->ramp.strain > 0) snprintf(strain, sizeof strain, "%.4g", 100 * k->ramp.strain);
        if (!isnan(k->runs)) snprintf(runs, sizeof runs, "%.2g", k->runs);
        printf("%-20s %9s %9d %9d %9d %9.2g %6s\n", k->curve->name, strain, k->curve->count, k->rise.count,
               k->hold.count, 100 * k->misfit, runs);
    }
    printf("rise, hold: number of fitted means. misfit: mean of |fit/measured - 1|. runs: number of sign runs, in "
           "standard\n"
           "deviations below that of noise; above 3 the model has another shape than the data\n");
}

static void doubt(void *to, const char *words)
{
    (void)to;
    printf("note: %s\n", words);
    kn_result_text(kn_result_add("notes"), "words", words);
}

static void tell(const kn_relaxation_fit *r)
{
    static const char *const scale[] = {"rise", "bound", "modulus"};
    json_t *to = kn_result(), *numbers = to ? json_object() : NULL;
    if (!to) return;
    json_object_set_new(to, "numbers", numbers);
    for (int i = 0; i < KN_ESTIMATE_NUMBERS; i++) kn_parameter_estimate_tell(numbers, &r->number[i]);
    if (r->scale != KN_RELAXATION_RISE)
        for (int i = 0; i < 2; i++) kn_parameter_estimate_tell(numbers, &r->ratio[i]);
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

// ---- files

// Write the fitted means of all curves with the fit.
static int write_csv(const kn_relax_told *told, const char *path)
{
    FILE *f = fopen(path, "w");
    if (!f) return kn_complain(told->opt->subcommand, KN_EXIT_DEVICE, "%s: %s", path, strerror(errno));
    fprintf(f, "curve,held_s,stress_pa,fit_pa,readings\n");
    for (int c = 0; c < told->fit->curves; c++) {
        const kn_relaxation_curve *k = &told->fit->curve[c];
        for (int i = 0; i < k->rise.count + k->hold.count; i++) {
            const kn_time_bins *b = i < k->rise.count ? &k->rise : &k->hold;
            const int n = i < k->rise.count ? i : i - k->rise.count;
            kn_table_text(k->curve->name, f);
            fprintf(f, ",%.9g,%.9g,%.9g,%.9g\n", b->time_s[n], b->value[n], k->fit_pa[i], b->weight[n]);
        }
    }
    const bool ok = !ferror(f);
    if (fclose(f) == 0 && ok) return KN_EXIT_OK;
    return kn_complain(told->opt->subcommand, KN_EXIT_DEVICE, "%s: cannot be written", path);
}

static int write_material(const kn_relax_told *told, const char *path)
{
    const kn_relaxation_fit *r = told->fit;
    char origin[800], source[KN_SOURCE_MAX];
    snprintf(origin, sizeof origin, "relax from %s: %d curve%s, stresses %.4g to %.4g Pa.\n# %s",
             kn_material_source(told->opt->file[0], told->opt->files, source), r->curves, r->curves > 1 ? "s" : "",
             r->lowest_pa, r->highest_pa, kn_relax_scale(r));
    return kn_material_file_write(told->opt->subcommand, path, origin, &r->material, told->opt->density_kg_m3,
                                  KN_ESTIMATE_NUMBERS, r->number);
}

// ---- the command

// Check that all outputs can be written before the work begins.
static int try_outputs(const kn_identify_options *opt)
{
    int code = opt->png ? kn_plot_try(opt->subcommand, opt->png) : KN_EXIT_OK;
    if (code == KN_EXIT_OK && opt->csv) code = kn_output_try(opt->subcommand, opt->csv);
    if (code == KN_EXIT_OK && opt->out) code = kn_material_file_try(opt->subcommand, opt->out);
    return code;
}

static int load(work *w)
{
    int code = KN_EXIT_OK;
    for (int i = 0; i < w->opt.files && code == KN_EXIT_OK; i++)
        code = kn_curve_load(w->curve, &w->curves, KN_CURVE_RELAX, w->opt.file[i], &w->opt.curve);
    return code;
}

static int fit(work *w)
{
    char error[400];
    const kn_relaxation_fit_options how = {.confidence = 0.95, .constant_noise = w->opt.constant_noise};
    if (!kn_relaxation_fit_run(&w->fit, w->curves, w->curve, &how, error, sizeof error))
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE, "%s", error);
    // A modulus without its strain makes no material.
    if (w->opt.out && w->fit.scale == KN_RELAXATION_MODULUS)
        return kn_complain(w->opt.subcommand, KN_EXIT_USAGE,
                           "--out %s: no material without the held strain, expected it in the file or by --strain",
                           w->opt.out);
    return KN_EXIT_OK;
}

static void compare(work *w)
{
    char error[400];
    if (w->opt.no_models) return;
    w->compared = kn_model_comparison_run(&w->models, w->curves, w->curve, w->opt.cut_s, error, sizeof error);
    if (w->compared) {
        kn_model_comparison_print(&w->models);
        kn_model_comparison_tell(&w->models);
    } else printf("\nmodels      not compared: %s\n", error);
}

static int write(const kn_relax_told *told, kn_document *d)
{
    const kn_identify_options *o = told->opt;
    int code = o->csv ? write_csv(told, o->csv) : KN_EXIT_OK;
    if (code == KN_EXIT_OK && o->png) code = kn_relax_draw(told, o->png);
    if (code == KN_EXIT_OK && kn_document_is_open(d)) code = kn_relax_report(d, told, write_csv, write_material);
    // Write the material last, since this fails if no scene accepts it.
    if (code == KN_EXIT_OK && o->out) code = write_material(told, o->out);
    return kn_document_close(d, code);
}

static int identify(work *w, int argc, char **argv)
{
    kn_document d = {0};
    int code = try_outputs(&w->opt);
    if (code == KN_EXIT_OK)
        code = kn_document_open(&d, w->opt.subcommand, w->opt.report, "Stress relaxation", argc, argv);
    if (code == KN_EXIT_OK) code = load(w);
    if (code == KN_EXIT_OK) code = fit(w);
    if (code != KN_EXIT_OK) return kn_document_close(&d, code);
    print_numbers(&w->fit);
    print_curves(&w->fit);
    kn_relax_doubts(&w->fit, doubt, NULL);
    tell(&w->fit);
    compare(w);
    const kn_relax_told told = {&w->opt, &w->fit, w->compared ? &w->models : NULL};
    return write(&told, &d);
}

int kn_identify_relax_main(int argc, char **argv)
{
    work *w = calloc(1, sizeof *w);
    if (!w) return kn_complain("identify relax", KN_EXIT_DEVICE, "out of memory");
    int code = kn_identify_options_parse(&w->opt, "identify relax", 'r', help, argc, argv);
    if (code == KN_OPTIONS_READ) code = identify(w, argc, argv);
    kn_model_comparison_free(&w->models);
    kn_relaxation_fit_free(&w->fit);
    for (int k = 0; k < w->curves; k++) kn_curve_free(&w->curve[k]);
    kn_identify_options_free(&w->opt);
    free(w);
    return code;
}
