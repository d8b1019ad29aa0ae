// The `knead identify` command: find the parameters of a virtual lump from measurements on a real one.
#include "clients/identify/identify.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/output.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

// ---- what the experiments share

void kn_identify_note(kn_identification *w, const char *format, ...)
{
    va_list args;
    if (w->notes == KN_IDENTIFY_NOTES) return;
    char *note = w->note[w->notes++];
    va_start(args, format);
    vsnprintf(note, sizeof w->note[0], format, args);
    va_end(args);
    printf("note: %s\n", note);
    kn_result_text(kn_result_add("notes"), "words", note);
}

bool kn_identify_compare(kn_identification *w, char error[400])
{
    if (w->opt.no_models) return true;
    w->compared = kn_model_comparison_run(&w->models, w->curves, w->curve, w->opt.cut_s, error, 400);
    if (!w->compared) return false;
    kn_model_comparison_print(&w->models);
    kn_model_comparison_tell(&w->models);
    return true;
}

void kn_identify_print_number(const kn_parameter_estimate *n, int name, int interval, const char *more)
{
    char text[120];
    kn_parameter_estimate_text(n, text, sizeof text);
    printf("%-*s %-*s%s\n", name, n->name, interval, text, more);
    if (*n->words) printf("%*s %s\n", name, "", n->words);
}

void kn_identify_tell_numbers(int count, const kn_parameter_estimate *number)
{
    json_t *to = kn_result(), *numbers = json_object_get(to, "numbers");
    if (to && !numbers) json_object_set_new(to, "numbers", numbers = json_object());
    for (int i = 0; i < count; i++) kn_parameter_estimate_tell(numbers, &number[i]);
}

void kn_identify_page_number(kn_document *d, const kn_parameter_estimate *n)
{
    char text[120];
    kn_parameter_estimate_text(n, text, sizeof text);
    kn_document_row(d, "%s\t%s\t%s", n->name, text, n->words);
}

const char *kn_identify_runs(double runs, char text[16])
{
    snprintf(text, 16, "-");
    if (!isnan(runs)) snprintf(text, 16, "%.2g", runs);
    return text;
}

void kn_identify_plot(kn_figure_panel *p, const char *name, int count, const double *x, const double *y, double scale,
                      kn_figure_look look, int hue)
{
    kn_figure_add(p, (kn_figure_series){name, count, x, y, 1, scale, look, hue});
}

void kn_identify_points(double low, double high, double *x)
{
    for (int i = 0; i < KN_IDENTIFY_POINTS; i++) x[i] = low * pow(high / low, i / (KN_IDENTIFY_POINTS - 1.0));
}

static int write_csv(const kn_identification *w, const char *path)
{
    kn_beside out;
    FILE *f = kn_output_open(&out, w->opt.subcommand, path);
    if (!f) return KN_EXIT_DEVICE;
    fprintf(f, "%s\n", w->experiment->csv_head);
    if (w->experiment->csv_rows(w, f)) return kn_output_close(&out, w->opt.subcommand);
    kn_beside_drop(&out);
    return kn_complain(w->opt.subcommand, KN_EXIT_DEVICE, "%s: the fitted values cannot be computed", path);
}

void kn_identify_page_material(kn_document *d)
{
    kn_document_link(d, "material.yaml", "the material, for `material: material.yaml` in a scene");
}

int kn_identify_page_files(const kn_identification *w, kn_document *d, const char *csv, const char *words,
                           bool material)
{
    char path[PATH_MAX];
    kn_document_section(d, "Files");
    int code = write_csv(w, kn_document_file(d, csv, path));
    kn_document_link(d, csv, words);
    if (code != KN_EXIT_OK || !material) return code;
    code = w->experiment->write_material(w, kn_document_file(d, "material.yaml", path));
    kn_identify_page_material(d);
    return code;
}

// ---- the course of an experiment

static int identify(kn_identification *w, int argc, char **argv)
{
    const kn_identify_options *o = &w->opt;
    const kn_identify_experiment *e = w->experiment;
    kn_document d = {0};
    // Check that all outputs can be written before the work begins.
    int code = o->png ? kn_plot_try(o->subcommand, o->png) : KN_EXIT_OK;
    if (code == KN_EXIT_OK && o->csv) code = kn_output_try(o->subcommand, o->csv);
    if (code == KN_EXIT_OK && o->out) code = kn_material_file_try(o->subcommand, o->out);
    if (code == KN_EXIT_OK) code = kn_document_open(&d, o->subcommand, o->report, e->title, argc, argv);
    for (int i = 0; i < o->files && code == KN_EXIT_OK; i++)
        code = kn_curve_load(w->curve, &w->curves, e->kind, o->file[i], &o->curve);
    // Fit, print, and write the files that are asked for.
    if (code == KN_EXIT_OK) code = e->fit(w);
    if (code == KN_EXIT_OK) e->tell(w);
    if (code == KN_EXIT_OK && o->csv) code = write_csv(w, o->csv);
    if (code == KN_EXIT_OK && o->png) code = e->draw(w, o->png);
    if (code == KN_EXIT_OK && kn_document_is_open(&d)) code = e->report(w, &d);
    // Write the material last, since this fails if no scene accepts it.
    if (code == KN_EXIT_OK && o->out) code = e->write_material(w, o->out);
    return kn_document_close(&d, code);
}

static int run(const kn_identify_experiment *e, int argc, char **argv)
{
    kn_identification *w = calloc(1, sizeof *w);
    if (!w) return kn_complain(e->subcommand, KN_EXIT_DEVICE, "out of memory");
    w->experiment = e;
    int code = kn_identify_options_parse(&w->opt, e->subcommand, e->letter, e->help, argc, argv);
    if (code == KN_OPTIONS_READ) code = identify(w, argc, argv);
    kn_model_comparison_free(&w->models);
    kn_relaxation_fit_free(&w->relax);
    for (int k = 0; k < w->curves; k++) kn_curve_free(&w->curve[k]);
    kn_identify_options_free(&w->opt);
    free(w);
    return code;
}

// ---- the command

static const struct {
    const char *name, *summary;
    const kn_identify_experiment *experiment; // NULL: shape, which takes a course of its own
} experiments[] = {
    {"creep", "creep curves under one load or several -> k1, c1 and the damper, with intervals", &kn_identify_creep},
    {"relax", "stress relaxation, with the way to the strain or without -> the same; which model the data support",
     &kn_identify_relax},
    {"shape", "a range image of a pressed lump, and the force -> structure, inside pressure, stress area", NULL},
    {"sweep", "storage and loss modulus over frequency -> springs and dampers, which of them the data support",
     &kn_identify_sweep},
};
enum { EXPERIMENTS = sizeof experiments / sizeof *experiments };

static void print_help(void)
{
    printf("usage: knead identify COMMAND [OPTION]... FILE...\n\n"
           "Fit the parameters of a virtual object to measurements of a real specimen, each parameter with its "
           "uncertainty.\n\n");
    for (int i = 0; i < EXPERIMENTS; i++) printf("  %-6s %s\n", experiments[i].name, experiments[i].summary);
    printf("\n`knead identify COMMAND --help` lists the options.\n");
}

int kn_identify_main(int argc, char **argv)
{
    if (argc > 1 && (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h"))) {
        print_help();
        return KN_EXIT_OK;
    }
    for (int i = 0; argc > 1 && i < EXPERIMENTS; i++) {
        if (strcmp(argv[1], experiments[i].name) != 0) continue;
        char full[40]; // argv[0] of the experiment; getopt prints this name in front of its messages
        snprintf(full, sizeof full, "knead identify %s", experiments[i].name);
        argv[1] = full;
        return experiments[i].experiment ? run(experiments[i].experiment, argc - 1, argv + 1)
                                         : kn_identify_shape_main(argc - 1, argv + 1);
    }
    return kn_complain("identify", KN_EXIT_USAGE, "expected creep, relax, sweep or shape; --help tells the rest");
}
