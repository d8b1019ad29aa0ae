// The `knead identify` command: find the parameters of a virtual lump from measurements on a real one.
#include "clients/identify/identify.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/output.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "core/scene/keys.h"
#include "server/scene_name.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- the options of creep, press, relax and sweep

// Parse a density. The limits are those of the scene's key `density`.
static const char *take_density(void *density_kg_m3, const char *text)
{
    static char expected[80];
    const kn_key *key = &kn_keys[KN_KEY_DENSITY];
    if (kn_quantity_read(text, "kg/m^3", false, key->least, key->most, density_kg_m3)) return NULL;
    snprintf(expected, sizeof expected, "a density like '1.2 g/cm^3', %g to %g kg/m^3", key->least, key->most);
    return expected;
}

// Refuse an output that is also an input. Refuse two outputs if they are the same path or if one lies inside the other.
// Refuse an input that is given twice, since its readings would count twice.
static int keep_apart(const kn_identify_options *opt)
{
    const char *const name[] = {"out", "png", "csv", "report"}, *const output[] = {opt->out, opt->png, opt->csv,
                                                                                   opt->report};
    for (int i = 0; i < 4; i++)
        for (int k = 0; output[i] && k < opt->files + 2; k++)
            if (kn_output_same(output[i], k < opt->files ? opt->file[k] : k > opt->files ? opt->object : opt->tool))
                return kn_complain(opt->subcommand, KN_EXIT_USAGE,
                                   "--%s %s: this path is also an input, expected another path", name[i], output[i]);
    for (int i = 0; i < 4; i++)
        for (int k = i + 1; output[i] && k < 4; k++)
            if (output[k] && (kn_output_holds(output[i], output[k]) || kn_output_holds(output[k], output[i])))
                return kn_complain(opt->subcommand, KN_EXIT_USAGE,
                                   "--%s %s and --%s %s: expected two paths, neither inside the other", name[i],
                                   output[i], name[k], output[k]);
    for (int i = 0; i < opt->files; i++)
        for (int k = i + 1; k < opt->files; k++)
            if (kn_output_same(opt->file[i], opt->file[k]))
                return kn_complain(opt->subcommand, KN_EXIT_USAGE,
                                   "%s and %s are one file, whose readings would count twice; expected it once",
                                   opt->file[i], opt->file[k]);
    return KN_OPTIONS_READ;
}

static const char *take_structure(void *structure, const char *text)
{
    *(char *)structure = *text;
    return strlen(text) == 1 && strchr("abc", *text) ? NULL : "a structure of the first paper: a, b or c";
}

#define AT(member) .offset = offsetof(kn_identify_options, member)
#define SI(unit_text) .unit = unit_text, KN_RANGE(KN_ABOVE_0, 1e30)
// `belongs` lists the experiments that accept the option, by their first letters.
static const kn_option rows[] = {
    KN_OPTION("load", QUANTITY, AT(curve.load_n), SI("N"), .expected = "a weight or force like 50gf or '0.5 N'",
              .belongs = "cp"),
    KN_OPTION("stress", QUANTITY, AT(curve.stress_pa), SI("Pa"), .expected = "a stress like '5 kPa'", .belongs = "cp"),
    KN_OPTION("height", QUANTITY, AT(curve.height_m), SI("m"), .expected = "a length like '1 cm'", .belongs = "cpr"),
    KN_OPTION("area", QUANTITY, AT(curve.area_m2), SI("m^2"), .expected = "an area like '1 cm^2'", .belongs = "cpr"),
    KN_OPTION("release", QUANTITY, AT(curve.release_s), SI("s"), .expected = "a time like 60 or '60 s'",
              .belongs = "cp"),
    KN_OPTION("strain", QUANTITY, AT(curve.strain), .unit = "1", KN_RANGE(1e-8, 0.9), .belongs = "r",
              .expected = "a share of the height like 10% or 0.1, up to 90 %"),
    KN_OPTION("units", TEXT, AT(curve.units)),
    KN_OPTION("column", TEXT, AT(curve.roles)),
    KN_OPTION("shear", FLAG, AT(curve.shear), .belongs = "crs"),
    KN_OPTION("compression", FLAG, AT(curve.compression), .belongs = "crs"),
    KN_OPTION("poisson", NUMBER, AT(curve.poisson), KN_RANGE(KN_ABOVE_0, 0.5), .expected = "a ratio above 0, up to 0.5",
              .belongs = "crs"),
    KN_OPTION("constant-area", FLAG, AT(curve.constant_area), .belongs = "cr"),
    KN_OPTION("late", FLAG, AT(late), .belongs = "c"),
    KN_OPTION("serve", SPECIAL, AT(serve), .take = take_structure, .belongs = "c"),
    KN_OPTION("spacing", QUANTITY, AT(spacing_m), SI("m"), .expected = "a length like '5 mm'", .belongs = "c"),
    KN_OPTION("anyway", FLAG, AT(anyway), .belongs = "cp"),
    KN_OPTION("object", SPECIAL, AT(object), .take = kn_scene_take, .belongs = "p"),
    KN_OPTION("tool", TEXT, AT(tool), .belongs = "p"),
    KN_OPTION("creep", LIST, AT(creep), .count = offsetof(kn_identify_options, creeps), .belongs = "p"),
    KN_OPTION("held", LIST, AT(held), .count = offsetof(kn_identify_options, helds), .belongs = "p"),
    KN_OPTION("compliance", QUANTITY, AT(compliance_m_n), .unit = "m/N", .most = 1,
              .expected = "a compliance like '0.01 mm/N'", .belongs = "p"),
    KN_OPTION("noise", EITHER, AT(constant_noise), .unit = "relative|constant", .belongs = "r"),
    KN_OPTION("cut", QUANTITY, AT(cut_s), SI("s"), .expected = "a time like 100 or '100 s'", .belongs = "cr"),
    KN_OPTION("no-models", FLAG, AT(no_models), .belongs = "cr"),
    KN_OPTION("out", TEXT, AT(out)),
    KN_OPTION("density", SPECIAL, AT(density_kg_m3), .take = take_density),
    KN_OPTION("report", TEXT, AT(report)),
    KN_OPTION("png", TEXT, AT(png)),
    KN_OPTION("csv", TEXT, AT(csv)),
    KN_OPTION("json", CALL, .call = kn_result_open),
};

// Parse the command line of one experiment: 'c' for creep, 'p' for press, 'r' for relax, 's' for sweep. Return
// KN_OPTIONS_READ if the experiment is to run. Otherwise return an exit code: 0 after --help, which prints `help`, or
// another code after an error. Call free_options in every case, even after an error.
static int parse_options(kn_identify_options *opt, const char *subcommand, char experiment, const char *help, int argc,
                         char **argv)
{
    const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help, .experiment = experiment};
    *opt = (kn_identify_options){.subcommand = subcommand, .curve.subcommand = subcommand, .compliance_m_n = NAN};
    opt->file = calloc((size_t)argc, sizeof *opt->file);
    opt->creep = calloc((size_t)argc, sizeof *opt->creep);
    opt->held = calloc((size_t)argc, sizeof *opt->held);
    if (!opt->file || !opt->creep || !opt->held) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    const int code = kn_options_read(&table, opt, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    for (int i = optind; i < argc; i++) opt->file[opt->files++] = argv[i];
    if (opt->files == 0 && opt->creeps > 0)
        return kn_complain(subcommand, KN_EXIT_USAGE,
                           "expected a press beside --creep; for creep alone there is knead identify creep");
    if (opt->curve.shear && opt->curve.compression)
        return kn_complain(subcommand, KN_EXIT_USAGE, "--shear and --compression: expected one of them");
    if (opt->files == 0)
        return kn_complain(subcommand, KN_EXIT_USAGE, "expected a file of readings, CSV; --help lists its columns");
    for (int i = 0; i < opt->creeps; i++) opt->file[opt->files++] = opt->creep[i];
    for (int i = 0; i < opt->helds; i++) opt->file[opt->files++] = opt->held[i];
    return keep_apart(opt);
}

static void free_options(kn_identify_options *opt)
{
    free(opt->file);
    free(opt->creep);
    free(opt->held);
}

// ---- functions that all experiments share

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

const char *kn_identify_source(const kn_identification *w, char text[KN_SOURCE_MAX])
{
    kn_material_source(w->opt.file[0], w->opt.files, text);
    const size_t n = strlen(text);
    int sheared = 0;
    double young = 0;
    for (int c = 0; c < w->curves; c++)
        if (w->curve[c].young > 0) sheared++, young = w->curve[c].young;
    if (sheared > 0)
        snprintf(text + n, KN_SOURCE_MAX - n, ", %d of %d curves of shear, with E = %.4g G", sheared, w->curves, young);
    return text;
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
    kn_document_link(d, "material.yaml", "the material; a scene uses it with the line `material: material.yaml`");
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

// ---- the sequence of steps of an experiment

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
    for (int i = 0, held = o->files - o->helds; i < o->files && code == KN_EXIT_OK; i++) {
        const bool creep = i >= held - o->creeps && i < held;
        kn_curve_options options = o->curve; // a press is of a specimen only if its own notes say so
        options.compression |= e->kind == KN_CURVE_PRESS;
        if (e->kind == KN_CURVE_PRESS && !creep) options.height_m = options.area_m2 = 0;
        code = kn_curve_load(w->curve, &w->curves, creep ? KN_CURVE_CREEP : e->kind, o->file[i], &options);
    }
    // Fit, print, and write the files that the options request.
    if (code == KN_EXIT_OK) code = e->fit(w);
    if (code == KN_EXIT_OK) e->tell(w);
    if (code == KN_EXIT_OK && o->csv) code = write_csv(w, o->csv);
    if (code == KN_EXIT_OK && o->png) code = e->draw(w, o->png);
    if (code == KN_EXIT_OK && kn_document_is_open(&d)) code = e->report(w, &d);
    // Write the material last, since this step fails if no scene accepts the material.
    if (code == KN_EXIT_OK && o->out) code = e->write_material(w, o->out);
    return kn_document_close(&d, code);
}

static int run(const kn_identify_experiment *e, int argc, char **argv)
{
    kn_identification *w = calloc(1, sizeof *w);
    if (!w) return kn_complain(e->subcommand, KN_EXIT_DEVICE, "out of memory");
    w->experiment = e;
    int code = parse_options(&w->opt, e->subcommand, e->letter, e->help, argc, argv);
    if (code == KN_OPTIONS_READ) code = identify(w, argc, argv);
    kn_model_comparison_free(&w->models);
    kn_relaxation_fit_free(&w->relax);
    for (int k = 0; k < w->curves; k++) kn_curve_free(&w->curve[k]);
    kn_press_fit_free(&w->press);
    for (int k = 0; k <= KN_CURVES_MAX; k++) kn_scene_destroy(w->scene[k]);
    free_options(&w->opt);
    free(w);
    return code;
}

// ---- the command knead identify

static const struct {
    const char *name, *summary;
    // NULL: the experiment is `shape`, which does not share the sequence of steps
    const kn_identify_experiment *experiment;
} experiments[] = {
    {"creep", "fit a material to the strain of a specimen under a weight, and after the weight is removed",
     &kn_identify_creep},
    {"press", "fit the material of an object to force and depth of presses with a tool", &kn_identify_press},
    {"relax", "fit a material to the stress in a specimen that is held compressed", &kn_identify_relax},
    {"shape", "find the inner structure of a lump and the pressure in it, from a depth image and the force of a press",
     NULL},
    {"sweep", "fit springs and dampers to storage and loss modulus over frequency", &kn_identify_sweep},
};
enum { EXPERIMENTS = sizeof experiments / sizeof *experiments };

static void print_help(void)
{
    fputs("usage: knead identify COMMAND [OPTION]... FILE...\n\n"
          "Fit a virtual object to measurements of a real one. It prints the parameters with 95 % intervals. --out\n"
          "writes a material, or a scene that kneadd can serve. `knead help identify COMMAND` has the rest.\n\n",
          stdout);
    for (int i = 0; i < EXPERIMENTS; i++) printf("  %-6s %s\n", experiments[i].name, experiments[i].summary);
    puts("\nExamples:\n"
         "    knead creep dough --csv creep.csv\n"
         "    knead identify creep creep.csv --height 1cm --area 1cm^2 --out mine.yaml\n\n"
         "Exit codes: 0 ok, 1 the fit cannot be used, 2 bad input, 3 a file cannot be written.");
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
        char *const given = argv[1];
        argv[1] = full;
        const int code = experiments[i].experiment ? run(experiments[i].experiment, argc - 1, argv + 1)
                                                   : kn_identify_shape_main(argc - 1, argv + 1);
        argv[1] = given; // whoever owns the arguments may free them
        return code;
    }
    return kn_complain("identify", KN_EXIT_USAGE,
                       "%s: expected creep, press, relax, sweep or shape; see knead identify --help",
                       argc > 1 ? argv[1] : "no command");
}
