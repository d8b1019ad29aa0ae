#include "clients/knead/bench.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/result.h"
#include "core/scene/units.h"
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Read a finite number in the given unit. A number without a unit is accepted only if `bare` is true, which means that
// the unit is not ambiguous.
static bool read_quantity(const char *text, const char *unit_text, bool bare, double *value)
{
    kn_unit unit;
    kn_quantity q;
    char why[128];
    if (!kn_unit_parse(&unit, unit_text, why, sizeof why) || !kn_quantity_parse(&q, text, why, sizeof why))
        return false;
    if (q.bare ? !bare : !kn_unit_same_dimension(&q.unit, &unit)) return false;
    *value = kn_quantity_in(&q, &unit);
    return isfinite(*value);
}

static int bad(const kn_bench_options *opt, const char *option, const char *text, const char *expected)
{
    return kn_complain(opt->subcommand, KN_EXIT_USAGE, "--%s %s: expected %s", option, text, expected);
}

// Read the value of an option as a positive quantity. Zero is also accepted if `zero` is true.
static int take_quantity(const kn_bench_options *opt, const char *option, const char *text, const char *unit, bool zero,
                         const char *expected, double *value)
{
    bool bare = !strcmp(unit, "s"); // a number without a unit means seconds, as in all options that take a time
    if (read_quantity(text, unit, bare, value) && (*value > 0 || (zero && *value == 0))) return KN_EXIT_OK;
    return bad(opt, option, text, expected);
}

// Read a share of the specimen's height from a text like "50%" or "0.5".
static int take_share(const kn_bench_options *opt, const char *option, const char *text, double *value)
{
    char number[64];
    const char *percent = strchr(text, '%');
    snprintf(number, sizeof number, "%.*s", (int)strcspn(text, "%"), text);
    bool good = read_quantity(number, "1", true, value) && (!percent || percent[1] == '\0');
    if (percent) *value /= 100;
    if (good && *value > 0 && *value < 1) return KN_EXIT_OK;
    return bad(opt, option, text, "a share of the height between 0 and 100 %, like 10%");
}

// Read a strain rate from a text like "10%/s" or "0.1 1/s". A speed is divided by the height of the cube.
static int take_ramp(kn_bench_options *opt, const char *text)
{
    char number[64];
    const char *percent = strchr(text, '%');
    double *value = &opt->ramp_per_s;
    snprintf(number, sizeof number, "%.*s", (int)strcspn(text, "%"), text);
    bool good = percent ? !strcmp(percent, "%/s") && read_quantity(number, "1", true, value)
                        : read_quantity(text, "1/s", false, value);
    if (percent) *value /= 100;
    // If the text is not a strain rate, read it as a speed of the plate.
    if (!good && (good = read_quantity(text, "m/s", false, value))) *value /= KN_BENCH_HEIGHT_M;
    if (good && *value > 0) return KN_EXIT_OK;
    return bad(opt, "ramp", text, "a strain per second like 10%/s, or a speed like '1 mm/s'");
}

// Read the loads: weights separated by commas.
static int take_loads(kn_bench_options *opt, const char *text)
{
    opt->loads = 0;
    for (const char *at = text; at; at = strchr(at, ',') ? strchr(at, ',') + 1 : NULL) {
        char one[64];
        snprintf(one, sizeof one, "%.*s", (int)strcspn(at, ","), at);
        if (opt->loads == KN_BENCH_LOADS) return bad(opt, "load", text, "at most 16 loads");
        if (!read_quantity(one, "N", false, &opt->load_n[opt->loads]) || !(opt->load_n[opt->loads] > 0))
            return bad(opt, "load", text, "weights above 0 like 50gf or 10gf,30gf,0.5N");
        opt->loads++;
    }
    return KN_EXIT_OK;
}

// Read the range of frequencies, LOW:HIGH or LOW:HIGH:NUMBER.
static int take_frequencies(kn_bench_options *opt, const char *text)
{
    static const char expected[] =
        "LOW:HIGH or LOW:HIGH:NUMBER like 0.01:100:25, 1e-9 to 1e9 Hz, LOW below HIGH, NUMBER 2 to 1000";
    char low[48], high[48], rest;
    int number = 25, parts = sscanf(text, "%47[^:]:%47[^:]:%d%c", low, high, &number, &rest);
    bool good = (parts == 2 || parts == 3) && read_quantity(low, "Hz", true, &opt->low_hz) &&
                read_quantity(high, "Hz", true, &opt->high_hz);
    good = good && opt->low_hz >= 1e-9 && opt->high_hz > opt->low_hz && opt->high_hz <= 1e9;
    if (!good || number < 2 || number > 1000) return bad(opt, "freq", text, expected);
    opt->frequencies = number;
    return KN_EXIT_OK;
}

// Read the numbers of cells of the lattice, in the form NXxNYxNZ.
static int take_lattice(kn_bench_options *opt, const char *text)
{
    int *n = opt->lattice;
    char rest;
    if (sscanf(text, "%dx%dx%d%c", &n[0], &n[1], &n[2], &rest) == 3 && n[0] > 0 && n[1] > 0 && n[2] > 0 && n[0] <= 64 &&
        n[1] <= 64 && n[2] <= 64)
        return KN_EXIT_OK;
    return bad(opt, "lattice", text, "cells along x, y, z like 4x4x4, at most 64 each");
}

enum {
    LOAD = 256,
    HOLD,
    REST,
    STRAIN,
    RAMP,
    FREQ,
    AMPLITUDE,
    SPEED,
    WAIT,
    PARAM,
    SET,
    AREA,
    LATTICE,
    CSV,
    PNG,
    JSON,
    HELP
};

// Command-line options of all four experiments. The function has_option tells which of them an experiment accepts.
static const struct option list[] = {{"load", 1, 0, LOAD},       {"hold", 1, 0, HOLD},
                                     {"rest", 1, 0, REST},       {"strain", 1, 0, STRAIN},
                                     {"ramp", 1, 0, RAMP},       {"freq", 1, 0, FREQ},
                                     {"speed", 1, 0, SPEED},     {"amplitude", 1, 0, AMPLITUDE},
                                     {"wait", 1, 0, WAIT},       {"param", 1, 0, PARAM},
                                     {"set", 1, 0, SET},         {"area", 1, 0, AREA},
                                     {"lattice", 1, 0, LATTICE}, {"csv", 1, 0, CSV},
                                     {"png", 1, 0, PNG},         {"json", 0, 0, JSON},
                                     {"help", 0, 0, HELP},       {0, 0, 0, 0}};

// Return true if the experiment accepts the option. All experiments accept param, set, csv, png, json and help.
static bool has_option(const char *subcommand, int option)
{
    static const struct {
        const char *subcommand;
        int option[8];
    } own[] = {{"creep", {LOAD, HOLD, REST, AREA, LATTICE}},
               {"relax", {STRAIN, RAMP, HOLD, AREA, LATTICE}},
               {"sweep", {FREQ, AMPLITUDE}},
               {"tpa", {STRAIN, SPEED, WAIT, AREA}}};
    for (size_t i = 0; i < sizeof own / sizeof *own; i++)
        for (int k = 0; k < 8 && !strcmp(own[i].subcommand, subcommand); k++)
            if (own[i].option[k] == option) return true;
    return option == PARAM || option == SET || option == CSV || option == PNG || option == JSON || option == HELP;
}

// Store the value of one option. Return 0, or print an error and return an exit code.
static int take_option(kn_bench_options *opt, int option, const char *value)
{
    switch (option) {
    case LOAD: return take_loads(opt, value);
    case HOLD: return take_quantity(opt, "hold", value, "s", false, "a time like 60 or '1000 ms'", &opt->hold_s);
    case REST: return take_quantity(opt, "rest", value, "s", true, "a time like 70 or '1000 ms'", &opt->rest_s);
    case WAIT: return take_quantity(opt, "wait", value, "s", true, "a time like 5 or '1000 ms'", &opt->wait_s);
    case SPEED: return take_quantity(opt, "speed", value, "m/s", false, "a speed like '1 mm/s'", &opt->speed_m_s);
    case STRAIN: return take_share(opt, "strain", value, &opt->strain);
    case AMPLITUDE: return take_share(opt, "amplitude", value, &opt->amplitude);
    case RAMP: return take_ramp(opt, value);
    case FREQ: return take_frequencies(opt, value);
    case LATTICE: return take_lattice(opt, value);
    case AREA:
        opt->constant_area = !strcmp(value, "constant");
        return opt->constant_area || !strcmp(value, "grows") ? KN_EXIT_OK
                                                             : bad(opt, "area", value, "constant or grows");
    case PARAM: opt->params[opt->param_count++] = value; return KN_EXIT_OK;
    case SET: opt->sets[opt->set_count++] = value; return KN_EXIT_OK;
    case CSV: opt->csv = value; return KN_EXIT_OK;
    case JSON: kn_result_open(); return KN_EXIT_OK;
    default: opt->png = value; return KN_EXIT_OK;
    }
}

int kn_bench_options_parse(kn_bench_options *opt, const char *subcommand, const char *help, int argc, char **argv,
                           bool *done)
{
    opt->subcommand = subcommand;
    // Allocate one entry per argument, because an option cannot occur more often than there are arguments.
    opt->params = calloc((size_t)argc, sizeof *opt->params);
    opt->sets = calloc((size_t)argc, sizeof *opt->sets);
    if (!opt->params || !opt->sets) return kn_complain(subcommand, KN_EXIT_DEVICE, "out of memory");
    optind = 1;
    for (int c; (c = getopt_long(argc, argv, ":", list, NULL)) != -1;) {
        if (c == HELP) {
            fputs(help, stdout);
            *done = true;
            return KN_EXIT_OK;
        }
        // Treat an option that belongs to a different experiment as an unknown option.
        if (c == '?' || c == ':' || !has_option(subcommand, c)) {
            // Find the option as the user wrote it, without its value, for the error message.
            const char *written = c == '?' || c == ':' || !optarg ? argv[optind - 1] : argv[optind - 2];
            return kn_complain(subcommand, KN_EXIT_USAGE, "%s: %s", written,
                               c == ':' ? "expected a value" : "unknown option; --help lists them");
        }
        int code = take_option(opt, c, optarg);
        if (code != KN_EXIT_OK) return code;
    }
    if (argc - optind != 1)
        return kn_complain(subcommand, KN_EXIT_USAGE,
                           "expected one specimen, a material like dough or an expression like '(s|d)-d'; see --help");
    opt->specimen = argv[optind];
    return KN_EXIT_OK;
}

void kn_bench_options_free(kn_bench_options *opt)
{
    free(opt->params);
    free(opt->sets);
}
