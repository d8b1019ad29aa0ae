// knead hand: connects a real device to a running kneadd. This file reads the options, places the device's zero in the
// scene, starts the bridge, and reports on device and bridge. The bridge (bridge.h) runs the thread that serves the
// device.
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/hand/bus_client.h"
#include "clients/hand/tool_height.h"
#include "clients/hand/live_server.h"
#include "clients/tactile/haply.h"
#include "clients/tactile/paddle.h"
#include "clients/tactile/spacenav.h"
#include "clients/tactile/vendor.h"
#include "core/scene/keys.h"
#include "server/backend/link.h"
#include "server/clock.h"
#include "server/option_table.h"
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

// ---- options

typedef enum hand_kind {
    KN_HAND_PADDLE,
    KN_HAND_SPACENAV,
    KN_HAND_HAPLY,
    KN_HAND_FORCEDIMENSION, // this kind and the next are in the order of kn_vendor_kind
    KN_HAND_TOUCH
} hand_kind;

// Parsed options. If an option was not given, its field is NULL or 0. Exceptions: baud, puck.turn_rad_s, host, port
// and preset then have default values.
typedef struct hand_options {
    hand_kind kind;
    const char *probe; // NULL: the first round probe of the scene, or the first probe if none is round
    const char *lcm_url, *mesh_url;
    // origin: text of --origin, the zero of the device. basis: text of --basis, the axes of the device. NULL: use the
    // scene's `device:`.
    const char *origin, *basis;
    // scale, force_limit_n: 0 means as in the scene's `device:`. origin_m: valid only if `origin` is not NULL.
    double origin_m[3], scale, force_limit_n;
    double seconds; // time to run; 0: run until a signal
    bool local, quiet, unwatched;
    const char *tty; // device file of a paddle's serial line
    int baud;
    kn_puck_def puck;         // motion of a tool that a 3D mouse (spacenav) steers
    char host[KN_HAPLY_HOST]; // host name of Haply's Inverse Service
    int port;
    const char *device_id, *preset;
} hand_options;

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead hand paddle --tty DEVICE [OPTION]...\n"
    "       knead hand spacenav [OPTION]...\n"
    "       knead hand haply [OPTION]...\n"
    "       knead hand forcedimension [OPTION]...\n"
    "       knead hand touch --no-watchdog [OPTION]...\n\n"
    "Use a real device as the hand of a running kneadd: send its poses as they come, and give its motors each force\n"
    "as soon as kneadd sends it. UNTESTED ON HARDWARE: all drivers have been tested with simulated devices only.\n"
    "Begin with a low --force-limit, and with a hand on the device's switch. If no force or no pose comes for 20 ms,\n"
    "a watchdog sets the force to 0 N. This program then sends no pose for 1.2 s, and begins a new session. In the\n"
    "new session the tool feels a force only after it has been clear of the object. The same happens if the force\n"
    "jumps so much that the impulse guard trips (device.guard of the scene). If the round trip to kneadd is above 5\n"
    "ms, the force is 0 N. If the device disappears, this program waits for it. It runs until SIGINT or SIGTERM,\n"
    "then prints its counters.\n\n"
    "paddle: a force-feedback paddle with one degree of freedom on a serial line (Hapkit class), with the 20-byte\n"
    "frames of clients/tactile/README.md. The paddle moves along the z axis of the device:\n"
    "  --tty DEVICE        serial line, e.g. /dev/ttyACM0; knead devices lists candidates\n"
    "  --baud N            230400, 460800, 500000, 576000, 921600, 1000000, 1152000, 1500000, 2000000, 2500000,\n"
    "                      3000000, 3500000 or 4000000 (default: 500000)\n\n"
    "spacenav: a 3Dconnexion puck through spacenavd and libspnav, with six degrees of freedom and no force. The\n"
    "deflection of the puck sets the velocity of the tool; the pose has the buttons of the puck:\n"
    "  --speed V           speed at full deflection (default: '5 cm/s')\n"
    "  --turn W            rad/s at full twist; 0 keeps the tool's orientation (default: 1)\n"
    "  --dead N            dead zone in counts; full deflection is 350 counts (default: 15)\n"
    "  --reach L           largest distance from the zero along each axis (default: '8 cm'). The tool also stays\n"
    "                      above half the object's height, because no force stops the hand\n\n"
    "haply: an Inverse3 or Minverse through Haply's Inverse Service 3.5, with three degrees of freedom with force,\n"
    "and the orientation and buttons of a grip:\n"
    "  --url URL           address of the service, ws://HOST:PORT (default: " KN_HAPLY_URL ")\n"
    "  --device ID         arm to use (default: the first)\n"
    "  --preset NAME       preset of the service for the placement of the arm (default: " KN_HAPLY_PRESET ")\n\n"
    "forcedimension: omega, delta or sigma through libdhd of the Force Dimension SDK 3, which you install. Three\n"
    "degrees of freedom with force, and the orientation of a wrist.\n\n"
    "touch: a Touch or Phantom of 3D Systems through libHD of OpenHaptics 3, which you install. Three degrees of\n"
    "freedom with force, and orientation and buttons of the stylus. libHD cannot show that the arm drops its force\n"
    "when this program dies, so --no-watchdog is required:\n"
    "  --device NAME       arm by its name in the maker's setup program (default: the default arm)\n\n"
    "all devices:\n"
    "  --probe NAME        tool of the scene (default: the first round tool, else the first tool)\n"
    "  --origin X,Y,Z      place of the device's zero in the scene, like '0,0,6 cm' (default: device.position; if\n"
    "                      this is 0, over the middle of the object, with the tool 2 cm above the object)\n"
    "  --basis AXES        axes of the device along x, y and z of the scene, like XYZ or Y-XZ (default: device.basis;\n"
    "                      XYZ is x to the right, y forward, z up)\n"
    "  --scale F           metres of the scene per metre of the device (default: device.scale)\n"
    "  --local             devices with motors: compute the force here, from the contact that kneadd --local-model\n"
    "                      sends and the device's own poses; needed if the round trip is above 5 ms\n"
    "  --force-limit F     largest force of the motors, like '3 N' (default: device.clamp; 3.3 N for the profile\n"
    "                      bench)\n"
    "  --no-watchdog       give force without a test of the device's own watchdog\n"
    "  --seconds TIME      end after this time (default: run until SIGINT)\n"
    "  --lcm-url URL       bus of poses and forces (default: LCM_DEFAULT_URL, else " KN_FORCE_URL ")\n"
    "  --mesh-url URL      bus of meshes (default: " KN_MESH_URL ")\n"
    "  --quiet             do not print the line with the tool's position and force\n\n"
    "Examples:\n"
    "    knead hand paddle --tty /dev/ttyACM0 --force-limit '1 N'\n"
    "    knead hand spacenav --speed '2 cm/s'\n"
    "    knead hand haply --force-limit '1 N'\n"
    "    knead hand forcedimension --force-limit '1 N'\n"
    "    knead hand touch --no-watchdog --force-limit '1 N'\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 no device, no bus or no kneadd.\n";
// clang-format on

#define DEVICES "paddle, spacenav, haply, forcedimension or touch"

static bool read_length(const char *text, double *value_m)
{
    return kn_quantity_read(text, "m", false, -DBL_MAX, DBL_MAX, value_m);
}

// Read three lengths. The last length must have a unit. This unit also applies to the other two lengths if they have
// none.
static const char *take_origin(void *options, const char *text)
{
    hand_options *o = options;
    char part[3][48], one[60], more;
    double *x = o->origin_m, unit_m = 0.0;
    o->origin = text;
    bool ok = sscanf(text, "%47[^,],%47[^,],%47[^,]%c", part[0], part[1], part[2], &more) == 3;
    snprintf(one, sizeof one, "1 %s", ok ? part[2] + strspn(part[2], " +-.0123456789eE") : "");
    ok = ok && read_length(part[2], &x[2]) && read_length(one, &unit_m);
    for (int i = 0; ok && i < 2; i++) {
        if (kn_quantity_read(part[i], "", true, -DBL_MAX, DBL_MAX, &x[i])) x[i] *= unit_m;
        else ok = read_length(part[i], &x[i]);
    }
    return ok ? NULL : "three lengths like '0,0,6 cm'";
}

static const char *take_basis(void *basis, const char *text)
{
    char why[128];
    kn_device_def any;
    *(const char **)basis = text;
    // Check the text of the basis now, with a temporary device, because the device of the scene is not known yet.
    kn_mount_init(&any);
    if (kn_mount_basis(&any, text, why, sizeof why)) return NULL;
    kn_complain("hand", KN_EXIT_USAGE, "--basis %s: %s", text, why);
    return KN_OPTION_TOLD;
}

static const char *take_baud(void *baud, const char *text)
{
    char why[KN_LINK_WHY];
    double rate = 0;
    // at least 230400, so that the line can carry 1000 frames per second in both directions
    const bool good = kn_number_take(text, 230400, 4e6, &rate) && kn_link_is_baud(*(int *)baud = (int)rate, why);
    return good && rate == *(int *)baud ? NULL
                                        : "230400, 460800, 500000, 576000, 921600, 1000000, 1152000, "
                                          "1500000, 2000000, 2500000, 3000000, 3500000 "
                                          "or 4000000";
}

static const char *take_preset(void *preset, const char *text)
{
    return kn_haply_id_known(*(const char **)preset = text) ? NULL : "";
}

static const char *take_url(void *options, const char *text)
{
    hand_options *o = options;
    return kn_haply_url(text, o->host, &o->port) ? NULL : "ws://HOST:PORT";
}

// Read the kind of device. It is the only argument that is not an option.
static int device(hand_options *o, int count, char **names)
{
    if (count != 1)
        return kn_complain("hand", KN_EXIT_USAGE, "expected one device: " DEVICES "; knead hand --help explains them");
    const int kind = kn_choice_of("paddle|spacenav|haply|forcedimension|touch", names[0]);
    if (kind < 0) return kn_complain("hand", KN_EXIT_USAGE, "no device `%s`: expected " DEVICES, names[0]);
    o->kind = (hand_kind)kind;
    return KN_OPTIONS_READ;
}

// Check that the options fit together, and that the URLs are valid.
static int check(const hand_options *o)
{
    char error[256];
    if (o->kind == KN_HAND_PADDLE && !o->tty)
        return kn_complain("hand", KN_EXIT_USAGE, "expected --tty DEVICE; knead devices lists candidates");
    if (o->kind == KN_HAND_SPACENAV && o->local)
        return kn_complain("hand", KN_EXIT_USAGE, "--local: a puck has no motors, expected a device with motors");
    if (o->device_id && o->kind != KN_HAND_HAPLY && o->kind != KN_HAND_TOUCH)
        return kn_complain("hand", KN_EXIT_USAGE, "--device: only for haply and touch");
    if (o->device_id && o->kind == KN_HAND_HAPLY && !kn_haply_id_known(o->device_id))
        return kn_complain("hand", KN_EXIT_USAGE, "--device %s: expected an id like 049D", o->device_id);
    if (o->kind == KN_HAND_TOUCH && !o->unwatched)
        return kn_complain("hand", KN_EXIT_USAGE,
                           "touch needs --no-watchdog, because libHD cannot show that the arm drops its force when "
                           "this program dies. Keep a hand on the power switch");
    if (!kn_bus_client_check(o->lcm_url, KN_FORCE_URL, error, sizeof error) ||
        !kn_bus_client_check(o->mesh_url, KN_MESH_URL, error, sizeof error))
        return kn_complain("hand", KN_EXIT_USAGE, "%s", error);
    return KN_OPTIONS_READ;
}

#define AT(member) .offset = offsetof(hand_options, member)
static const kn_option rows[] = {
    KN_OPTION("tty", TEXT, AT(tty)),
    KN_OPTION("baud", SPECIAL, AT(baud), .take = take_baud),
    KN_OPTION("speed", QUANTITY, AT(puck.speed_m_s), .unit = "m/s", .expected = "something like '5 cm/s'"),
    KN_OPTION("turn", NUMBER, AT(puck.turn_rad_s), KN_RANGE(0, 10), .expected = "0 to 10 rad/s"),
    KN_OPTION("dead", INTEGER, AT(puck.dead), KN_RANGE(1, KN_PUCK_FULL - 1), .expected = "1 to 349 counts"),
    KN_OPTION("reach", QUANTITY, AT(puck.reach_m), .unit = "m", .expected = "something like '8 cm'"),
    KN_OPTION("url", SPECIAL, .take = take_url),
    KN_OPTION("device", TEXT, AT(device_id)),
    KN_OPTION("preset", SPECIAL, AT(preset), .take = take_preset, .expected = "a name like " KN_HAPLY_PRESET),
    KN_OPTION("probe", TEXT, AT(probe)),
    KN_OPTION("origin", SPECIAL, .take = take_origin),
    KN_OPTION("basis", SPECIAL, AT(basis), .take = take_basis),
    KN_OPTION("scale", NUMBER, AT(scale), .expected = "a number above 0"),
    KN_OPTION("force-limit", QUANTITY, AT(force_limit_n), .unit = "N", .expected = "something like '3.3 N'"),
    KN_OPTION("seconds", QUANTITY, AT(seconds), .unit = "s", .expected = "a time like '10 s'"),
    KN_OPTION("lcm-url", TEXT, AT(lcm_url)),
    KN_OPTION("mesh-url", TEXT, AT(mesh_url)),
    KN_OPTION("quiet", FLAG, AT(quiet)),
    KN_OPTION("local", FLAG, AT(local)),
    KN_OPTION("no-watchdog", FLAG, AT(unwatched)),
};

// Parse the command line. Return KN_OPTIONS_READ, or an exit code: 0 after --help, KN_EXIT_USAGE after a mistake.
static int parse(hand_options *o, int argc, char **argv)
{
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    *o = (hand_options){.baud = 500000, .puck.turn_rad_s = 1.0, .preset = KN_HAPLY_PRESET};
    kn_haply_url(KN_HAPLY_URL, o->host, &o->port);
    int code = kn_options_read(&table, o, argc, argv);
    if (code == KN_OPTIONS_READ) code = device(o, argc - optind, argv + optind);
    return code == KN_OPTIONS_READ ? check(o) : code;
}

// ---- state

static const int scene_wait_ms = 4000; // longest wait for KNEAD_SCENE, which comes every 1 s
static const int look_ms = 50;         // interval at which the state of the bridge is read
static const int answer_ms = 3000;     // time without a force after which the missing answer is reported
// Shortest tick, ms, that is reported as a stall of this process.
static const int stalled_ms = 10;
// Shortest time between two reports of bad messages, so that they cannot fill a terminal.
static const int bad_ms = 10000;
static const double above_m = 0.02; // height of the tool above the object at the start
// Force limit that replaces the limit of the profile `bench`, because this profile describes a virtual hand. The value
// is the smallest force limit of the common real devices.
static const double cautious_n = 3.3;
// Lowest height of the underside of a tool that a puck steers, as a fraction of the object's height.
static const double thinnest = 0.5;

// State of the reports, so that each event is reported once.
typedef struct told {
    kn_bridge_news last; // state of the bridge at the last report
    // bad_ms: time of the last report of bad messages. far_ms: time of the last report of a slow link. answer_ms: time
    // since which no force has come.
    int64_t bad_ms, far_ms, answer_ms;
    int64_t model_ms; // time since which kneadd has sent forces but no contact messages
    int64_t foreign;  // value of the session's counter `foreign` when the last force of this session came
    bool unanswered, modelless;
} told;

typedef struct hand {
    hand_options opt;
    char probe[KN_NAME_MAX], error[512];
    kn_haptic_render_def render;
    kn_bridge bridge;
    union {
        kn_tactile base;
        kn_paddle paddle;
        kn_spacenav spacenav;
        kn_haply haply;
        kn_vendor vendor;
    } device;
    told told;
} hand;

static int complain(int code, const char *what) { return kn_complain("hand", code, "%s", what); }

// Set up the output stage from the scene's `device:` and the tool. Options of the command line take precedence.
static void mount(hand *h, const kn_scene *scene, const kn_probe_def *tool)
{
    kn_device_def *d = &h->render.device;
    const hand_options *o = &h->opt;
    double extent_m[3], *at_m = d->position_m, axes[3][3];
    h->render = (kn_haptic_render_def){.device = scene->device,
                                       .coupling_n_m = tool->coupling_n_m,
                                       .coupling_n_s_m = tool->coupling_n_s_m,
                                       .radius_m = tool->radius_m,
                                       .level = tool->shape == KN_PROBE_PLATE,
                                       .guard_n_per_ms = scene->limits.guard_n_per_ms,
                                       .local = o->local,
                                       // A puck has no motors, so a force that comes late can do no harm: never stop
                                       // the output stage for a slow link.
                                       .held = o->kind == KN_HAND_SPACENAV};
    kn_model_def_extent(&scene->model, extent_m);
    if (o->origin) memcpy(at_m, o->origin_m, sizeof d->position_m);
    else if (at_m[0] == 0.0 && at_m[1] == 0.0 && at_m[2] == 0.0)
        at_m[2] = extent_m[2] + kn_tool_height_m(tool) + above_m;
    if (o->basis) kn_mount_basis(d, o->basis, h->error, sizeof h->error); // checked by take_basis
    if (o->scale > 0.0) d->scale = o->scale;
    // Without the option --force-limit, replace the limit of the bench profile, because real devices do not bear so
    // much force.
    if (o->force_limit_n > 0.0) d->force_limit_n = o->force_limit_n;
    else if (!strcmp(d->name, "bench")) d->force_limit_n = cautious_n;
    kn_device_axes(d, axes);
    // Limit how deep a tool steered by a puck can go. If the mount is tilted, the device's z axis does not point up, so
    // only --reach limits the tool.
    bool upright = axes[2][2] > 0.999;
    h->opt.puck.floor_m = upright ? (thinnest * extent_m[2] + kn_tool_height_m(tool) - at_m[2]) / d->scale : -INFINITY;
}

static int use_scene(hand *h, const kn_scene *scene)
{
    const kn_probe_def *tool = kn_tool_height_choose_tool(&scene->model, h->opt.probe);
    if (!tool)
        return kn_complain("hand", KN_EXIT_USAGE, "%s has no probe %s", scene->name, h->opt.probe ? h->opt.probe : "");
    strcpy(h->probe, tool->name);
    mount(h, scene, tool);
    return KN_EXIT_OK;
}

// Find the tool, the object's height and the device's settings in the scene that kneadd serves.
static int look_at_scene(hand *h)
{
    kn_live_server live;
    if (!kn_live_server_open(&live, h->opt.lcm_url, h->opt.mesh_url, h->error, sizeof h->error))
        return complain(KN_EXIT_DEVICE, h->error);
    for (int64_t end_ms = kn_live_server_now_ms() + scene_wait_ms;
         !live.scene && kn_live_server_now_ms() < end_ms && !kn_interrupted;)
        kn_live_server_listen(&live, look_ms);
    int code = live.scene          ? use_scene(h, live.scene)
               : *live.scene_error ? complain(KN_EXIT_USAGE, live.scene_error)
                                   : kn_complain("hand", KN_EXIT_DEVICE, "no KNEAD_SCENE for 4 s: %s",
                                                 kn_bus_client_why(KN_BUS_CLIENT_ASK));
    kn_live_server_close(&live);
    return code;
}

// ---- reports to the user: each event is reported once, and bad messages at most every 10 s

// Report losses, arrivals and bad messages of the device.
static void tell_device(told *t, const kn_bridge_news *n, const char *name, int64_t now_ms)
{
    const kn_bridge_news *last = &t->last;
    if (n->losses > last->losses)
        fprintf(stderr, "knead hand: %s lost: %s; the force is 0 N; retrying twice a second\n", name, n->why);
    if (n->arrivals > last->arrivals && last->arrivals > 0) fprintf(stderr, "knead hand: %s is back\n", name);
    if (n->device.bad <= last->device.bad || (last->device.bad > 0 && now_ms - t->bad_ms < bad_ms)) return;
    fprintf(stderr, "knead hand: %s: %s\n", name, n->device.why);
    t->bad_ms = now_ms;
}

// Report three events: a trip of the impulse guard, a link that is too slow, and missing contact messages.
static void tell_stop(told *t, const kn_device_session *r, const char *then, int64_t now_ms)
{
    const kn_haptic_render *n = &r->render, *last = &t->last.session.render;
    if (n->reflexes > last->reflexes)
        fprintf(stderr, "knead hand: %s: %s\n", kn_haptic_render_why(KN_HAPTIC_RENDER_REFLEX), then);
    if (n->refusals > last->refusals && (last->refusals == 0 || now_ms - t->far_ms >= bad_ms)) {
        fprintf(stderr, "knead hand: %s\n", kn_haptic_render_why(KN_HAPTIC_RENDER_FAR));
        t->far_ms = now_ms;
    }
    // The local model needs contact messages. If only forces arrive, kneadd was started without --local-model.
    bool misses = n->def.local && r->heard > t->last.session.heard && n->model.taken == last->model.taken;
    if (!misses) t->model_ms = now_ms, t->modelless = false;
    if (t->modelless || now_ms - t->model_ms < answer_ms) return;
    t->modelless = true;
    fprintf(stderr, "knead hand: kneadd sent forces but no contact messages for 3 s: the force is 0 N; start kneadd "
                    "with --local-model\n");
}

// Report watchdog trips, faults of kneadd, and missing forces.
static void tell_session(told *t, const kn_bridge_news *n, const char *name, int64_t now_ms)
{
    const kn_device_session *r = &n->session, *last = &t->last.session;
    const char *then = "the force is 0 N; a new session begins after 1.2 s without poses";
    bool force = r->forces.trips > last->forces.trips, pose = r->poses.trips > last->poses.trips;
    // If the tick lasted 10 ms or more, this process itself stood still, so neither the device nor kneadd caused the
    // trip.
    if ((force || pose) && r->stalled_ms >= stalled_ms)
        fprintf(stderr, "knead hand: this program did not run for %d ms: %s\n", r->stalled_ms, then);
    else if (force) fprintf(stderr, "knead hand: no force from kneadd for 20 ms: %s\n", then);
    else if (pose && n->there) fprintf(stderr, "knead hand: no pose from the %s for 20 ms: %s\n", name, then);
    if (r->faults > last->faults) fprintf(stderr, "knead hand: kneadd's impulse guard has tripped: %s\n", then);
    tell_stop(t, r, then, now_ms);

    if (r->flags & KN_FLAG_LATCHED && !(last->flags & KN_FLAG_LATCHED))
        fprintf(stderr, "knead hand: kneadd: %s: %s\n", kn_fault_name((kn_fault)r->fault),
                kn_fault_remedy((kn_fault)r->fault));
    // While the device is lost, do not report missing forces, because the loss was already reported.
    bool away = !n->there && n->arrivals > 0;
    if (r->heard > last->heard || away) t->answer_ms = now_ms, t->unanswered = false, t->foreign = r->foreign;
    if (t->unanswered || now_ms - t->answer_ms < answer_ms) return;
    t->unanswered = true;
    fprintf(stderr, "knead hand: no force for 3 s: %s\n",
            r->foreign > t->foreign ? "another client holds the tool"
            : n->there              ? kn_bus_client_why("is kneadd running, and does it serve this probe?")
            : *n->why               ? n->why
            : *n->device.state      ? n->device.state
                                    : "the device has not sent a position yet");
}

// Overwrite one terminal line with the tool's position, its force and the state of the link.
static void tell_tool(const kn_bridge_news *n)
{
    const double *x = n->position_m, *f = n->session.render.given_n;
    printf("\r%6.1f %6.1f %6.1f mm  %6.2f %6.2f %6.2f N  %-28s", 1e3 * x[0], 1e3 * x[1], 1e3 * x[2], f[0], f[1], f[2],
           !n->there                                        ? "no device"
           : n->session.mode == KN_SESSION_SILENT           ? "silent"
           : n->session.render.stop == KN_HAPTIC_RENDER_FAR ? "round trip above 5 ms: 0 N"
           : n->session.flags & KN_FLAG_REENGAGE_LIFT       ? "lift the tool"
           : n->session.flags & KN_FLAG_ENGAGED
               ? n->session.render.def.local ? "in the model, local force" : "in the model"
               : n->device.state);
    fflush(stdout);
}

// Print the counters of the whole run.
static void summarise(const kn_bridge_news *n, const char *name, bool motors)
{
    const kn_device_session *t = &n->session;
    printf("knead hand: %" PRId64 " poses, %" PRId64 " forces, largest %.3g N, clamped %" PRId64 "\n", t->sent,
           t->heard, t->render.largest_n, t->render.clamped);
    if (motors)
        printf("knead hand: energy given to the hand %.3g mJ, force damped in %" PRId64
               " periods; impulse guard limited %" PRId64 " forces, tripped %" PRId64 " times; round trip %.1f ms%s\n",
               1e3 * t->render.passivity.given_j, t->render.passivity.acted, t->render.guards, t->render.reflexes,
               1e3 * t->render.round_trip_s, t->render.refusals ? ", too long for a force" : "");
    if (t->render.def.local)
        printf("knead hand: local model: %" PRId64 " contact messages used in the last session, %" PRId64 " rejected\n",
               t->render.model.taken, t->render.model.refused);
    printf("knead hand: sessions ended by silence of kneadd %" PRId64 ", by silence of the device %" PRId64
           ", by kneadd's impulse guard %" PRId64 "; forces for other clients %" PRId64 "\n",
           t->forces.trips, t->poses.trips, t->faults, t->foreign);
    printf("knead hand: %s: %" PRId64 " messages, bad %" PRId64 ", missing %" PRId64 "; device found %" PRId64
           " times, lost %" PRId64 " times; timer late by %" PRId64 " ms in all%s%s%s%s\n",
           name, n->device.messages, n->device.bad, n->device.lost, n->arrivals, n->losses, n->late,
           *n->device.why ? "; last bad message: " : "", n->device.why, *n->device.state ? "; " : "", n->device.state);
}

// Report changes of the bridge's state until the end. If the test of the device's own watchdog has failed, return
// KN_EXIT_DEVICE: the device would go on giving a force when this program stops.
static int watch(hand *h)
{
    const char *name = h->device.base.name;
    bool follow = !h->opt.quiet && isatty(STDOUT_FILENO);
    int64_t begin_ms = kn_live_server_now_ms(), now_ms = begin_ms;
    h->told.answer_ms = begin_ms;
    while (!kn_interrupted && (h->opt.seconds == 0.0 || 1e-3 * (double)(now_ms - begin_ms) < h->opt.seconds)) {
        kn_clock_sleep(kn_now_ns() + look_ms * 1000000);
        const kn_bridge_news *n = kn_bridge_latest(&h->bridge);
        now_ms = kn_live_server_now_ms();
        if (n->device.watchdog == KN_OWN_MISSING)
            return kn_complain("hand", KN_EXIT_DEVICE, "%s: %s; --no-watchdog gives force without this test", name,
                               n->untrusted);
        tell_session(&h->told, n, name, now_ms);
        tell_device(&h->told, n, name, now_ms);
        h->told.last = *n;
        if (follow) tell_tool(n);
    }
    if (follow) putchar('\n');
    return KN_EXIT_OK;
}

// Start the driver and the bridge, report their state until the end, and print the summary.
static int run(hand *h)
{
    const kn_device_def *d = &h->render.device;
    kn_bridge_def def = {.url = h->opt.lcm_url, .probe = h->probe, .render = h->render};
    uint32_t random;
    if (h->opt.kind == KN_HAND_PADDLE) kn_paddle_init(&h->device.paddle, h->opt.tty, h->opt.baud);
    else if (h->opt.kind == KN_HAND_SPACENAV) kn_spacenav_init(&h->device.spacenav, &h->opt.puck);
    else if (h->opt.kind == KN_HAND_HAPLY)
        kn_haply_init(&h->device.haply, h->opt.host, h->opt.port, h->opt.device_id ? h->opt.device_id : "",
                      h->opt.preset);
    else kn_vendor_init(&h->device.vendor, (kn_vendor_kind)(h->opt.kind - KN_HAND_FORCEDIMENSION), h->opt.device_id);
    h->device.base.unwatched = h->opt.unwatched;
    if (getrandom(&random, sizeof random, 0) != sizeof random) return complain(KN_EXIT_DEVICE, "no random number");
    // The session numbers start at a random multiple of 2^20, plus 1. Each later session has the next number. So the
    // random part of the number stays unchanged in the first million sessions.
    def.session = 1 + ((int64_t)random << 20);
    if (!kn_bridge_start(&h->bridge, &def, &h->device.base, h->error, sizeof h->error))
        return complain(KN_EXIT_DEVICE, h->error);
    if (h->bridge.priority_error)
        fprintf(stderr, "knead hand: no real-time priority (%s): poses and forces may be late\n",
                strerror(h->bridge.priority_error));
    printf("knead hand: %s on probe %s as device %s, its zero at %g, %g, %g mm, force at most %g N; untested on "
           "hardware\n",
           h->device.base.name, h->probe, d->name, 1e3 * d->position_m[0], 1e3 * d->position_m[1],
           1e3 * d->position_m[2], d->force_limit_n);
    fflush(stdout);
    int code = watch(h);
    kn_bridge_stop(&h->bridge);
    summarise(kn_bridge_latest(&h->bridge), h->device.base.name, h->device.base.give != NULL);
    return code;
}

int kn_hand_main(int argc, char **argv)
{
    hand *h = calloc(1, sizeof *h);
    if (!h) return complain(KN_EXIT_INTERNAL, "out of memory");
    int code = parse(&h->opt, argc, argv);
    if (code == KN_OPTIONS_READ) {
        // Ignore SIGPIPE, which libspnav and sockets raise when a device is gone. The bridge handles the loss.
        signal(SIGPIPE, SIG_IGN);
        kn_interrupt_watch();
        code = look_at_scene(h);
        if (code == KN_EXIT_OK && !kn_interrupted) code = run(h);
    }
    free(h);
    return code;
}
