#include "clients/identify/options.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/number.h"
#include "clients/knead/output.h"
#include "clients/knead/result.h"
#include "core/scene/keys.h"
#include "core/scene/units.h"
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    LOAD = 256,
    STRESS,
    HEIGHT,
    AREA,
    RELEASE,
    STRAIN,
    UNITS,
    CONSTANT,
    LATE,
    SHEAR,
    NOISE,
    CUT,
    NO_MODELS,
    OUT,
    DENSITY,
    REPORT,
    PNG,
    CSV,
    JSON,
    HELP
};

static const struct option list[] = {{"load", 1, 0, LOAD},
                                     {"stress", 1, 0, STRESS},
                                     {"height", 1, 0, HEIGHT},
                                     {"area", 1, 0, AREA},
                                     {"release", 1, 0, RELEASE},
                                     {"strain", 1, 0, STRAIN},
                                     {"units", 1, 0, UNITS},
                                     {"constant-area", 0, 0, CONSTANT},
                                     {"late", 0, 0, LATE},
                                     {"noise", 1, 0, NOISE},
                                     {"cut", 1, 0, CUT},
                                     {"no-models", 0, 0, NO_MODELS},
                                     {"out", 1, 0, OUT},
                                     {"density", 1, 0, DENSITY},
                                     {"report", 1, 0, REPORT},
                                     {"png", 1, 0, PNG},
                                     {"csv", 1, 0, CSV},
                                     {"json", 0, 0, JSON},
                                     {"shear", 0, 0, SHEAR},
                                     {"help", 0, 0, HELP},
                                     {0, 0, 0, 0}};

// Return whether the experiment has this option. An option that is not in the table belongs to every experiment.
static bool has_option(char experiment, int option)
{
    static const struct {
        int option;
        const char *whose;
    } own[] = {{LOAD, "c"},   {STRESS, "c"},    {RELEASE, "c"}, {LATE, "c"}, {HEIGHT, "cr"}, {AREA, "cr"},
               {STRAIN, "r"}, {CONSTANT, "cr"}, {NOISE, "r"},   {CUT, "cr"}, {SHEAR, "s"},   {NO_MODELS, "cr"}};
    for (size_t i = 0; i < sizeof own / sizeof *own; i++)
        if (own[i].option == option) return strchr(own[i].whose, experiment);
    return true;
}

static int bad(const kn_identify_options *opt, const char *name, const char *text, const char *expected)
{
    return kn_complain(opt->subcommand, KN_EXIT_USAGE, "--%s '%s': expected %s", name, text, expected);
}

// Parse a quantity above 0 in the dimension of unit_name. A bare number is accepted for seconds only.
static int take(const kn_identify_options *opt, const char *name, const char *text, const char *unit_name,
                const char *expected, double *value)
{
    kn_quantity q;
    kn_unit unit;
    char error[200];
    kn_unit_parse(&unit, unit_name, error, sizeof error);
    bool fits = kn_quantity_parse(&q, text, error, sizeof error);
    bool bare_ok = !strcmp(unit_name, "s");
    fits = fits && (q.bare ? bare_ok : kn_unit_same_dimension(&q.unit, &unit));
    if (fits) *value = kn_quantity_in(&q, &unit);
    return fits && *value > 0 && *value < 1e30 ? KN_EXIT_OK : bad(opt, name, text, expected);
}

// Parse a strain, 10% or 0.1, with an optional blank before the percent sign.
static int take_strain(kn_identify_options *opt, const char *text)
{
    char share[40];
    size_t n = strlen(text);
    bool percent = n > 1 && n < sizeof share && text[n - 1] == '%';
    snprintf(share, sizeof share, "%s", text);
    if (percent) share[n - 1] = 0;
    if (percent && n > 2 && share[n - 2] == ' ') share[n - 2] = 0;
    if (!kn_number_take(share, 1e-6, percent ? 90 : 0.9, &opt->curve.strain))
        return bad(opt, "strain", text, "a share of the height like 10% or 0.1, up to 90 %");
    opt->curve.strain /= percent ? 100 : 1;
    return KN_EXIT_OK;
}

// Parse a density and check the limits of the scene key of that name.
static int take_density(kn_identify_options *opt, const char *text)
{
    char expected[80];
    const kn_key *key = &kn_keys[KN_KEY_DENSITY];
    double *value = &opt->density_kg_m3;
    snprintf(expected, sizeof expected, "a density like '1.2 g/cm^3', %g to %g kg/m^3", key->least, key->most);
    int code = take(opt, "density", text, "kg/m^3", expected, value);
    return code == KN_EXIT_OK && !(*value >= key->least && *value <= key->most) ? bad(opt, "density", text, expected)
                                                                                : code;
}

// Store the value of one option. Return 0, or print an error and return an exit code.
static int take_option(kn_identify_options *opt, int option, const char *text)
{
    kn_curve_options *c = &opt->curve;
    switch (option) {
    case LOAD: return take(opt, "load", text, "N", "a weight or force like 50gf or '0.5 N'", &c->load_n);
    case STRESS: return take(opt, "stress", text, "Pa", "a stress like '5 kPa'", &c->stress_pa);
    case HEIGHT: return take(opt, "height", text, "m", "a length like '1 cm'", &c->height_m);
    case AREA: return take(opt, "area", text, "m^2", "an area like '1 cm^2'", &c->area_m2);
    case RELEASE: return take(opt, "release", text, "s", "a time like 60 or '60 s'", &c->release_s);
    case STRAIN: return take_strain(opt, text);
    case UNITS: c->units = text; return KN_EXIT_OK;
    case CONSTANT: c->constant_area = true; return KN_EXIT_OK;
    case LATE: opt->late = true; return KN_EXIT_OK;
    case SHEAR: opt->shear = true; return KN_EXIT_OK;
    case NOISE:
        opt->constant_noise = !strcmp(text, "constant");
        return opt->constant_noise || !strcmp(text, "relative") ? KN_EXIT_OK
                                                                : bad(opt, "noise", text, "constant or relative");
    case CUT: return take(opt, "cut", text, "s", "a time like 100 or '100 s'", &opt->cut_s);
    case NO_MODELS: opt->no_models = true; return KN_EXIT_OK;
    case OUT: opt->out = text; return KN_EXIT_OK;
    case DENSITY: return take_density(opt, text);
    case REPORT: opt->report = text; return KN_EXIT_OK;
    case PNG: opt->png = text; return KN_EXIT_OK;
    case CSV: opt->csv = text; return KN_EXIT_OK;
    default: kn_result_open(); return KN_EXIT_OK;
    }
}

// Refuse an output that is also an input, and two outputs of which one equals or contains the other. Also refuse an
// input that is given twice, since its readings would count twice.
static int keep_apart(const kn_identify_options *opt)
{
    const char *const name[] = {"out", "png", "csv", "report"}, *const output[] = {opt->out, opt->png, opt->csv,
                                                                                   opt->report};
    for (int i = 0; i < 4; i++)
        for (int k = 0; output[i] && k < opt->files; k++)
            if (kn_output_same(output[i], opt->file[k]))
                return kn_complain(opt->subcommand, KN_EXIT_USAGE, "--%s %s: is being read, expected another name",
                                   name[i], output[i]);
    for (int i = 0; i < 4; i++)
        for (int k = i + 1; output[i] && k < 4; k++)
            if (output[k] && (kn_output_holds(output[i], output[k]) || kn_output_holds(output[k], output[i])))
                return kn_complain(opt->subcommand, KN_EXIT_USAGE, "--%s %s and --%s %s: expected names apart", name[i],
                                   output[i], name[k], output[k]);
    for (int i = 0; i < opt->files; i++)
        for (int k = i + 1; k < opt->files; k++)
            if (kn_output_same(opt->file[i], opt->file[k]))
                return kn_complain(opt->subcommand, KN_EXIT_USAGE, "%s and %s: one file, expected its readings once",
                                   opt->file[i], opt->file[k]);
    return KN_EXIT_OK;
}

// Return the argument at which getopt_long stopped. Inside a group of letters like "-xy", optind still points at the
// group. After an option with a separate value, optind is past both the option and its value.
static const char *stopped_at(int c, char *const *argv)
{
    const char *last = argv[optind - 1];
    if (c == '?' && optopt > 0 && optopt < LOAD) // getopt_long stopped at an unknown single-letter option
        return last[0] == '-' && last[1] == optopt && !last[2] ? last : argv[optind];
    return c != '?' && c != ':' && optarg == last ? argv[optind - 2] : last;
}

int kn_identify_options_parse(kn_identify_options *opt, const char *subcommand, char experiment, const char *help,
                              int argc, char **argv, bool *done)
{
    *opt = (kn_identify_options){.subcommand = subcommand, .curve.subcommand = subcommand};
    opt->file = calloc((size_t)argc, sizeof *opt->file);
    if (!opt->file) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    optind = 1;
    // Options of other experiments are refused in the same way as unknown options.
    for (int c; (c = getopt_long(argc, argv, ":", list, NULL)) != -1;) {
        if (c == HELP) {
            fputs(help, stdout);
            *done = true;
            return KN_EXIT_OK;
        }
        if (c == '?' || c == ':' || !has_option(experiment, c)) {
            return kn_complain(subcommand, KN_EXIT_USAGE, "%s: %s", stopped_at(c, argv),
                               c == ':' ? "expected a value" : "unknown option; --help lists them");
        }
        int code = take_option(opt, c, optarg);
        if (code != KN_EXIT_OK) return code;
    }
    for (int i = optind; i < argc; i++) opt->file[opt->files++] = argv[i];
    if (opt->files == 0)
        return kn_complain(subcommand, KN_EXIT_USAGE, "expected a file of readings, CSV; --help tells its columns");
    return keep_apart(opt);
}

void kn_identify_options_free(kn_identify_options *opt) { free(opt->file); }
