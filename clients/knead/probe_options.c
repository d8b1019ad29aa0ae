#include "clients/knead/probe_options.h"
#include "clients/knead/commands.h"
#include "clients/knead/hand.h"
#include "clients/knead/join.h"
#include "clients/knead/result.h"
#include "core/scene/units.h"
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
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

// Parse a quantity and convert it to `unit_text`. A number without a unit is accepted for seconds only. A length
// without a unit is refused, because the user more likely means millimetres than metres.
static bool quantity(const char *option, const char *text, const char *unit_text, const char *example, double *value)
{
    kn_unit unit;
    kn_quantity q;
    char why[128];
    if (!kn_unit_parse(&unit, unit_text, why, sizeof why)) return false;
    if (kn_quantity_parse(&q, text, why, sizeof why) &&
        ((q.bare && !strcmp(unit_text, "s")) || (!q.bare && kn_unit_same_dimension(&q.unit, &unit)))) {
        *value = kn_quantity_in(&q, &unit);
        // A duration of 0 s is valid for the option --hold only.
        if (isfinite(*value) && (*value > 0.0 || (*value == 0.0 && !strcmp(option, "hold")))) return true;
    }
    fprintf(stderr, "knead probe: --%s %s: expected something like '%s'\n", option, text, example);
    return false;
}

static bool tries(const char *text, int *value)
{
    char *end;
    long n = strtol(text, &end, 10);
    *value = (int)n;
    if (end != text && !*end && n >= 1 && n <= KN_HAND_TRIES) return true;
    fprintf(stderr, "knead probe: --tries %s: expected 1 to %d\n", text, KN_HAND_TRIES);
    return false;
}

// Parse SECONDS:MILLISECONDS of --drop-at.
static bool drop(const char *text, kn_probe_options *opt)
{
    double at_s;
    int ms;
    char rest;
    if (sscanf(text, "%lf:%d%c", &at_s, &ms, &rest) == 2 && at_s >= 0.0 && at_s < 1e6 && ms > 0) {
        opt->drop_at_ms = (int)lround(1e3 * at_s);
        opt->drop_ms = ms;
        return true;
    }
    fprintf(stderr, "knead probe: --drop-at %s: expected SECONDS:MILLISECONDS like 1.5:30\n", text);
    return false;
}

// Parse a fraction in the range 0 <= x < 1, as a number or in percent.
static bool share(const char *text, double *value)
{
    kn_quantity q;
    kn_unit unit = {0};
    char why[128];
    if (kn_quantity_parse(&q, text, why, sizeof why) && kn_unit_same_dimension(&q.unit, &unit)) {
        *value = kn_quantity_in(&q, &unit);
        if (*value >= 0.0 && *value < 1.0) return true;
    }
    fprintf(stderr, "knead probe: --loss %s: expected a share below 1, like 20%%\n", text);
    return false;
}

// Parse the delay of a simulated link in whole ms. kn_grasp keeps 256 slots, one for each ms.
static bool delay(const char *text, int *value)
{
    double s;
    if (!strcmp(text, "0") || !strcmp(text, "0 ms")) return true;
    if (!quantity("delay", text, "s", "20 ms", &s)) return false;
    *value = (int)lround(1e3 * s);
    if (s < 0.2555 && fabs(1e3 * s - *value) < 1e-6) return true;
    fprintf(stderr, "knead probe: --delay %s: expected whole milliseconds, at most 255\n", text);
    return false;
}

static bool hand(const char *text, kn_probe_options *opt)
{
    opt->gripped = true;
    if (kn_grip_find(text, &opt->grip)) return true;
    fprintf(stderr, "knead probe: --hand %s: expected %s\n", text, kn_grip_names);
    return false;
}

static bool axes(const char *text, int *value)
{
    *value = *text - '0';
    if ((*value == 1 || *value == 3) && !text[1]) return true;
    fprintf(stderr, "knead probe: --axes %s: expected 1 or 3\n", text);
    return false;
}

// Check the options of a simulated device: they mean nothing without --hand.
static bool device_is_whole(const kn_probe_options *opt)
{
    if (opt->gripped && opt->local && opt->held) {
        fprintf(stderr, "knead probe: --held with --local, which renders no force of kneadd's, expected one of them\n");
        return false;
    }
    if (opt->gripped || !(opt->device || opt->axes || opt->delay_ms || opt->loss > 0.0 || opt->local || opt->held))
        return true;
    fprintf(stderr, "knead probe: %s without a hand on a device, expected --hand too\n",
            opt->device     ? "--device"
            : opt->axes     ? "--axes"
            : opt->delay_ms ? "--delay"
            : opt->local    ? "--local"
            : opt->held     ? "--held"
                            : "--loss");
    return false;
}

// Check the speed of a sine. A swing of depth d at frequency f is d/2 (1 - cos 2 pi f t), so its peak speed is pi f d.
static bool swing_is_slow(const kn_path_def *shape)
{
    double f = shape->frequency_hz > 0.0 ? shape->frequency_hz : KN_PATH_SWING_HZ;
    double d = shape->depth_m > 0.0 ? shape->depth_m : KN_PATH_SWING_M, peak_m_s = acos(-1.0) * f * d;
    if (peak_m_s <= fastest_m_s) return true;
    fprintf(stderr,
            "knead probe: a sine of %g Hz and %g mm is %.3g m/s fast, expected at most %g m/s: %.3g Hz at this depth\n",
            f, 1e3 * d, peak_m_s, fastest_m_s, fastest_m_s / (acos(-1.0) * d));
    return false;
}

static bool path_is_known(const char *path)
{
    if (!strcmp(path, "press") || !strcmp(path, "sine") || !strcmp(path, "poke") || access(path, R_OK) == 0)
        return true;
    fprintf(stderr, "knead probe: --path %s: expected press, sine, poke or a CSV file (%s)\n", path, strerror(errno));
    return false;
}

static bool urls_are_known(const kn_probe_options *opt)
{
    char error[256];
    bool known = kn_join_check(opt->lcm_url, KN_FORCE_URL, error, sizeof error) &&
                 kn_join_check(opt->mesh_url, KN_MESH_URL, error, sizeof error);
    if (!known) fprintf(stderr, "knead probe: %s\n", error);
    return known;
}

int kn_probe_options_parse(kn_probe_options *opt, int argc, char **argv, bool *done)
{
    enum {
        PATH = 256,
        PROBE,
        HOLD,
        DEPTH,
        SPEED,
        FREQUENCY,
        RECORD,
        CSV,
        TRIES,
        DROP,
        LCM_URL,
        MESH_URL,
        QUIET,
        JSON,
        HELP,
        HAND,
        DEVICE,
        AXES,
        DELAY,
        LOSS,
        LOCAL,
        HELD,
        MOTORS
    };
    static const struct option list[] = {
        {"path", 1, 0, PATH},     {"probe", 1, 0, PROBE},         {"hold", 1, 0, HOLD},         {"depth", 1, 0, DEPTH},
        {"speed", 1, 0, SPEED},   {"frequency", 1, 0, FREQUENCY}, {"record", 1, 0, RECORD},     {"csv", 1, 0, CSV},
        {"tries", 1, 0, TRIES},   {"drop-at", 1, 0, DROP},        {"lcm-url", 1, 0, LCM_URL},   {"quiet", 0, 0, QUIET},
        {"json", 0, 0, JSON},     {"help", 0, 0, HELP},           {"mesh-url", 1, 0, MESH_URL}, {"hand", 1, 0, HAND},
        {"device", 1, 0, DEVICE}, {"axes", 1, 0, AXES},           {"delay", 1, 0, DELAY},       {"loss", 1, 0, LOSS},
        {"local", 0, 0, LOCAL},   {"held", 0, 0, HELD},           {"motors", 1, 0, MOTORS},     {0, 0, 0, 0}};
    // A hold below 0 selects the default, because 0 s is a valid hold.
    *opt = (kn_probe_options){.path = "press", .shape.hold_s = -1.0};
    optind = 1;
    bool ok = true;
    for (int c; ok && (c = getopt_long(argc, argv, ":", list, NULL)) != -1;) {
        switch (c) {
        case PATH: opt->path = optarg; break;
        case PROBE: opt->probe = optarg; break;
        case HOLD: ok = quantity("hold", optarg, "s", "4 s", &opt->shape.hold_s); break;
        case DEPTH: ok = quantity("depth", optarg, "m", "10 mm", &opt->shape.depth_m); break;
        case SPEED: ok = quantity("speed", optarg, "m/s", "1 cm/s", &opt->shape.speed_m_s); break;
        case FREQUENCY: ok = quantity("frequency", optarg, "Hz", "2 Hz", &opt->shape.frequency_hz); break;
        case RECORD: opt->record = optarg; break;
        case CSV: opt->csv = optarg; break;
        case MOTORS: opt->motors = optarg; break;
        case TRIES: ok = tries(optarg, &opt->tries); break;
        case DROP: ok = drop(optarg, opt); break;
        case LCM_URL: opt->lcm_url = optarg; break;
        case MESH_URL: opt->mesh_url = optarg; break;
        case QUIET: opt->quiet = true; break;
        case JSON: kn_result_open(); break;
        case HAND: ok = hand(optarg, opt); break;
        case DEVICE: opt->device = optarg; break;
        case AXES: ok = axes(optarg, &opt->axes); break;
        case DELAY: ok = delay(optarg, &opt->delay_ms); break;
        case LOSS: ok = share(optarg, &opt->loss); break;
        case LOCAL: opt->local = true; break;
        case HELD: opt->held = true; break;
        case HELP:
            *done = true;
            fputs(help, stdout);
            return KN_EXIT_OK;
        default:
            fprintf(stderr, "knead probe: %s: %s\n", argv[optind - 1],
                    c == ':' ? "expected a value" : "unknown option; knead probe --help lists them");
            ok = false;
        }
    }
    if (ok && optind < argc) {
        fprintf(stderr, "knead probe: `%s`: expected options only; knead probe --help lists them\n", argv[optind]);
        ok = false;
    }
    // Check conditions between options, now that all options are known.
    if (ok && !strcmp(opt->path, "sine")) ok = swing_is_slow(&opt->shape);
    if (ok) ok = device_is_whole(opt) && path_is_known(opt->path) && urls_are_known(opt);
    return ok ? KN_EXIT_OK : KN_EXIT_USAGE;
}
