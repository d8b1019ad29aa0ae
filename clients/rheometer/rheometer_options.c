#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "clients/rheometer/rheometer.h"
#include "core/scene/scene.h"
#include "server/scene_name.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Read a strain rate from a text like "10%/s" or "0.1 1/s". A speed is divided by the height of the cube.
static const char *take_ramp(void *ramp_per_s, const char *text)
{
    if (kn_quantity_read(text, "1/s", false, KN_ABOVE_0, DBL_MAX, ramp_per_s)) return NULL;
    if (!kn_quantity_read(text, "m/s", false, KN_ABOVE_0, DBL_MAX, ramp_per_s))
        return "a strain per second like 10%/s, or a speed like '1 mm/s'";
    *(double *)ramp_per_s /= KN_RHEOMETER_HEIGHT_M;
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
#define SHARE                                                                                                          \
    .unit = "1", KN_RANGE(KN_ABOVE_0, KN_BELOW_1), .expected = "a share of the height between 0 and 100 %, like 10%"
// Options of creep, relax, sweep and tpa. `belongs` lists the first letters of the experiments that accept the option.
static const kn_option rows[] = {
    KN_OPTION("load", QUANTITY, AT(load_n), .unit = "N", .items = KN_RHEOMETER_LOADS,
              .count = offsetof(kn_rheometer_options, loads), .belongs = "c",
              .expected = "at most 16 weights above 0 like 50gf or 10gf,30gf,0.5N"),
    KN_OPTION("hold", QUANTITY, AT(hold_s), .unit = "s", .expected = "a time like 60 or '1000 ms'", .belongs = "cr"),
    KN_OPTION("rest", QUANTITY, AT(rest_s), .unit = "s", KN_RANGE(0, DBL_MAX),
              .expected = "a time like 70 or '1000 ms'", .belongs = "c"),
    KN_OPTION("strain", QUANTITY, AT(strain), SHARE, .belongs = "rt"),
    KN_OPTION("ramp", SPECIAL, AT(ramp_per_s), .take = take_ramp, .belongs = "r"),
    KN_OPTION("frequency", SPECIAL, .take = take_frequencies, .belongs = "s"),
    KN_OPTION("speed", QUANTITY, AT(speed_m_s), .unit = "m/s", .expected = "a speed like '1 mm/s'", .belongs = "t"),
    KN_OPTION("amplitude", QUANTITY, AT(amplitude), SHARE, .belongs = "s"),
    KN_OPTION("wait", QUANTITY, AT(wait_s), .unit = "s", KN_RANGE(0, DBL_MAX), .expected = "a time like 5 or '1000 ms'",
              .belongs = "t"),
    KN_OPTION("param", LIST, AT(params), .count = offsetof(kn_rheometer_options, param_count)),
    KN_OPTION("set", LIST, AT(sets), .count = offsetof(kn_rheometer_options, set_count)),
    KN_OPTION("constant-area", FLAG, AT(constant_area), .belongs = "crt"),
    KN_OPTION("area", RENAMED, .expected = "--constant-area", .belongs = "crt"),
    KN_OPTION("lattice", SPECIAL, AT(lattice), .take = take_lattice),
    KN_OPTION("table", EITHER, AT(table_sticks), .unit = "slide|stick"),
    KN_OPTION("plate", EITHER, AT(plate_slides), .unit = "stick|slide"),
    KN_OPTION("adhesion", QUANTITY, AT(adhesion_pa), .unit = "Pa", KN_RANGE(0, 1e7),
              .expected = "a tension from 0 to 10 MPa like '2 kPa'", .belongs = "t"),
    KN_OPTION("csv", TEXT, AT(csv)),
    KN_OPTION("png", TEXT, AT(png)),
    KN_OPTION("json", CALL, .call = kn_result_open),
};

int kn_rheometer_options_parse(kn_rheometer_options *opt, const char *subcommand, const char *help, int argc,
                               char **argv)
{
    const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help, .experiment = *subcommand};
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
