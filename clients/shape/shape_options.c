#include "clients/shape/shape_command.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/cli/result.h"
#include "core/scene/keys.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead identify shape SCENE --depth IMAGE.png [--force FILE.csv | --log LOG] [OPTION]...\n"
    "       knead identify shape SCENE --points FILE.csv [--force FILE.csv | --log LOG] [OPTION]...\n\n"
    "Find the structure of the first paper that behaves like a pressed specimen: diagonals, inside pressure, or\n"
    "both. The scene gives the object, its material (see knead identify creep) and the tool. Each structure is\n"
    "pressed as the specimen was, and is fitted to the measured surface and the measured force. The fit finds the\n"
    "inside pressure P0 and the stress area gamma of the edges. It weights measurements by their noise.\n\n"
    "measurements:\n"
    "  --depth FILE      range image from above, as knead view --depth writes it: PNG of 16-bit grey; up to 4 images\n"
    "  --points FILE     points on the surface, in the scene's frame: columns x, y and z with their units\n"
    "  --at WHEN[,WHEN]  time of each surface: hold (end of the hold), end (of the press), or a time since the press\n"
    "                    began; with --log, a time as in knead view --at (default: hold; with --log: end)\n"
    "  --force FILE      contact force over time: a column in s, one in N, gf or the like; used up to the end of the\n"
    "                    hold\n"
    "  --force-begin TIME\n"
    "                    time in the force file at which the press begins (default: 0)\n"
    "  --align           fit a small shift of all images, for images whose stated place is not exact\n"
    "  --step L, --pixel L, --left L, --top L\n"
    "                    height of a grey level, side of a pixel, x and y of the first pixel's centre, e.g. '0.1 mm',\n"
    "                    for images that do not state these values or state wrong ones\n\n"
    "press:\n"
    "  --log LOG         press as in this recording, and use its forces unless --force is given\n"
    "                    (default: the first paper's press, which the next three options change)\n"
    "  --down L          depth of the press below the top of the object (default: '10 mm')\n"
    "  --speed V         speed of the tool (default: '10 mm/s')\n"
    "  --hold TIME       time at the lowest position (default: '30 s')\n"
    "  --probe NAME      tool that presses (default: the first plate; without a plate, the first probe;\n"
    "                    with --log: the first tool that touches the object)\n\n"
    "structures:\n"
    "  --only LIST       structures to fit: diagonals, pressure, both, mesh, mesh-pressure (default: all possible\n"
    "                    ones)\n"
    "  --mesh FILE --mesh-unit mm\n"
    "                    tetrahedra that fill the object; adds two structures, with and without gas\n"
    "  --set KEY=VALUE   set any key of the scene\n"
    "  --finer           press the best structure once more with cells half as wide, which takes about ten times as\n"
    "                    long; this shows how much of the misfit comes from the lattice\n\n"
    "results:\n"
    "  --out FILE        scene with the best structure and its parameters; kneadd loads it\n"
    "  --out-depth FILE  range image of the best structure, in the frame of the first --depth image\n"
    "  --png FILE        plot of the measurement, the result, their difference and the forces (needs gnuplot)\n"
    "  --json            print the results as JSON\n\n"
    "columns of the table:\n"
    "  P0 atm, gamma     best values with 95 % intervals, which are valid if the model is right\n"
    "  rms mm, outline   rms misfit of the height and of the outline, mm\n"
    "  force%            rms misfit of the force, % of the largest force\n"
    "  bulge x, y        how far the sides stand out, mm, as \"MEASURED > MODEL\"; in an image, at the widest place\n"
    "  off               rms residual in units of the noise\n"
    "  dAICc             AICc minus that of the best structure; with 10 or more, a structure has hardly any support.\n"
    "                    For the intervals and dAICc, neighbouring residuals that agree count as fewer readings\n"
    "  stopped early     the misfit is so large that the search ended before the fit was exact\n"
    "  not settled       the fit reached the limit of presses\n\n"
    "Examples:\n"
    "    knead view press.lcmlog --at 4 --depth dent.png\n"
    "    knead identify shape dough-small --log press.lcmlog --depth dent.png --at 4 --only both --out found.yaml\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 a file cannot be written.\n";
// clang-format on

#define REFUSE(...) return kn_complain("identify shape", KN_EXIT_USAGE, __VA_ARGS__)

static const char *take_moment(void *at_s, const char *text)
{
    double *moment = at_s;
    *moment = !strcmp(text, "hold") ? KN_SHAPE_HOLD : INFINITY;
    const bool word = !strcmp(text, "hold") || !strcmp(text, "end");
    return word || kn_quantity_read(text, "s", true, 0, 3600, moment) ? NULL : "";
}

// Parse a time. A field of 0 means the default, so a hold of 0 s is stored as -1.
static const char *take_hold(void *hold_s, const char *text)
{
    double *hold = hold_s;
    if (!kn_quantity_read(text, "s", true, 0, 3600, hold)) return "a time from 0 to 3600 s";
    if (*hold == 0) *hold = -1;
    return NULL;
}

// Check the options against each other and fill in the default moments.
static int check(kn_shape_options *o, int argc, char **argv)
{
    if (argc - optind != 1)
        REFUSE("expected one scene%s; see knead identify shape --help", argc > optind ? ", and options" : "");
    if (kn_command_scene("identify shape", &o->scene.scene_path, argv[optind]) != KN_EXIT_OK) return KN_EXIT_USAGE;
    // At least one surface is needed. --at may give one time for each surface.
    const int surfaces = o->depths + (o->points != NULL);
    if (surfaces == 0) REFUSE("expected a shape: --depth IMAGE.png or --points FILE.csv");
    if (surfaces > KN_PRESS_MOMENTS) REFUSE("--points: expected at most %d surfaces", KN_PRESS_MOMENTS);
    if (o->moments > surfaces) REFUSE("--at: %d times for %d surfaces, expected one for each", o->moments, surfaces);
    for (int i = o->moments; i < surfaces; i++) o->at_s[i] = o->log ? INFINITY : KN_SHAPE_HOLD;
    if (o->log && (o->press.depth_m > 0 || o->press.speed_m_s > 0 || o->press.hold_s != 0))
        REFUSE("--down, --speed, --hold: expected no --log, because the log contains the press");
    if (o->force_begin_s != 0 && !o->force) REFUSE("--force-begin: expected --force");
    if ((o->align || o->out_depth) && o->depths == 0) REFUSE("--align, --out-depth: expected --depth");
    if (!o->scene.mesh != !o->scene.mesh_unit) REFUSE("--mesh: expected --mesh-unit with it: m, cm, mm or um");
    if (o->scene.mesh_unit && kn_choice_of("m|cm|mm|um", o->scene.mesh_unit) < 0)
        REFUSE("--mesh-unit %s: expected m, cm, mm or um", o->scene.mesh_unit);
    return KN_OPTIONS_READ;
}

#define AT(member) .offset = offsetof(kn_shape_options, member)
#define COUNT(member) .count = offsetof(kn_shape_options, member)
static const kn_option rows[] = {
    KN_OPTION("depth", LIST, AT(depth), COUNT(depths), .most = KN_PRESS_MOMENTS, .expected = "at most 4 images"),
    KN_OPTION("points", TEXT, AT(points)),
    KN_OPTION("at", SPECIAL, AT(at_s), COUNT(moments), .items = KN_PRESS_MOMENTS, .take = take_moment,
              .expected = "hold, end, or seconds from 0 to 3600; up to 4, separated by commas"),
    KN_OPTION("force", TEXT, AT(force)),
    KN_OPTION("force-begin", QUANTITY, AT(force_begin_s), .unit = "s", KN_RANGE(-1e6, 1e6), .expected = "seconds"),
    KN_OPTION("align", FLAG, AT(align)),
    KN_OPTION("step", QUANTITY, AT(given.step_m), .unit = "m", KN_RANGE(1e-9, 0.1),
              .expected = "a height above 0 like '0.1 mm'"),
    KN_OPTION("pixel", QUANTITY, AT(given.pixel_m), .unit = "m", KN_RANGE(1e-7, 0.1),
              .expected = "a length above 0 like '0.1 mm'"),
    KN_OPTION("left", QUANTITY, AT(given.left_m), .unit = "m", KN_RANGE(-10, 10), .expected = "a place like '-32 mm'"),
    KN_OPTION("top", QUANTITY, AT(given.top_m), .unit = "m", KN_RANGE(-10, 10), .expected = "a place like '32 mm'"),
    KN_OPTION("log", TEXT, AT(log)),
    KN_OPTION("down", QUANTITY, AT(press.depth_m), .unit = "m", KN_RANGE(1e-5, 1),
              .expected = "a depth above 0 like '10 mm'"),
    KN_OPTION("speed", QUANTITY, AT(press.speed_m_s), .unit = "m/s", KN_RANGE(1e-5, 1),
              .expected = "a speed above 0 like '10 mm/s'"),
    KN_OPTION("hold", SPECIAL, AT(press.hold_s), .take = take_hold),
    KN_OPTION("probe", TEXT, AT(press.probe)),
    KN_OPTION("only", TEXT, AT(only)),
    KN_OPTION("finer", FLAG, AT(finer)),
    KN_OPTION("mesh", TEXT, AT(scene.mesh)),
    KN_OPTION("mesh-unit", TEXT, AT(scene.mesh_unit)),
    KN_OPTION("set", LIST, AT(sets), COUNT(scene.set_count)),
    KN_OPTION("out", TEXT, AT(out)),
    KN_OPTION("out-depth", TEXT, AT(out_depth)),
    KN_OPTION("png", TEXT, AT(png)),
    KN_OPTION("json", CALL, .call = kn_result_open),
};

int kn_shape_options_parse(kn_shape_options *o, int argc, char **argv)
{
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    const double none = (double)NAN;
    *o = (kn_shape_options){.given = {none, none, none, none}};
    o->sets = calloc((size_t)argc + 1, sizeof *o->sets);
    if (!o->sets) return kn_complain("identify shape", KN_EXIT_INTERNAL, "out of memory");
    o->scene.sets = o->sets;
    const int code = kn_options_read(&table, o, argc, argv);
    return code == KN_OPTIONS_READ ? check(o, argc, argv) : code;
}

void kn_shape_options_free(kn_shape_options *o) { free(o->sets); }
