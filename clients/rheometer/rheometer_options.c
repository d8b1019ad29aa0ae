#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "clients/rheometer/rheometer.h"
#include "core/scene/scene.h"
#include "server/scene_name.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Read a finite number. A number without a unit is accepted only if `bare` is true.
static bool read_quantity(const char *text, const char *unit, bool bare, double *value)
{
    return kn_quantity_read(text, unit, bare, -DBL_MAX, DBL_MAX, value);
}

// Split a text like "50%/s": copy the part before the percent sign to `number`, and return the rest from the sign on.
// Return NULL if the text has no percent sign.
static const char *split_percent(const char *text, char number[64])
{
    snprintf(number, 64, "%.*s", (int)strcspn(text, "%"), text);
    return strchr(text, '%');
}

// Read a share of the specimen's height from a text like "50%" or "0.5".
static const char *take_share(void *share, const char *text)
{
    char number[64];
    double *value = share;
    const char *percent = split_percent(text, number);
    bool good = read_quantity(number, "1", true, value) && (!percent || percent[1] == '\0');
    if (percent) *value /= 100;
    return good && *value > 0 && *value < 1 ? NULL : "a share of the height between 0 and 100 %, like 10%";
}

// Read a strain rate from a text like "10%/s" or "0.1 1/s". A speed is divided by the height of the cube.
static const char *take_ramp(void *ramp_per_s, const char *text)
{
    char number[64];
    double *value = ramp_per_s;
    const char *percent = split_percent(text, number);
    bool good = percent ? !strcmp(percent, "%/s") && read_quantity(number, "1", true, value)
                        : read_quantity(text, "1/s", false, value);
    if (percent) *value /= 100;
    // If the text is not a strain rate, read it as a speed of the plate.
    if (!good && (good = read_quantity(text, "m/s", false, value))) *value /= KN_RHEOMETER_HEIGHT_M;
    return good && *value > 0 ? NULL : "a strain per second like 10%/s, or a speed like '1 mm/s'";
}

// Read the loads: weights separated by commas.
static const char *take_loads(void *options, const char *text)
{
    kn_rheometer_options *opt = options;
    opt->loads = 0;
    for (const char *at = text; at; at = strchr(at, ',') ? strchr(at, ',') + 1 : NULL) {
        char one[64];
        snprintf(one, sizeof one, "%.*s", (int)strcspn(at, ","), at);
        if (opt->loads == KN_RHEOMETER_LOADS) return "at most 16 loads";
        if (!kn_quantity_read(one, "N", false, KN_ABOVE_0, DBL_MAX, &opt->load_n[opt->loads++]))
            return "weights above 0 like 50gf or 10gf,30gf,0.5N";
    }
    return NULL;
}

// Read the range of frequencies, LOW:HIGH or LOW:HIGH:NUMBER.
static const char *take_frequencies(void *options, const char *text)
{
    kn_rheometer_options *opt = options;
    char low[48], high[48], rest;
    int number = 25, parts = sscanf(text, "%47[^:]:%47[^:]:%d%c", low, high, &number, &rest);
    opt->frequencies = number;
    if ((parts == 2 || parts == 3) && kn_quantity_read(low, "Hz", true, 1e-9, 1e9, &opt->low_hz) &&
        kn_quantity_read(high, "Hz", true, 1e-9, 1e9, &opt->high_hz) && opt->high_hz > opt->low_hz && number >= 2 &&
        number <= 1000)
        return NULL;
    return "LOW:HIGH or LOW:HIGH:NUMBER like 0.01:100:25, 1e-9 to 1e9 Hz, LOW below HIGH, NUMBER 2 to 1000";
}

// Read the numbers of cells of the lattice, in the form NXxNYxNZ.
static const char *take_lattice(void *lattice, const char *text)
{
    int *n = lattice;
    char rest;
    if (sscanf(text, "%dx%dx%d%c", &n[0], &n[1], &n[2], &rest) == 3 && n[0] > 0 && n[1] > 0 && n[2] > 0 && n[0] <= 64 &&
        n[1] <= 64 && n[2] <= 64)
        return NULL;
    return "cells along x, y, z like 4x4x4, at most 64 each";
}

#define AT(member) .offset = offsetof(kn_rheometer_options, member)
// Options of creep, relax, sweep and tpa. `belongs` lists the first letters of the experiments that accept the option.
static const kn_option rows[] = {
    KN_OPTION("load", SPECIAL, .take = take_loads, .belongs = "c"),
    KN_OPTION("hold", QUANTITY, AT(hold_s), .unit = "s", .expected = "a time like 60 or '1000 ms'", .belongs = "cr"),
    KN_OPTION("rest", QUANTITY, AT(rest_s), .unit = "s", KN_RANGE(0, DBL_MAX),
              .expected = "a time like 70 or '1000 ms'", .belongs = "c"),
    KN_OPTION("strain", SPECIAL, AT(strain), .take = take_share, .belongs = "rt"),
    KN_OPTION("ramp", SPECIAL, AT(ramp_per_s), .take = take_ramp, .belongs = "r"),
    KN_OPTION("freq", SPECIAL, .take = take_frequencies, .belongs = "s"),
    KN_OPTION("speed", QUANTITY, AT(speed_m_s), .unit = "m/s", .expected = "a speed like '1 mm/s'", .belongs = "t"),
    KN_OPTION("amplitude", SPECIAL, AT(amplitude), .take = take_share, .belongs = "s"),
    KN_OPTION("wait", QUANTITY, AT(wait_s), .unit = "s", KN_RANGE(0, DBL_MAX), .expected = "a time like 5 or '1000 ms'",
              .belongs = "t"),
    KN_OPTION("param", LIST, AT(params), .count = offsetof(kn_rheometer_options, param_count)),
    KN_OPTION("set", LIST, AT(sets), .count = offsetof(kn_rheometer_options, set_count)),
    KN_OPTION("area", EITHER, AT(constant_area), .unit = "grows|constant", .expected = "constant or grows",
              .belongs = "crt"),
    KN_OPTION("lattice", SPECIAL, AT(lattice), .take = take_lattice),
    KN_OPTION("table", EITHER, AT(table_sticks), .unit = "slide|stick", .expected = "slide or stick"),
    KN_OPTION("plate", EITHER, AT(plate_slides), .unit = "stick|slide", .expected = "stick or slide"),
    KN_OPTION("adhesion", QUANTITY, AT(adhesion_pa), .unit = "Pa", KN_RANGE(0, 1e7),
              .expected = "a tension from 0 to 10 MPa like '2 kPa'", .belongs = "t"),
    KN_OPTION("csv", TEXT, AT(csv)),
    KN_OPTION("png", TEXT, AT(png)),
    KN_OPTION("json", CALL, .call = kn_result_open),
};

int kn_rheometer_options_parse(kn_rheometer_options *opt, const char *subcommand, const char *help, int argc,
                               char **argv)
{
    const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help, .unknown = "unknown option; --help lists them",
                                   .experiment = *subcommand};
    opt->subcommand = subcommand;
    // Allocate one entry per argument, because an option cannot occur more often than there are arguments.
    opt->params = calloc((size_t)argc, sizeof *opt->params);
    opt->sets = calloc((size_t)argc, sizeof *opt->sets);
    if (!opt->params || !opt->sets) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    const int code = kn_options_read(&table, opt, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (argc - optind != 1)
        return kn_complain(subcommand, KN_EXIT_USAGE,
                           "expected one specimen, a material like dough or an expression like '(s|d)-d'; see --help");
    // A material comes before a scene of the same name. What is neither is an expression.
    int variant;
    opt->specimen = argv[optind];
    if (!kn_library_find(opt->specimen, &variant)) kn_scene_take(&opt->specimen, argv[optind]);
    if (!opt->lattice[0] && (opt->table_sticks || opt->plate_slides))
        return kn_complain(subcommand, KN_EXIT_USAGE, "--table and --plate belong to --lattice, expected it too");
    return code;
}

void kn_rheometer_options_free(kn_rheometer_options *opt)
{
    free(opt->params);
    free(opt->sets);
}
