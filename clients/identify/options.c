#include "clients/identify/options.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/output.h"
#include "clients/cli/result.h"
#include "core/scene/keys.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Parse a strain, 10% or 0.1, with an optional blank before the percent sign.
static const char *take_strain(void *strain, const char *text)
{
    char share[40];
    size_t n = strlen(text);
    bool percent = n > 1 && n < sizeof share && text[n - 1] == '%';
    snprintf(share, sizeof share, "%s", text);
    if (percent) share[n - 1] = 0;
    if (percent && n > 2 && share[n - 2] == ' ') share[n - 2] = 0;
    if (!kn_number_take(share, 1e-6, percent ? 90 : 0.9, strain))
        return "a share of the height like 10% or 0.1, up to 90 %";
    *(double *)strain /= percent ? 100 : 1;
    return NULL;
}

// Parse a density and check the limits of the scene key of that name.
static const char *take_density(void *density_kg_m3, const char *text)
{
    static char expected[80];
    const kn_key *key = &kn_keys[KN_KEY_DENSITY];
    if (kn_quantity_read(text, "kg/m^3", false, key->least, key->most, density_kg_m3)) return NULL;
    snprintf(expected, sizeof expected, "a density like '1.2 g/cm^3', %g to %g kg/m^3", key->least, key->most);
    return expected;
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
    return KN_OPTIONS_READ;
}

#define AT(member) .offset = offsetof(kn_identify_options, member)
#define SI(unit_text) .unit = unit_text, KN_RANGE(KN_ABOVE_0, 1e30)
// `belongs` names the experiments by their letters.
static const kn_option rows[] = {
    KN_OPTION("load", QUANTITY, AT(curve.load_n), SI("N"), .expected = "a weight or force like 50gf or '0.5 N'",
              .belongs = "c"),
    KN_OPTION("stress", QUANTITY, AT(curve.stress_pa), SI("Pa"), .expected = "a stress like '5 kPa'", .belongs = "c"),
    KN_OPTION("height", QUANTITY, AT(curve.height_m), SI("m"), .expected = "a length like '1 cm'", .belongs = "cr"),
    KN_OPTION("area", QUANTITY, AT(curve.area_m2), SI("m^2"), .expected = "an area like '1 cm^2'", .belongs = "cr"),
    KN_OPTION("release", QUANTITY, AT(curve.release_s), SI("s"), .expected = "a time like 60 or '60 s'",
              .belongs = "c"),
    KN_OPTION("strain", SPECIAL, AT(curve.strain), .take = take_strain, .belongs = "r"),
    KN_OPTION("units", TEXT, AT(curve.units)),
    KN_OPTION("constant-area", FLAG, AT(curve.constant_area), .belongs = "cr"),
    KN_OPTION("late", FLAG, AT(late), .belongs = "c"),
    KN_OPTION("noise", EITHER, AT(constant_noise), .unit = "relative|constant", .expected = "constant or relative",
              .belongs = "r"),
    KN_OPTION("cut", QUANTITY, AT(cut_s), SI("s"), .expected = "a time like 100 or '100 s'", .belongs = "cr"),
    KN_OPTION("no-models", FLAG, AT(no_models), .belongs = "cr"),
    KN_OPTION("out", TEXT, AT(out)),
    KN_OPTION("density", SPECIAL, AT(density_kg_m3), .take = take_density),
    KN_OPTION("report", TEXT, AT(report)),
    KN_OPTION("png", TEXT, AT(png)),
    KN_OPTION("csv", TEXT, AT(csv)),
    KN_OPTION("json", CALL, .call = kn_result_open),
    KN_OPTION("shear", FLAG, AT(shear), .belongs = "s"),
};

int kn_identify_options_parse(kn_identify_options *opt, const char *subcommand, char experiment, const char *help,
                              int argc, char **argv)
{
    const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help, .unknown = "unknown option; --help lists them",
                                   .experiment = experiment, .quotes = true};
    *opt = (kn_identify_options){.subcommand = subcommand, .curve.subcommand = subcommand};
    opt->file = calloc((size_t)argc, sizeof *opt->file);
    if (!opt->file) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    const int code = kn_options_read(&table, opt, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    for (int i = optind; i < argc; i++) opt->file[opt->files++] = argv[i];
    if (opt->files == 0)
        return kn_complain(subcommand, KN_EXIT_USAGE, "expected a file of readings, CSV; --help tells its columns");
    return keep_apart(opt);
}

void kn_identify_options_free(kn_identify_options *opt) { free(opt->file); }
