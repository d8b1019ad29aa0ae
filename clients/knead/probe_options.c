#include "clients/knead/probe_options.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "clients/hand/bus_client.h"
#include "clients/hand/virtual_hand.h"
#include "core/scene/keys.h"
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static const char help[] =
    "usage: knead probe [--path press|sine|poke|FILE.csv] [OPTION]...\n\n"
    "A virtual haptic device at 1 kHz: it engages in air, plays a path on the object that kneadd serves, and prints\n"
    "a table of the forces. Its own watchdog goes to 0 N 20 ms after the last force. After a trip of this watchdog\n"
    "or of kneadd's it prints the reason, lifts the tool, opens a new session and repeats the path, three tries in\n"
    "all.\n\n"
    "  --path press     touch at rest, go at 1 cm/s to 1 cm below the top of the block, hold, withdraw (the\n"
    "                   default)\n"
    "  --path sine      touch at rest, oscillate between there and 1 mm below\n"
    "  --path poke      go 3 mm deep at 5 cm/s and out again\n"
    "  --path FILE.csv  rows time_s,x_m,y_m,z_m or time_s,x_m,y_m,z_m,qw,qx,qy,qz under such a header; metres, z\n"
    "                   up, origin under the object's centre; the path must begin clear of the object and last a\n"
    "                   day at most\n"
    "  --probe NAME     tool of the scene (default: the first for press, else the first round tool, because dough\n"
    "                   is a wall to a fast plate)\n"
    "  --hold TIME      press: time at the lowest point; sine: duration, e.g. '4 s' or 4 (default: 4 s)\n"
    "  --depth LENGTH   press: depth below the top of the untouched block; else below the point of touch,\n"
    "                   e.g. '10 mm' (default: press 10 mm, sine 1 mm, poke 3 mm)\n"
    "  --speed SPEED    speed in the object, e.g. '1 cm/s' (default: press 1 cm/s, poke 5 cm/s)\n"
    "  --frequency F    frequency of the sine, e.g. '2 Hz' (default: 2 Hz)\n"
    "  --record FILE    record the session as an LCM event log: knead replay FILE --verify gives the same forces\n"
    "  --csv FILE       write one row per force, with the columns of knead replay --csv\n"
    "  --motors FILE    write a CSV with one row per ms of the device's clock: its position and the force it gives,\n"
    "                   even if no force was received\n"
    "  --tries N        number of tries, 1 to 3 (default: 3)\n"
    "  --drop-at S:MS   fault injection: S seconds into the first try send no pose for MS milliseconds\n"
    "  --lcm-url URL    bus of poses and forces (default: LCM_DEFAULT_URL, else " KN_FORCE_URL ")\n"
    "  --mesh-url URL   bus of meshes (default: " KN_MESH_URL ")\n"
    "  --quiet          print no progress and no table\n"
    "  --json           print the table of a completed session as JSON\n\n"
    "With --hand the path is only what the hand intends: a simulated haptic device goes where arm, grip and the\n"
    "returned force take it. The table then ends with the device's figures, and says whether it buzzed or drove the\n"
    "hand.\n\n"
    "  --hand HAND      light, normal, firm, or none: the device is moved into place and released, and 1 N leans on\n"
    "                   it, along z alone\n"
    "  --device CLASS   touch, falcon, omega, unknown, bench, or a FILE.yaml with a device: section (default: the\n"
    "                   scene's)\n"
    "  --axes N         1: free along z, bound to the path along x and y; 3: free along all three (default: 3)\n"
    "  --delay TIME     round trip added by a simulated link, whole ms, 255 ms at most\n"
    "  --loss SHARE     share of the poses and of the forces that this link loses: 20% or 0.2\n"
    "  --local          render the local model that kneadd --local-model sends, instead of its forces\n"
    "  --held           also render forces older than 5 ms, which no device should do, to study the effect. They\n"
    "                   are refused without this option\n\n"
    "Exit codes: 0 the path was played to its end, 1 it was, but the device buzzed or gave the hand more than 10\n"
    "mJ, 2 bad input, 3 no answer, forces older than 5 ms, or three interrupted tries.\n";

// Default of kneadd's brake_m_s; kneadd damps a faster tool instead of following it.
static const double fastest_m_s = 1.2;

// Parse SECONDS:MILLISECONDS of --drop-at.
static const char *take_drop(void *options, const char *text)
{
    kn_probe_options *opt = options;
    double at_s = -1.0;
    char rest;
    const int parts = sscanf(text, "%lf:%d%c", &at_s, &opt->drop_ms, &rest);
    opt->drop_at_ms = at_s >= 0.0 && at_s < 1e6 ? (int)lround(1e3 * at_s) : -1;
    return parts == 2 && opt->drop_at_ms >= 0 && opt->drop_ms > 0 ? NULL : "SECONDS:MILLISECONDS like 1.5:30";
}

// Parse the delay of a simulated link in whole ms. kn_closed_loop_hand keeps 256 slots, one for each ms.
static const char *take_delay(void *delay_ms, const char *text)
{
    int *value = delay_ms;
    double s;
    if (!strcmp(text, "0") || !strcmp(text, "0 ms")) return NULL;
    if (!kn_quantity_read(text, "s", true, KN_ABOVE_0, DBL_MAX, &s)) return "something like '20 ms'";
    *value = (int)lround(1e3 * s);
    return s < 0.2555 && fabs(1e3 * s - *value) < 1e-6 ? NULL : "whole milliseconds, at most 255";
}

static const char *take_grip(void *grip, const char *name) { return kn_grip_find(name, grip) ? NULL : kn_grip_names; }

static const char *take_axes(void *axes, const char *text)
{
    *(int *)axes = *text - '0';
    return !strcmp(text, "1") || !strcmp(text, "3") ? NULL : "1 or 3";
}

#define REFUSE(...) return fprintf(stderr, "knead probe: " __VA_ARGS__), KN_EXIT_USAGE

// Check the speed of a sine. A swing of depth d at frequency f is d/2 (1 - cos 2 pi f t), so its peak speed is pi f d.
static int check_sine(const kn_tool_path_def *shape)
{
    double f = shape->frequency_hz > 0.0 ? shape->frequency_hz : KN_TOOL_PATH_SWING_HZ;
    double d = shape->depth_m > 0.0 ? shape->depth_m : KN_TOOL_PATH_SWING_M, peak_m_s = acos(-1.0) * f * d;
    if (peak_m_s <= fastest_m_s) return KN_OPTIONS_READ;
    REFUSE("a sine of %g Hz and %g mm is %.3g m/s fast, expected at most %g m/s: %.3g Hz at this depth\n", f, 1e3 * d,
           peak_m_s, fastest_m_s, fastest_m_s / (acos(-1.0) * d));
}

// Check conditions between options, now that all options are known.
static int check(const kn_probe_options *opt)
{
    char error[256];
    // Options of a simulated device mean nothing without --hand.
    const char *alone = opt->device       ? "--device"
                        : opt->axes       ? "--axes"
                        : opt->delay_ms   ? "--delay"
                        : opt->local      ? "--local"
                        : opt->held       ? "--held"
                        : opt->loss > 0.0 ? "--loss"
                                          : NULL;
    if (opt->gripped && opt->local && opt->held)
        REFUSE("--held with --local, which renders no force of kneadd's, expected one of them\n");
    if (alone && !opt->gripped) REFUSE("%s without a hand on a device, expected --hand too\n", alone);
    if (kn_choice_of("press|sine|poke", opt->path) < 0 && access(opt->path, R_OK) != 0)
        REFUSE("--path %s: expected press, sine, poke or a CSV file (%s)\n", opt->path, strerror(errno));
    if (!kn_bus_client_check(opt->lcm_url, KN_FORCE_URL, error, sizeof error) ||
        !kn_bus_client_check(opt->mesh_url, KN_MESH_URL, error, sizeof error))
        REFUSE("%s\n", error);
    return KN_OPTIONS_READ;
}

#define AT(member) .offset = offsetof(kn_probe_options, member)
static const kn_option rows[] = {
    KN_OPTION("path", TEXT, AT(path)),
    KN_OPTION("probe", TEXT, AT(probe)),
    KN_OPTION("hold", QUANTITY, AT(shape.hold_s), .unit = "s", KN_RANGE(0, DBL_MAX),
              .expected = "something like '4 s'"),
    KN_OPTION("depth", QUANTITY, AT(shape.depth_m), .unit = "m", .expected = "something like '10 mm'"),
    KN_OPTION("speed", QUANTITY, AT(shape.speed_m_s), .unit = "m/s", .expected = "something like '1 cm/s'"),
    KN_OPTION("frequency", QUANTITY, AT(shape.frequency_hz), .unit = "Hz", .expected = "something like '2 Hz'"),
    KN_OPTION("record", TEXT, AT(record)),
    KN_OPTION("csv", TEXT, AT(csv)),
    KN_OPTION("motors", TEXT, AT(motors)),
    KN_OPTION("tries", INTEGER, AT(tries), KN_RANGE(1, KN_HAND_TRIES)),
    KN_OPTION("drop-at", SPECIAL, .take = take_drop),
    KN_OPTION("lcm-url", TEXT, AT(lcm_url)),
    KN_OPTION("mesh-url", TEXT, AT(mesh_url)),
    KN_OPTION("quiet", FLAG, AT(quiet)),
    KN_OPTION("json", CALL, .call = kn_result_open),
    KN_OPTION("hand", SPECIAL, AT(grip), .take = take_grip, .given = offsetof(kn_probe_options, gripped)),
    KN_OPTION("device", TEXT, AT(device)),
    KN_OPTION("axes", SPECIAL, AT(axes), .take = take_axes),
    KN_OPTION("delay", SPECIAL, AT(delay_ms), .take = take_delay),
    KN_OPTION("loss", QUANTITY, AT(loss), .unit = "1", KN_RANGE(0, KN_BELOW_1),
              .expected = "a share below 1, like 20%"),
    KN_OPTION("local", FLAG, AT(local)),
    KN_OPTION("held", FLAG, AT(held)),
};

int kn_probe_options_parse(kn_probe_options *opt, int argc, char **argv)
{
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help, .always_named = true,
                                          .unknown = "unknown option; knead probe --help lists them"};
    // A hold below 0 selects the default, because 0 s is a valid hold.
    *opt = (kn_probe_options){.path = "press", .shape.hold_s = -1.0};
    const int code = kn_options_read(&table, opt, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (optind < argc) REFUSE("`%s`: expected options only; knead probe --help lists them\n", argv[optind]);
    const int swings = strcmp(opt->path, "sine") ? code : check_sine(&opt->shape);
    return swings == KN_OPTIONS_READ ? check(opt) : swings;
}
