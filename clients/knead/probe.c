// knead probe: a virtual haptic device at 1 kHz. virtual_hand.h contains the hand, the thread that runs the hand, and
// the state that other threads can read. This file contains the command line, the steps of a session in order, and the
// messages to the user.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "clients/hand/bus_client.h"
#include "clients/hand/closed_loop_hand.h"
#include "clients/hand/haptic_loop.h"
#include "clients/hand/live_server.h"
#include "clients/hand/session_record.h"
#include "clients/hand/tool_height.h"
#include "clients/hand/tool_path.h"
#include "clients/hand/virtual_hand.h"
#include "core/scene/keys.h"
#include "core/scene/scene.h"
#include "server/clock.h"
#include "server/option_table.h"
#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// ---- the command line

typedef struct probe_options {
    // Path of the tool: "press", "sine", "poke", or the name of a CSV file with poses.
    const char *path;
    const char *probe; // name of the tool; NULL: find_tool chooses a tool
    // Names of output files, and URLs of the two buses. NULL: the file is not written, or the default URL is used.
    const char *record, *control, *csv, *png, *motors, *lcm_url, *mesh_url;
    // Shape of a press, sine or poke; its touch_z_m is computed later from the mesh.
    kn_tool_path_def shape;
    double drop_s[2]; // time of the gap in the first try, and its duration
    int drops, tries;
    // --hand: a hand follows the path and grips a simulated device, so path and forces together move the tool. Without
    // the option --hand the tool follows the path exactly.
    bool gripped;
    kn_grip grip;
    const char *device; // name of the profile of the simulated device; NULL: the device in the scene
    int axes, delay_ms;
    double loss;
    bool local, held;
    bool quiet;
} probe_options;

static const char help[] =
    "usage: knead probe [--path press|sine|poke|FILE.csv] [OPTION]...\n\n"
    "Play a haptic device and its user: move a tool of kneadd along a path, 1000 poses a second, and print a table of\n"
    "the forces that kneadd sends back. The path begins in the air. If no force comes for 20 ms, the force of the\n"
    "device goes to 0 N. After this or a fault of kneadd the tool is lifted, and a new session repeats the path.\n\n"
    "the path:\n"
    "  --path press     touch, wait, go at 1 cm/s to 1 cm below the top of the block, hold, withdraw (default)\n"
    "  --path sine      touch, wait, oscillate between the height of touch and 1 mm below this height\n"
    "  --path poke      go 3 mm deep at 5 cm/s and out again\n"
    "  --path FILE.csv  table with the header time_s,x_m,y_m,z_m or time_s,x_m,y_m,z_m,qw,qx,qy,qz.\n"
    "                   Positions are in metres, with z up and the origin under the object's centre.\n"
    "                   The path must begin clear of the object and last a day at most\n"
    "  --probe NAME     tool of the scene (default: for press the first tool, for other paths the first round tool).\n"
    "                   Other paths are faster than a press, and dough resists a fast plate like a wall\n"
    "  --hold TIME      press: time at the lowest point; sine: duration (default: 4 s)\n"
    "  --depth LENGTH   depth, e.g. '10 mm' (default: press 10 mm, sine 1 mm, poke 3 mm).\n"
    "                   Press: below the top of the untouched block. Other paths: below the point of touch\n"
    "  --speed SPEED    speed in the object, e.g. '1 cm/s' (default: press 1 cm/s, poke 5 cm/s)\n"
    "  --frequency F    frequency of the sine (default: 2 Hz)\n\n"
    "outputs:\n"
    "  --record FILE    record the session as an LCM event log: knead replay FILE --verify gives the same forces.\n"
    "                   If kneadd has a control socket, the log begins with the present shape of the object.\n"
    "                   Otherwise the log can be replayed only if the object was untouched\n"
    "  --control PATH   control socket of kneadd (default: KNEAD_CONTROL of the environment, else\n"
    "                   " KN_LIVE_SERVER_CONTROL ")\n"
    "  --csv FILE       write one row per force, with the columns of knead replay --csv\n"
    "  --png FILE       draw the force against time and depth (needs gnuplot)\n"
    "  --motors FILE    write a CSV with one row per ms of the device's clock, even if no force was received.\n"
    "                   A row has the position of the device and the force of its motors\n"
    "  --json           print the table of a completed session as JSON\n"
    "  --quiet          print no progress and no table\n\n"
    "session:\n"
    "  --tries N        number of tries, 1 to 3 (default: 3)\n"
    "  --drop-at T,D    fault injection: in the first try, send no pose from time T on, for the time D\n"
    "  --lcm-url URL    bus of poses and forces (default: LCM_DEFAULT_URL, else " KN_FORCE_URL ")\n"
    "  --mesh-url URL   bus of meshes (default: " KN_MESH_URL ")\n\n"
    "a simulated device in a simulated hand. The hand follows the path, and the force of the device pushes it off the\n"
    "path. The table ends with a verdict on the device: whether it buzzed or drove the hand:\n"
    "  --hand HAND      grip of the hand: light, normal or firm. none: no hand; the device is moved into place and\n"
    "                   released, and a force of 1 N along z pushes it\n"
    "  --device CLASS   touch, falcon, omega, unknown, bench, or a FILE.yaml with a device: section\n"
    "                   (default: the device of the scene)\n"
    "  --axes N         1: free along z, bound to the path along x and y; 3: free along all three (default: 3)\n"
    "  --delay TIME     round trip added by a simulated link, whole ms, 255 ms at most\n"
    "  --loss SHARE     share of the poses and of the forces that the simulated link loses: 20% or 0.2\n"
    "  --local          render the local model that kneadd --local-model sends, instead of its forces\n"
    "  --held           also render forces older than 5 ms, to study their effect. Every real device should refuse\n"
    "                   such forces\n\n"
    "Examples:\n"
    "    knead probe --csv press.csv\n"
    "    knead probe --path sine --frequency '5 Hz' --hold '2 s'\n"
    "    knead probe --path poke --hand light --device touch\n\n"
    "Exit codes: 0 path played to its end; 1 played to its end, but the object has moved away, or the device\n"
    "buzzed or gave more than 10 mJ to the hand; 2 bad input; 3 no answer, forces older than 5 ms, or three\n"
    "interrupted tries.\n";

// Largest speed of a sine, m/s. It is the default of brake_m_s; above this speed kneadd sends only a damping force.
static const double fastest_m_s = 1.2;

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
    REFUSE("a sine of %g Hz and %g mm is %.3g m/s fast, expected at most %g m/s, which is %.3g Hz at this depth\n", f,
           1e3 * d, peak_m_s, fastest_m_s, fastest_m_s / (acos(-1.0) * d));
}

// Check conditions between options, now that all options are known.
static int check_options(const probe_options *opt)
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
        REFUSE("--held with --local: expected only one of them, because with --local the device renders no force of "
               "kneadd\n");
    if (alone && !opt->gripped)
        REFUSE("%s: expected --hand as well, because the option is for a simulated device\n", alone);
    if (kn_choice_of("press|sine|poke", opt->path) < 0 && access(opt->path, R_OK) != 0)
        REFUSE("--path %s: expected press, sine, poke or a CSV file (%s)\n", opt->path, strerror(errno));
    if (!kn_bus_client_check(opt->lcm_url, KN_FORCE_URL, error, sizeof error) ||
        !kn_bus_client_check(opt->mesh_url, KN_MESH_URL, error, sizeof error))
        REFUSE("%s\n", error);
    return KN_OPTIONS_READ;
}

#define AT(member) .offset = offsetof(probe_options, member)
static const kn_option rows[] = {
    KN_OPTION("path", TEXT, AT(path)),
    KN_OPTION("probe", TEXT, AT(probe)),
    KN_OPTION("hold", QUANTITY, AT(shape.hold_s), .unit = "s", KN_RANGE(0, DBL_MAX),
              .expected = "something like '4 s'"),
    KN_OPTION("depth", QUANTITY, AT(shape.depth_m), .unit = "m", .expected = "something like '10 mm'"),
    KN_OPTION("speed", QUANTITY, AT(shape.speed_m_s), .unit = "m/s", .expected = "something like '1 cm/s'"),
    KN_OPTION("frequency", QUANTITY, AT(shape.frequency_hz), .unit = "Hz", .expected = "something like '2 Hz'"),
    KN_OPTION("record", TEXT, AT(record)),
    KN_OPTION("control", TEXT, AT(control)),
    KN_OPTION("csv", TEXT, AT(csv)),
    KN_OPTION("png", TEXT, AT(png)),
    KN_OPTION("motors", TEXT, AT(motors)),
    KN_OPTION("tries", INTEGER, AT(tries), KN_RANGE(1, KN_HAND_TRIES)),
    KN_OPTION("drop-at", QUANTITY, AT(drop_s), .unit = "s", KN_RANGE(1e-3, 1e6), .items = 2,
              .count = offsetof(probe_options, drops), .expected = "two times like '1.5 s,30 ms'"),
    KN_OPTION("lcm-url", TEXT, AT(lcm_url)),
    KN_OPTION("mesh-url", TEXT, AT(mesh_url)),
    KN_OPTION("quiet", FLAG, AT(quiet)),
    KN_OPTION("json", CALL, .call = kn_result_open),
    KN_OPTION("hand", SPECIAL, AT(grip), .take = take_grip, .given = offsetof(probe_options, gripped)),
    KN_OPTION("device", TEXT, AT(device)),
    KN_OPTION("axes", SPECIAL, AT(axes), .take = take_axes),
    KN_OPTION("delay", SPECIAL, AT(delay_ms), .take = take_delay),
    KN_OPTION("loss", QUANTITY, AT(loss), .unit = "1", KN_RANGE(0, KN_BELOW_1),
              .expected = "a share below 1, like 20%"),
    KN_OPTION("local", FLAG, AT(local)),
    KN_OPTION("held", FLAG, AT(held)),
};

// Parse the command line. Return KN_OPTIONS_READ, or an exit code: 0 after --help, KN_EXIT_USAGE after a mistake.
static int parse(probe_options *opt, int argc, char **argv)
{
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    // A hold below 0 selects the default, because 0 s is a valid hold.
    *opt = (probe_options){.path = "press", .shape.hold_s = -1.0};
    const int code = kn_options_read(&table, opt, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (optind < argc) REFUSE("`%s`: expected options only; knead probe --help lists them\n", argv[optind]);
    if (opt->drops == 1) REFUSE("--drop-at: expected two times like '1.5 s,30 ms'\n");
    if (opt->control && !opt->record) REFUSE("--control: expected --record FILE as well\n");
    const int swings = strcmp(opt->path, "sine") ? code : check_sine(&opt->shape);
    return swings == KN_OPTIONS_READ ? check_options(opt) : swings;
}

// ---- the session

static const int scene_wait_ms = 4000;          // longest wait for KNEAD_SCENE, which kneadd sends every 1 s
static const int64_t mesh_wait_ns = 3000000000; // longest wait for a mesh; kneadd sends KNEAD_MESH_INIT every 1 s
static const double press_m = 0.01;             // default depth of a press, from the project's first paper
static const double shallowest_m = 1e-4;        // smallest depth of a press
// Fraction of the object's height that must remain under the tool; thinner cells turn inside out.
static const double thinnest = 0.1;
static const double lift_m = 0.02; // height above the object's top that material pushed up by kneading does not reach
static const double even_m = 1e-5; // unevenness of the object's top below which the top counts as even
// Time that each try may take for engaging, for a retreat and for the silence after the retreat.
static const int trip_ms = 15000;
// Largest unevenness of the top (uneven_m) that a path takes into account. The tool sinks slowly through this height,
// in 4 s at most.
static const double most_uneven_m = 2e-3;

// One run of `knead probe`.
typedef struct probe {
    probe_options opt;
    kn_scene *scene;
    const kn_probe_def *tool;
    kn_tool_path *path[KN_HAND_TRIES]; // one path for each try; a path from a file is used for all tries
    bool regenerate;                   // true: paths are generated, one for each try
    bool no_way;                       // true: no path could be made for the next try
    kn_session_record *record;
    kn_bus_client *mesh_bus;
    kn_mesh mesh;
    uint8_t *top; // marks the vertices of the mesh's top face, see kn_tool_height_top
    kn_hand_player player;
    kn_closed_loop_hand grasp; // the player's hand with a simulated device in it, if --hand was given
    kn_virtual_device device;
    double x_m, y_m; // place of the path's lowest point, at which the depth of the dent is measured
    double before_m; // height of the object at (x_m, y_m) before the session; NAN: this place is beside the object
    char error[512];
} probe;

static volatile sig_atomic_t interrupted;

static void on_signal(int number)
{
    (void)number;
    interrupted = 1;
}

static int complain(int code, const char *what)
{
    fprintf(stderr, "knead probe: %s\n", what);
    return code;
}

// Choose the tool if the user named none. With --hand, take the first tool that is coupled to a device. For a press,
// take the scene's first tool. For all faster paths, take the first round tool, because a flat plate that hits dough at
// speed trips the impulse guard.
static int find_tool(probe *p)
{
    const kn_model_def *def = &p->scene->model;
    bool round = !p->opt.probe && strcmp(p->opt.path, "press") != 0;
    for (int i = 0; i < def->probe_count && p->opt.gripped && !p->opt.probe && !p->tool; i++)
        if (def->probe[i].coupling_n_m > 0.0) p->tool = &def->probe[i];
    for (int i = 0; i < def->probe_count && !p->tool; i++)
        if (round ? !kn_tool_height_flat(def->probe[i].shape)
                  : !p->opt.probe || !strcmp(p->opt.probe, def->probe[i].name))
            p->tool = &def->probe[i];
    // If the scene has no round tool, use its first tool.
    if (!p->tool && round && def->probe_count > 0) p->tool = &def->probe[0];
    if (p->tool) return KN_EXIT_OK;
    // The scene has no tool of the wanted name, so list its tools in the error message.
    int n = snprintf(p->error, sizeof p->error, "%s has no probe `%s`; it has:", p->scene->name,
                     p->opt.probe ? p->opt.probe : "");
    for (int i = 0; i < def->probe_count && n > 0 && (size_t)n < sizeof p->error; i++)
        n += snprintf(p->error + n, sizeof p->error - (size_t)n, " %s", def->probe[i].name);
    return complain(KN_EXIT_USAGE, p->error);
}

// Load a path from a file. The path needs no scene, so its mistakes are reported before the wait for a scene.
static int load_path(probe *p)
{
    const char *path = p->opt.path;
    if (!strcmp(path, "press") || !strcmp(path, "sine") || !strcmp(path, "poke")) return KN_EXIT_OK;
    p->path[0] = kn_tool_path_load(path, p->error, sizeof p->error);
    if (p->path[0]) return KN_EXIT_OK;
    fprintf(stderr, "%s\n", p->error);
    return KN_EXIT_USAGE;
}

// Join the bus of poses and forces, wait for the scene and choose the tool.
static int find_scene(probe *p)
{
    p->record = kn_session_record_open(p->opt.lcm_url, p->error, sizeof p->error);
    if (!p->record) return complain(KN_EXIT_DEVICE, p->error);
    if (!kn_session_record_scene(p->record, scene_wait_ms))
        return kn_complain("probe", KN_EXIT_DEVICE, "no KNEAD_SCENE for 4 s: %s", kn_bus_client_why(KN_BUS_CLIENT_ASK));
    const char *text = p->record->scene_text;
    p->scene = kn_scene_parse(p->record->scene_name, text, strlen(text), NULL, 0, p->error, sizeof p->error);
    return p->scene ? find_tool(p) : complain(KN_EXIT_USAGE, p->error);
}

static void on_mesh(const lcm_recv_buf_t *buf, const char *channel, void *self)
{
    probe *p = self;
    if (!strcmp(channel, "KNEAD_MESH_INIT")) kn_mesh_init(&p->mesh, buf->data, buf->data_size);
    else kn_mesh_update(&p->mesh, buf->data, buf->data_size);
}

// Wait up to 3 s for a complete mesh of a tick later than after_tick. Return false if no such mesh came.
static bool look(probe *p, int64_t after_tick)
{
    for (int64_t end_ns = kn_now_ns() + mesh_wait_ns; kn_now_ns() < end_ns && !interrupted;) {
        kn_bus_client_handle(p->mesh_bus, 50);
        if (p->mesh.whole && p->mesh.tick > after_tick) return true;
    }
    return false;
}

// Join the bus of meshes, wait for the first mesh, and check that the mesh belongs to the scene.
static int open_mesh(probe *p)
{
    p->mesh_bus = kn_bus_client_open(p->opt.mesh_url, KN_MESH_URL, p->error, sizeof p->error);
    if (!p->mesh_bus) return complain(KN_EXIT_DEVICE, p->error);
    kn_bus_client_hear(p->mesh_bus, "KNEAD_MESH_INIT", on_mesh, p);
    kn_bus_client_hear(p->mesh_bus, "KNEAD_MESH_UPDATE", on_mesh, p);
    if (!look(p, -1))
        return complain(KN_EXIT_DEVICE, "no mesh for 3 s; does kneadd send its meshes to this --mesh-url?");
    int vertices = 0;
    p->top = kn_tool_height_top(&p->scene->model, &vertices);
    if (!p->top) return complain(KN_EXIT_INTERNAL, "out of memory");
    if (vertices == p->mesh.vertex_count) return KN_EXIT_OK;
    return complain(KN_EXIT_DEVICE,
                    "the mesh does not belong to the scene; does --mesh-url belong to the same kneadd as --lcm-url?");
}

// Find the lowest point of the path by evaluating every millisecond of the path.
static void find_deepest(probe *p)
{
    double lowest_m = INFINITY;
    for (double t = 0.0; t <= p->path[0]->duration_s; t += 1e-3) {
        kn_tool_path_point point;
        kn_tool_path_at(p->path[0], t, &point);
        if (point.position_m[2] >= lowest_m) continue;
        lowest_m = point.position_m[2];
        p->x_m = point.position_m[0];
        p->y_m = point.position_m[1];
    }
}

// Generate the path for the present mesh, because the height of first contact depends on earlier kneading. A press goes
// to a depth below the top of the untouched block. All other paths go to a depth below the present height of contact.
// again: true if an earlier try has failed. On failure print one line on stderr and return NULL.
static kn_tool_path *generate(probe *p, bool again)
{
    const kn_model_def *def = &p->scene->model;
    kn_tool_path_def shape = p->opt.shape;
    double extent_m[3], lowest_touch_m;
    kn_model_def_extent(def, extent_m);
    double height_m = extent_m[2];
    double tool_m = kn_tool_height_m(p->tool);
    bool press = !strcmp(p->opt.path, "press");
    if (!kn_tool_height_touch(&p->mesh, p->top, def->spacing_m, p->tool, 0.0, 0.0, &shape.touch_z_m, &lowest_touch_m)) {
        complain(KN_EXIT_DEVICE, "the object has moved away from under the tool");
        return NULL;
    }
    // The depth of a press counts from the untouched top. Convert it to a depth below the height of first contact.
    if (press) shape.depth_m = shape.touch_z_m - tool_m - height_m + (shape.depth_m > 0.0 ? shape.depth_m : press_m);
    // Height of the tool's underside at the lowest point, and the depth of the dent under the tool.
    double bottom_m = shape.touch_z_m - tool_m - shape.depth_m, dent_m = height_m + tool_m - shape.touch_z_m;
    if (bottom_m < thinnest * height_m) {
        fprintf(stderr, "knead probe: --depth: expected at most %.1f mm here\n",
                1e3 * ((1.0 - thinnest) * height_m - (press ? 0.0 : dent_m)));
        return NULL;
    }
    // After a failed try the dent may be deeper than the goal. In this case make the path at least shallowest_m deep,
    // so that the hold is still played.
    if (again) shape.depth_m = fmax(shape.depth_m, shallowest_m);
    if (press && shape.depth_m < shallowest_m) {
        fprintf(stderr, "knead probe: the dent under the tool is %.1f mm deep already, expected a larger --depth\n",
                1e3 * dent_m);
        return NULL;
    }
    double uneven_m = shape.touch_z_m - lowest_touch_m;
    // On an uneven top, a flat tool touches everywhere only after it has sunk a little. So the path begins with this
    // sinking.
    if (press && uneven_m > even_m) shape.uneven_m = fmin(fmin(uneven_m, most_uneven_m), 0.5 * shape.depth_m);
    kn_tool_path *path = press                          ? kn_tool_path_press(&shape)
                         : !strcmp(p->opt.path, "sine") ? kn_tool_path_sine(&shape)
                                                        : kn_tool_path_poke(&shape);
    if (!path) complain(KN_EXIT_INTERNAL, "out of memory");
    if (!path || path->duration_s <= KN_TOOL_PATH_LONGEST_S) return path;
    fprintf(stderr, "knead probe: --hold, --speed: a path of %.3g s, expected a day at most\n", path->duration_s);
    kn_tool_path_destroy(path);
    return NULL;
}

static int make_path(probe *p)
{
    if (!p->path[0]) {
        p->path[0] = generate(p, false);
        p->regenerate = true;
    }
    if (!p->path[0]) return KN_EXIT_USAGE;
    find_deepest(p);
    // If the lowest point of the path is beside the object, no height can be measured there.
    if (!kn_tool_height_object(&p->mesh, p->x_m, p->y_m, &p->before_m)) p->before_m = NAN;
    return KN_EXIT_OK;
}

// Prepare the simulated device of --hand from the scene, the tool and --device.
static int take_device(probe *p)
{
    if (p->tool->coupling_n_m == 0.0)
        fprintf(stderr, "knead probe: %s follows its pose rigidly and may chatter where a coupled tool would not\n",
                p->tool->name);
    kn_closed_loop_hand_def def = {
        .grip = p->opt.grip, .axes = p->opt.axes, .delay_ms = p->opt.delay_ms, .loss = p->opt.loss};
    def.render = (kn_haptic_render_def){.device = p->scene->device,
                                        .coupling_n_m = p->tool->coupling_n_m,
                                        .coupling_n_s_m = p->tool->coupling_n_s_m,
                                        .radius_m = p->tool->radius_m,
                                        .level = p->tool->shape == KN_PROBE_PLATE,
                                        .guard_n_per_ms = p->scene->limits.guard_n_per_ms,
                                        .local = p->opt.local,
                                        .held = p->opt.held};
    kn_device_def *d = &def.render.device;
    int code = p->opt.device ? kn_device_profile_load(d, "probe", p->opt.device, NULL, 0) : KN_EXIT_OK;
    d->force_scale = p->scene->device.force_scale; // kneadd scales the force, so use the factor of the scene's device
    // The simulated arm uses the axes and lengths of the scene, so the device is mounted without rotation and scaling.
    d->scale = 1.0;
    memcpy(d->basis, (double[]){1, 2, 3}, sizeof d->basis);
    memcpy(d->rotation_wxyz, (double[]){1, 0, 0, 0}, sizeof d->rotation_wxyz);
    memset(d->position_m, 0, sizeof d->position_m);
    kn_closed_loop_hand_init(&p->grasp, &def, &p->player);
    return code;
}

// Start the record and the device's thread.
static int start(probe *p)
{
    // From here on an interrupt must still lead to a report.
    struct sigaction action = {.sa_handler = on_signal};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    kn_tool_path_point begin;
    kn_tool_path_at(p->path[0], 0.0, &begin);
    kn_hand_def def = {.path = p->path[0],
                       .session = kn_hand_session(),
                       .tries = p->opt.tries,
                       .drop_at_ms = (int)lround(1e3 * p->opt.drop_s[0]),
                       .drop_ms = (int)lround(1e3 * p->opt.drop_s[1])};
    // With the local model, missing messages are tolerated for longer.
    if (p->opt.local) def.hold_ms = KN_HAPTIC_RENDER_LOCAL_HOLD_MS, def.zero_ms = KN_HAPTIC_RENDER_LOCAL_ZERO_MS;
    double extent_m[3];
    kn_model_def_extent(&p->scene->model, extent_m);
    // A retreat lifts the tool above everything that kneading may have pushed up.
    def.clear_z_m = fmax(begin.position_m[2], extent_m[2] + kn_tool_height_m(p->tool) + lift_m);
    if (p->opt.control) p->record->control = p->opt.control;
    if (!kn_session_record_start(p->record, p->tool->name, p->opt.record, p->error, sizeof p->error))
        return complain(KN_EXIT_DEVICE, p->error);
    if (*p->record->no_object && p->opt.control) return complain(KN_EXIT_DEVICE, p->record->no_object);
    if (*p->record->no_object)
        fprintf(stderr, "knead probe: the recording does not hold the object: %s\n", p->record->no_object);
    // For every try, reserve rows for twice the duration of the path, because the device's thread must not allocate.
    int tries = def.tries ? def.tries : KN_HAND_TRIES, try_ms = (int)(2e3 * p->path[0]->duration_s) + trip_ms;
    if (p->opt.motors && !kn_motor_record_open(&p->player.motors, tries * try_ms))
        return complain(KN_EXIT_INTERNAL, "out of memory");
    kn_hand_player_init(&p->player, &def);
    kn_virtual_device_hand *hand = p->opt.gripped ? kn_closed_loop_hand_tick : kn_hand_player_tick;
    void *self = p->opt.gripped ? (void *)&p->grasp : &p->player;
    if (!kn_virtual_device_start(&p->device, hand, self, p->opt.lcm_url, p->tool->name, p->error, sizeof p->error))
        return complain(KN_EXIT_DEVICE, p->error);
    // Without real-time priority the probe still works, but its poses come less evenly.
    int refused = kn_virtual_device_priority_error(&p->device);
    if (refused) fprintf(stderr, "knead probe: no real-time priority (%s): poses may come late\n", strerror(refused));
    return KN_EXIT_OK;
}

// Print why the force was taken to 0 N at trip n. There are three reasons: the device refused a force, the device's own
// watchdog tripped, or kneadd latched a fault.
static void say_trip(probe *p, int n)
{
    const kn_trip *t = &p->player.hand.trip[n];
    fprintf(stderr, "knead probe: %s, %.2f s, %.2f N taken to 0 N: ", t->piece, t->time_s, t->force_n);
    if (t->refusal) fprintf(stderr, "%s\n", t->refusal);
    else if (t->own && t->stalled_ms > 0)
        fprintf(stderr, "own watchdog: no force for %d ms, after this process had not run for %d ms\n", t->silent_ms,
                t->stalled_ms);
    else if (t->own) fprintf(stderr, "own watchdog: no force for %d ms\n", t->silent_ms);
    else
        fprintf(stderr, "kneadd latched a fault: %s; remedy: %s\n", kn_fault_name(t->fault), kn_fault_remedy(t->fault));
}

// Report that the tool was lifted after trip n.
static void say_lifted(probe *p, int n)
{
    const kn_trip *t = &p->player.hand.trip[n];
    fprintf(stderr, "knead probe: tool lifted%s%s\n", t->cleared ? ", fault cleared" : "",
            n + 1 < p->player.hand.def.tries ? "; trying again in a new session" : "");
}

// Redraw the progress bar.
static void show_progress(probe *p)
{
    char bar[31] = {0};
    double done = 1e-3 * atomic_load(&p->player.path_ms), all = p->path[0]->duration_s;
    bool playing = atomic_load(&p->player.mode) == KN_HAND_PLAY;
    for (int i = 0; i < 30; i++) bar[i] = playing && i < 30 * done / all ? '#' : '.';
    fprintf(stderr, "\r[%s] %-8s %5.1f of %.1f s %7.2f N ", bar, (const char *)atomic_load(&p->player.piece),
            playing ? done : 0.0, all, 1e-3 * atomic_load(&p->player.given_mn));
}

static void clear_progress(void) { fprintf(stderr, "\r%78s\r", ""); }

// Make the path of the next try after n trips, for the object in its present shape.
static void prepare_try(probe *p, int n)
{
    p->path[n] = generate(p, true);
    if (p->path[n]) atomic_store(&p->player.next_path, p->path[n]);
    else p->no_way = true;
}

// Watch the session until the hand has ended. Report trips, redraw the progress bar, make the paths of further tries.
static void attend(probe *p)
{
    bool bar = !p->opt.quiet && isatty(STDERR_FILENO);
    int told = 0, lifted = 0;
    for (bool done = false; !done && !interrupted && !p->no_way;) {
        kn_bus_client_handle(p->mesh_bus, 50); // receive mesh messages while waiting, so that p->mesh stays recent
        done = atomic_load(&p->device.done);
        int trips = atomic_load(&p->player.trips), mode = atomic_load(&p->player.mode);
        bool news = trips > told || (trips > lifted && mode != KN_HAND_RETREAT);
        if (bar && news) clear_progress();
        for (; told < trips; told++) say_trip(p, told);
        for (; lifted < trips && mode != KN_HAND_RETREAT; lifted++) say_lifted(p, lifted);
        // During the silence between two tries, make the path of the next try once.
        if (mode == KN_HAND_SILENT && p->regenerate && trips < KN_HAND_TRIES && !p->path[trips]) prepare_try(p, trips);
        if (bar && !done) show_progress(p);
    }
    if (bar) clear_progress();
}

// Write one of the two CSV files: the forces that kneadd sent, or the forces of the device's motors. If any write to
// the file failed, print an error message and return false.
static bool write_csv(const probe *p, const char *path, bool motors)
{
    kn_beside out;
    FILE *f = kn_output_open(&out, "probe", path);
    if (!f) return false;
    if (motors) kn_motor_record_csv(f, &p->player.motors);
    else kn_session_report_csv(f, &p->player.hand, p->record, p->tool->name);
    return kn_output_close(&out, "probe") == KN_EXIT_OK;
}

// Draw the contact force against time and against depth. Return the exit code.
static int draw(const probe *p)
{
    int code;
    FILE *f = kn_plot_open("probe", p->opt.png, 1200, 480, &code);
    if (!f) return code;
    fputs("set datafile separator comma\n$csv << END\n", f);
    kn_session_report_csv(f, &p->player.hand, p->record, p->tool->name);
    fputs("END\n"
          "stats $csv using 'contact_fz_n' nooutput name 'force'\n"
          "stats $csv using (column('contacts') > 0 ? column('z_m') : NaN) nooutput name 'z'\n"
          "held(force) = column('z_m') < z_min + 1e-6 ? force : NaN\n",
          f);
    char title[300];
    snprintf(title, sizeof title, "%s of %s, tool %s", p->opt.path, p->scene->name, p->tool->name);
    fputs("set multiplot layout 1,2 title ", f);
    kn_plot_quote(f, title);
    fputs("\nset key top right\nset ylabel 'contact force, N'\nset yrange [*<0:1.08*force_max]\nset xlabel 'time, s'\n"
          "plot $csv using 'time_s':'contact_fz_n' with lines lt 1 title 'moving', "
          "'' using 'time_s':(held(column('contact_fz_n'))) with lines lt 2 lw 3 title 'deepest'\n"
          "set xlabel 'depth below first touch, mm'\nset xrange [0:*]\n"
          "plot $csv using (1e3*(z_max - column('z_m'))):'contact_fz_n' with lines lt 1 notitle, "
          "'' using (1e3*(z_max - column('z_m'))):(held(column('contact_fz_n'))) with lines lt 2 lw 3 notitle\n",
          f);
    return kn_plot_close(f, "probe", p->opt.png);
}

// Find out whether kneadd still sends meshes, to explain missing answers.
static const char *why_unanswered(probe *p)
{
    if (!look(p, p->mesh.tick)) return kn_bus_client_why("kneadd has ended");
    return "kneadd is running, but accepts no pose of this probe: another hand holds the tool, or see kneadd's stderr";
}

// Report how the session ended. Return the exit code.
static int verdict(probe *p)
{
    const kn_hand *h = &p->player.hand;
    const kn_trip *last = h->trips ? &h->trip[h->trips - 1] : NULL;
    if (h->mode == KN_HAND_DONE) return KN_EXIT_OK;
    switch (h->trouble) {
    case KN_HAND_NO_TROUBLE:
        if (!p->no_way) fprintf(stderr, "knead probe: interrupted\n");
        break;
    case KN_HAND_NO_ANSWER: fprintf(stderr, "knead probe: no force for 3 s: %s\n", why_unanswered(p)); break;
    case KN_HAND_NOT_ENGAGED:
        fprintf(stderr, "knead probe: kneadd answers but does not engage (%s): begin clear of the object\n",
                h->force.fault ? kn_fault_name((kn_fault)h->force.fault) : "no fault");
        break;
    case KN_HAND_SPOILT:
        fprintf(stderr, "knead probe: %s interrupted %d time%s, the last time by %s\n", p->opt.path, h->trips,
                h->trips == 1 ? "" : "s",
                last->refusal ? last->refusal
                : last->own   ? "missing forces"
                              : kn_fault_name(last->fault));
    }
    return KN_EXIT_DEVICE;
}

static void print_grasp(const kn_closed_loop_hand *g)
{
    const kn_closed_loop_hand_news *n = &g->news;
    printf("  device          %s in a hand: %s, %d ms of delay, %g %% lost\n", g->def.render.device.name,
           kn_grip_name(g->def.grip), g->def.delay_ms, 100.0 * g->def.loss);
    printf("  buzz            %8.3f N    above 10 Hz in the loudest second; at most %d reversals in a second: %s\n",
           n->loudest_n, n->turns,
           n->buzzes   ? "it buzzes"
           : n->drives ? "it drives the hand"
                       : "calm");
    if (g->def.render.local)
        printf("  local model     %8lld      messages rendered, %lld refused\n", (long long)g->render.model.taken,
               (long long)g->render.model.refused);
    if (g->render.guards) printf("  impulse guard   %8lld      hits\n", (long long)g->render.guards);
    printf("  energy given    %8.2f mJ   to the hand; the controller added damping for %lld ms\n", 1e3 * n->given_j,
           (long long)n->acted);
}

// Write the table as JSON.
static void tell_result(const probe *p, const kn_session_report *r)
{
    json_t *to = kn_result();
    kn_result_text(to, "scene", p->scene->name);
    kn_result_text(to, "tool", p->tool->name);
    kn_result_integer(to, "tries", p->player.hand.tries);
    kn_result_number(to, "contact_from_s", r->contact_from_s);
    kn_result_number(to, "contact_s", r->contact_s);
    kn_result_number(to, "peak_n", r->peak_n);
    kn_result_number(to, "peak_s", r->peak_s);
    kn_result_number(to, "hold_end_n", r->hold_end_n);
    kn_result_number(to, "given_peak_n", r->given_peak_n);
    kn_result_number(to, "gain_min", r->gain_min);
    kn_result_number(to, "residual_m", r->residual_m);
    kn_result_integer(to, "sent", r->sent);
    kn_result_integer(to, "forces", r->forces);
    kn_result_integer(to, "matched", r->matched);
    kn_result_integer(to, "strange", r->strange);
    kn_result_integer(to, "stale", r->stale);
    kn_result_integer(to, "lost", r->lost);
    kn_result_integer(to, "missed", r->missed);
    kn_result_number(to, "round_trip_p50_ms", r->round_trip_p50_ms);
    kn_result_number(to, "round_trip_p99_ms", r->round_trip_p99_ms);
}

// Stop the device's thread, and write the report and the output files. Return the exit code.
static int finish(probe *p)
{
    kn_session_report report;
    double after_m;
    kn_virtual_device_stop(&p->device);
    int code = verdict(p);
    bool written = kn_session_record_stop(p->record, p->error, sizeof p->error);
    if (!written || p->record->out_of_memory) code = complain(KN_EXIT_DEVICE, written ? "out of memory" : p->error);
    kn_session_report_make(&report, &p->player.hand, p->record);
    int64_t last_tick = p->record->force_count ? p->record->force[p->record->force_count - 1].force.tick : -1;
    // The dent is the height before the session minus the height after it. The mesh must be later than the last force.
    if (code == KN_EXIT_OK && !isnan(p->before_m)) {
        if (!look(p, last_tick))
            code = complain(KN_EXIT_DEVICE, "no mesh after the withdrawal, so the depth of the dent is not known");
        else if (kn_tool_height_object(&p->mesh, p->x_m, p->y_m, &after_m) && after_m > 0)
            report.residual_m = p->before_m - after_m; // what is below the table has fallen off it
        else
            code = complain(
                KN_EXIT_FAILED,
                "the object is no longer where the tool pressed it: it has moved away, or its nodes have flown off");
    }
    if (p->player.hand.mode == KN_HAND_DONE && !p->opt.quiet) {
        printf("%s of %s, tool %s\n", p->opt.path, p->scene->name, p->tool->name);
        kn_safety limited; // kn_safety_init fills in the defaults of the limits
        kn_safety_init(&limited, &p->scene->limits);
        double scale = limited.limits.force_scale;
        tell_result(p, &report);
        kn_session_report_print_link(stdout, &report);
        printf("  cycles missed   %8lld      by kneadd, %d by this device\n", (long long)report.missed,
               atomic_load(&p->device.missed));
        if (p->opt.gripped) print_grasp(&p->grasp);
        if (scale != 1.0) printf("  hand's share    %8.2f N    at most, force_scale %g\n", report.given_peak_n, scale);
        kn_session_report_print(stdout, &report, &p->player.hand, limited.limits.clamp_n / scale);
    }
    // If the device buzzed or drove the hand, the check has failed.
    if (code == KN_EXIT_OK && p->opt.gripped && (p->grasp.news.buzzes || p->grasp.news.drives)) code = KN_EXIT_FAILED;
    if (p->opt.record && report.lost)
        fprintf(stderr, "knead probe: %s has gaps: %lld records were lost\n", p->opt.record, (long long)report.lost);
    if (p->opt.csv && !write_csv(p, p->opt.csv, false)) code = KN_EXIT_DEVICE;
    if (p->opt.motors && !write_csv(p, p->opt.motors, true)) code = KN_EXIT_DEVICE;
    if (p->opt.png && report.contact_s > 0.0) {
        int drawn = draw(p);
        if (drawn != KN_EXIT_OK) code = drawn;
    } else if (p->opt.png) {
        printf("  %s is not drawn, because nothing was touched\n", p->opt.png);
    }
    return code;
}

// Run the steps of a session in order. Bad input is found before anything moves.
static int run(probe *p)
{
    int code = p->opt.png ? kn_plot_try("probe", p->opt.png) : KN_EXIT_OK;
    if (code == KN_EXIT_OK) code = load_path(p);
    if (code == KN_EXIT_OK) code = find_scene(p);
    if (code == KN_EXIT_OK) code = open_mesh(p);
    if (code == KN_EXIT_OK && p->opt.gripped) code = take_device(p);
    if (code == KN_EXIT_OK) code = make_path(p);
    if (code == KN_EXIT_OK) code = start(p);
    if (code != KN_EXIT_OK) return code;
    attend(p);
    return finish(p);
}

int kn_probe_main(int argc, char **argv)
{
    probe *p = calloc(1, sizeof *p);
    if (!p) return complain(KN_EXIT_INTERNAL, "out of memory");
    int code = parse(&p->opt, argc, argv);
    if (code == KN_OPTIONS_READ) code = run(p);
    kn_bus_client_close(p->mesh_bus);
    kn_mesh_free(&p->mesh);
    free(p->top);
    kn_session_record_destroy(p->record);
    kn_motor_record_close(&p->player.motors);
    for (int i = 0; i < KN_HAND_TRIES; i++) kn_tool_path_destroy(p->path[i]);
    kn_scene_destroy(p->scene);
    free(p);
    return code;
}
