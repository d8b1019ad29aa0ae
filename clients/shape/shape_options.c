#include "clients/shape/shape_options.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/number.h"
#include "clients/knead/result.h"
#include "core/scene/units.h"
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char help[] =
    "usage: knead identify shape SCENE --depth IMAGE.png [--force FILE.csv | --log LOG] [OPTION]...\n"
    "       knead identify shape SCENE --points FILE.csv [--force FILE.csv | --log LOG] [OPTION]...\n\n"
    "Find the structure of the first paper that behaves like a pressed specimen: diagonals, inside pressure, or both. "
    "Fit\n"
    "its inside pressure P0 and the stress area gamma of its edges. The scene gives the object, its material (see "
    "knead\n"
    "identify creep) and the tool. Each structure is pressed as the specimen was, and its parameters are fitted to "
    "the\n"
    "measurements: the surface seen from above, and the force, each weighted by its own noise.\n\n"
    "    knead identify shape dough.yaml --depth dent-range.png --force force.csv --out found.yaml\n"
    "    knead identify shape dough.yaml --log press.lcmlog --depth held.png --at 36\n"
    "    knead identify shape bun.yaml --points scan.csv --at end --probe finger\n\n"
    "measurements:\n"
    "  --depth FILE      range image from above, as knead view --depth writes it: PNG of 16-bit grey; up to 4\n"
    "  --points FILE     points on the surface, m in the scene's frame: columns x, y, z with their units\n"
    "  --at WHEN[,WHEN]  time of each image: hold (its end), end (of the whole press), or seconds from the begin of "
    "the\n"
    "                    press, with --log as in knead view --at (default: hold; with --log: end)\n"
    "  --force FILE      contact force over time: a column in s, one in N, gf or the like; compared until the hold "
    "ends\n"
    "  --force-begin S   begin of the press on the clock of the force file, seconds (default: 0)\n"
    "  --align           fit a small shift of the images, as for a foreign camera, to fractions of a pixel\n"
    "  --step L, --pixel L, --left L, --top L    for images that do not state it, or instead of their texts: height of "
    "a\n"
    "                    grey level, side of a pixel, x and y of the centre of the first pixel, e.g. '0.1 mm'\n"
    "press:\n"
    "  --log LOG         use the poses of a recording, and its forces unless --force is given (default: the paper's "
    "press,\n"
    "                    given by the next three options)\n"
    "  --down L          depth below the top (default: '10 mm')\n"
    "  --speed V         speed of the tool (default: '10 mm/s')\n"
    "  --hold TIME       time at the bottom (default: '30 s')\n"
    "  --probe NAME      tool that presses (default: the first plate, else the first probe; with --log: the first one "
    "that\n"
    "                    touches the object)\n"
    "structures:\n"
    "  --only LIST       list of diagonals, pressure, both, mesh, mesh-pressure (default: all that the scene can "
    "have)\n"
    "  --mesh FILE --mesh-unit mm    tetrahedra of the same object, as one more structure, with and without gas\n"
    "  --set KEY=VALUE   set any key of the scene\n"
    "  --jobs N          structures to fit at the same time, 1 to 64 (default: the number of processors)\n"
    "  --finer           press the best structure once more with cells half as wide, to find the lattice's part of "
    "the\n"
    "                    misfit; takes about ten times as long as a press\n"
    "output:\n"
    "  --out FILE        scene with the best structure and its parameters; kneadd loads it\n"
    "  --out-depth FILE  range image of the best structure, in the frame of the first --depth\n"
    "  --png FILE        plot of the measurement, the result, their difference and the forces, by gnuplot\n"
    "  --json            print the results as JSON\n\n"
    "Columns: P0 and gamma with 95 % intervals, valid if the model is right; rms of the height, of the outline and, "
    "over\n"
    "its largest value, of the force; bulge of the sides along x and y, measured > model; off: rms residual in units "
    "of the\n"
    "noise; dAICc: difference from the best structure (at 10, hardly any support is left). Neighbouring residuals that "
    "agree\n"
    "count as fewer readings. A view from above shows the widest place of a side, not its height. At the end of a "
    "row:\n"
    "\"stopped early\" means that the misfit is so large that the last per cent was not searched for; \"not settled\" "
    "means\n"
    "that the limit of presses was reached.\n"
    "Exit codes: 0 ok, 2 bad input, 3 a file cannot be written.\n";

enum {
    DEPTH = 256,
    POINTS,
    AT,
    FORCE,
    FORCE_BEGIN,
    ALIGN,
    STEP,
    PIXEL,
    LEFT,
    TOP,
    LOG,
    DOWN,
    SPEED,
    HOLD,
    PROBE,
    ONLY,
    FINER,
    MESH,
    MESH_UNIT,
    SET,
    JOBS,
    OUT,
    OUT_DEPTH,
    PNG,
    JSON,
    HELP
};

static const struct option list[] = {{"depth", 1, 0, DEPTH},
                                     {"points", 1, 0, POINTS},
                                     {"at", 1, 0, AT},
                                     {"force", 1, 0, FORCE},
                                     {"force-begin", 1, 0, FORCE_BEGIN},
                                     {"align", 0, 0, ALIGN},
                                     {"step", 1, 0, STEP},
                                     {"pixel", 1, 0, PIXEL},
                                     {"left", 1, 0, LEFT},
                                     {"top", 1, 0, TOP},
                                     {"log", 1, 0, LOG},
                                     {"down", 1, 0, DOWN},
                                     {"speed", 1, 0, SPEED},
                                     {"hold", 1, 0, HOLD},
                                     {"probe", 1, 0, PROBE},
                                     {"only", 1, 0, ONLY},
                                     {"finer", 0, 0, FINER},
                                     {"mesh", 1, 0, MESH},
                                     {"mesh-unit", 1, 0, MESH_UNIT},
                                     {"set", 1, 0, SET},
                                     {"jobs", 1, 0, JOBS},
                                     {"out", 1, 0, OUT},
                                     {"out-depth", 1, 0, OUT_DEPTH},
                                     {"png", 1, 0, PNG},
                                     {"json", 0, 0, JSON},
                                     {"help", 0, 0, HELP},
                                     {0, 0, 0, 0}};

#define REFUSE(...) return kn_complain("identify shape", KN_EXIT_USAGE, __VA_ARGS__)

// Parse a quantity of this dimension; seconds may be bare.
static bool take_si(const char *text, const char *unit_text, double least, double most, double *value)
{
    kn_unit unit;
    kn_quantity q;
    char why[128];
    if (!kn_unit_parse(&unit, unit_text, why, sizeof why) || !kn_quantity_parse(&q, text, why, sizeof why))
        return false;
    if (q.bare ? strcmp(unit_text, "s") != 0 : !kn_unit_same_dimension(&q.unit, &unit)) return false;
    *value = kn_quantity_in(&q, &unit);
    return *value >= least && *value <= most;
}

// Parse a list of moments like "hold,end,3.5".
static bool take_moments(const char *text, kn_shape_options *o)
{
    for (o->moments = 0; o->moments < KN_PRESS_MOMENTS;) {
        const size_t n = strcspn(text, ",");
        char one[32];
        double *at_s = &o->at_s[o->moments++];
        if (n == 0 || n >= sizeof one) return false;
        snprintf(one, sizeof one, "%.*s", (int)n, text);
        if (!strcmp(one, "hold")) *at_s = KN_SHAPE_HOLD;
        else if (!strcmp(one, "end")) *at_s = INFINITY;
        else if (!take_si(one, "s", 0, 3600, at_s)) return false;
        if (!text[n]) return true;
        text += n + 1;
    }
    return false;
}

// Parse a whole number of jobs.
static bool take_jobs(const char *text, int *jobs)
{
    double value;
    if (!kn_number_take(text, 1, 64, &value) || value != floor(value)) return false;
    *jobs = (int)value;
    return true;
}

// Take one option. Return NULL, or a phrase that says what was expected.
static const char *take(kn_shape_options *o, int option, const char *text)
{
    switch (option) {
    case DEPTH:
        if (o->depths == KN_PRESS_MOMENTS) return "at most 4 images";
        o->depth[o->depths++] = text;
        return NULL;
    case POINTS: o->points = text; return NULL;
    case AT: return take_moments(text, o) ? NULL : "hold, end, or seconds from 0 to 3600; up to 4, separated by commas";
    case FORCE: o->force = text; return NULL;
    case FORCE_BEGIN: return take_si(text, "s", -1e6, 1e6, &o->force_begin_s) ? NULL : "seconds";
    case ALIGN: o->align = true; return NULL;
    case STEP: return take_si(text, "m", 1e-9, 0.1, &o->given.step_m) ? NULL : "a height above 0 like '0.1 mm'";
    case PIXEL: return take_si(text, "m", 1e-7, 0.1, &o->given.pixel_m) ? NULL : "a length above 0 like '0.1 mm'";
    case LEFT: return take_si(text, "m", -10, 10, &o->given.left_m) ? NULL : "a place like '-32 mm'";
    case TOP: return take_si(text, "m", -10, 10, &o->given.top_m) ? NULL : "a place like '32 mm'";
    case LOG: o->log = text; return NULL;
    case DOWN: return take_si(text, "m", 1e-5, 1, &o->press.depth_m) ? NULL : "a depth above 0 like '10 mm'";
    case SPEED: return take_si(text, "m/s", 1e-5, 1, &o->press.speed_m_s) ? NULL : "a speed above 0 like '10 mm/s'";
    case HOLD:
        if (!take_si(text, "s", 0, 3600, &o->press.hold_s)) return "a time from 0 to 3600 s";
        // A field of 0 means the default, so a hold of 0 s is stored as -1.
        if (o->press.hold_s == 0) o->press.hold_s = -1;
        return NULL;
    case PROBE: o->press.probe = text; return NULL;
    case ONLY: o->only = text; return NULL;
    case FINER: o->finer = true; return NULL;
    case MESH: o->scene.mesh = text; return NULL;
    case MESH_UNIT: o->scene.mesh_unit = text; return NULL;
    case SET: o->sets[o->scene.set_count++] = text; return NULL;
    case JOBS: return take_jobs(text, &o->jobs) ? NULL : "a whole number from 1 to 64";
    case OUT: o->out = text; return NULL;
    case OUT_DEPTH: o->out_depth = text; return NULL;
    case PNG: o->png = text; return NULL;
    case JSON: kn_result_open(); return NULL;
    default: o->help = true; return NULL;
    }
}

// Check the options against each other and fill in the default moments.
static int check(kn_shape_options *o, int argc, char **argv)
{
    if (argc - optind != 1) REFUSE("expected one scene%s; --help tells the rest", argc > optind ? ", and options" : "");
    o->scene.scene_path = argv[optind];
    // At least one surface is needed, with at most one moment for each.
    const int surfaces = o->depths + (o->points != NULL);
    if (surfaces == 0) REFUSE("expected a shape: --depth IMAGE.png or --points FILE.csv");
    if (surfaces > KN_PRESS_MOMENTS) REFUSE("--points: expected at most %d surfaces", KN_PRESS_MOMENTS);
    if (o->moments > surfaces) REFUSE("--at: %d times for %d surfaces, expected one for each", o->moments, surfaces);
    for (int i = o->moments; i < surfaces; i++) o->at_s[i] = o->log ? INFINITY : KN_SHAPE_HOLD;
    if (o->log && (o->press.depth_m > 0 || o->press.speed_m_s > 0 || o->press.hold_s != 0))
        REFUSE("--down, --speed, --hold: expected no --log, which contains the press");
    if (o->force_begin_s != 0 && !o->force) REFUSE("--force-begin: expected --force");
    if ((o->align || o->out_depth) && o->depths == 0) REFUSE("--align, --out-depth: expected --depth");
    if (!o->scene.mesh != !o->scene.mesh_unit) REFUSE("--mesh: expected --mesh-unit with it: m, cm, mm or um");
    if (o->scene.mesh_unit && strcmp(o->scene.mesh_unit, "m") != 0 && strcmp(o->scene.mesh_unit, "cm") != 0 &&
        strcmp(o->scene.mesh_unit, "mm") != 0 && strcmp(o->scene.mesh_unit, "um") != 0)
        REFUSE("--mesh-unit %s: expected m, cm, mm or um", o->scene.mesh_unit);
    return KN_EXIT_OK;
}

int kn_shape_options_parse(kn_shape_options *o, int argc, char **argv)
{
    const double none = (double)NAN;
    int option, which = 0;
    *o = (kn_shape_options){.given = {none, none, none, none},
                            .jobs = (int)fmax(1, (double)sysconf(_SC_NPROCESSORS_ONLN))};
    o->sets = calloc((size_t)argc + 1, sizeof *o->sets);
    if (!o->sets) return kn_complain("identify shape", KN_EXIT_INTERNAL, "out of memory");
    o->scene.sets = o->sets;
    opterr = 0; // getopt prints nothing; this function complains itself
    optind = 0; // restart getopt, in case of a second call in one process
    while ((option = getopt_long(argc, argv, ":h", list, &which)) != -1) {
        const char *word = argv[optind - 1];
        if (option == ':') REFUSE("%s: expected a value", word);
        if (option == '?') REFUSE("%s: unknown option; --help lists them", word);
        const char *expected = take(o, option == 'h' ? HELP : option, optarg);
        if (expected) REFUSE("--%s %s: expected %s", list[which].name, optarg, expected);
    }
    if (o->help) fputs(help, stdout);
    return o->help ? KN_EXIT_OK : check(o, argc, argv);
}

void kn_shape_options_free(kn_shape_options *o) { free(o->sets); }
