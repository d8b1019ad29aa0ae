#include "clients/tactile/hand_options.h"
#include "clients/cli/commands.h"
#include "clients/cli/command.h"
#include "clients/hand/bus_client.h"
#include "clients/tactile/paddle.h"
#include "core/scene/keys.h"
#include "core/scene/units.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Each line of the help text is one line here, so that it can be read as it is printed.
// clang-format off
static const char help[] =
    "usage: knead hand paddle --tty DEVICE [--baud N] [OPTION]...\n"
    "       knead hand spacenav [--speed V] [--turn W] [--dead N] [--reach L] [OPTION]...\n"
    "       knead hand haply [--url URL] [--device ID] [--preset NAME] [OPTION]...\n\n"
    "Use a real device as the hand of a running kneadd: send its poses as they come, and give its motors each force as soon\n"
    "as kneadd sends it. A watchdog sets the force to 0 N 20 ms after the last force or the last pose; then follow 1.2 s of\n"
    "silence and a new session, which begins with the tool clear of the object. The same happens if a force would jump by\n"
    "more than the scene's device.guard. Forces older than 5 ms are refused. If the device disappears, this program waits\n"
    "for it. It runs until SIGINT or SIGTERM, then prints its counters. UNTESTED ON HARDWARE: all drivers have been tested\n"
    "with simulated devices only. Begin with a low --force-limit, and with a hand on the device's switch.\n\n"
    "  paddle    force-feedback paddle with one degree of freedom on a serial line (Hapkit class): 20-byte frames, see\n"
    "            clients/tactile/README.md. Its position is z\n"
    "    --tty DEVICE   serial line, e.g. /dev/ttyACM0; knead devices lists candidates\n"
    "    --baud N       " KN_PADDLE_BAUDS "\n"
    "                   (default: 921600)\n"
    "  spacenav  3Dconnexion puck through spacenavd and libspnav: six degrees of freedom, no force. The deflection of the\n"
    "            puck sets the velocity of the tool; its buttons become those of the pose\n"
    "    --speed V      speed at full deflection (default: '5 cm/s')\n"
    "    --turn W       rad/s at full twist; 0 keeps the tool's orientation (default: 1)\n"
    "    --dead N       dead zone in counts of 350 (default: 15)\n"
    "    --reach L      largest distance from the zero along each axis (default: '8 cm'); downwards at most half the\n"
    "                   object's height, since without force nothing else stops the tool\n"
    "  haply     Inverse3 or Minverse through Haply's Inverse Service 3.5: three degrees of freedom with force, and the\n"
    "            orientation and buttons of a grip\n"
    "    --url URL      address of the service, ws://HOST:PORT (default: " KN_HAPLY_URL ")\n"
    "    --device ID    arm to use (default: the first)\n"
    "    --preset NAME  placement of the arm, a name of the service (default: " KN_HAPLY_PRESET ")\n\n"
    "  --probe NAME        tool of the scene (default: its first round one, else its first probe)\n"
    "  --origin X,Y,Z      place of the device's zero in the scene, like '0,0,6 cm' (default: device.position; where that\n"
    "                      is 0, over the middle of the object, with the tool 2 cm above it)\n"
    "  --basis PERMUTATION axes of the device along x, y and z of the scene, like XYZ or Y-XZ (default: device.basis; XYZ\n"
    "                      is x to the right, y forward, z up)\n"
    "  --scale F           metres of the scene per metre of the device (default: device.scale)\n"
    "  --local             paddle, haply: compute the force here, from the contact that kneadd --local-model sends and the\n"
    "                      device's own poses; for links with a round trip above 5 ms, whose forces are refused\n"
    "  --force-limit F     largest force asked of the motors, like '3 N' (default: device.clamp; 3.3 N for profile bench)\n"
    "  --no-watchdog       paddle, haply: give force even if the device has not shown a watchdog of its own\n"
    "  --seconds N         end after N seconds\n"
    "  --lcm-url URL       bus of poses, forces and scene (default: $LCM_DEFAULT_URL, else " KN_FORCE_URL ")\n"
    "  --mesh-url URL      bus of meshes (default: " KN_MESH_URL ")\n"
    "  --quiet             do not print the line that follows the tool\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 no device, no bus or no kneadd.\n";
// clang-format on

#define DEVICES "paddle, spacenav or haply"

// Read a quantity and convert it to `unit_text`. A number without a unit has the unit *otherwise. If `otherwise` is
// NULL, such a number is refused. *said: the unit that the text has, or *otherwise.
static bool quantity(const char *text, const char *unit_text, const kn_unit *otherwise, kn_unit *said, double *value)
{
    kn_unit unit;
    kn_quantity q;
    char why[128];
    if (!kn_unit_parse(&unit, unit_text, why, sizeof why)) return false;
    if (!kn_quantity_parse(&q, text, why, sizeof why)) return false;
    if (q.bare && otherwise) q.unit = *otherwise, q.bare = false;
    if (q.bare || !kn_unit_same_dimension(&q.unit, &unit)) return false;
    *said = q.unit;
    *value = kn_quantity_in(&q, &unit);
    return isfinite(*value);
}

// Read three lengths. The last must have a unit, and the others use this unit if they have none.
static const char *take_origin(void *options, const char *text)
{
    kn_hand_options *o = options;
    char part[3][48];
    kn_unit unit, said;
    o->origin = text;
    bool ok = sscanf(text, "%47[^,],%47[^,],%47[^,]", part[0], part[1], part[2]) == 3;
    ok = ok && quantity(part[2], "m", NULL, &unit, &o->origin_m[2]);
    for (int i = 0; ok && i < 2; i++) ok = quantity(part[i], "m", &unit, &said, &o->origin_m[i]);
    return ok ? NULL : "three lengths like '0,0,6 cm'";
}

static const char *take_basis(void *basis, const char *text)
{
    char why[128];
    kn_device_def any;
    *(const char **)basis = text;
    // Check the text of the basis now, with a temporary device. The scene's device, to which the basis applies, is not
    // known yet.
    kn_mount_init(&any);
    if (kn_mount_basis(&any, text, why, sizeof why)) return NULL;
    kn_complain("hand", KN_EXIT_USAGE, "--basis %s: %s", text, why);
    return KN_OPTION_TOLD;
}

static const char *take_baud(void *baud, const char *text)
{
    return kn_paddle_baud_known(*(int *)baud = atoi(text)) ? NULL : KN_PADDLE_BAUDS;
}

static const char *take_id(void *id, const char *text)
{
    return kn_haply_id_known(*(const char **)id = text) ? NULL : "";
}

static const char *take_url(void *options, const char *text)
{
    kn_hand_options *o = options;
    return kn_haply_url(text, o->host, &o->port) ? NULL : "ws://HOST:PORT";
}

// Read the name of the device, which is the only argument that is not an option.
static int device(kn_hand_options *o, int count, char **names)
{
    if (count != 1)
        return kn_complain("hand", KN_EXIT_USAGE, "expected one device: " DEVICES "; knead hand --help tells the rest");
    const int kind = kn_choice_of("paddle|spacenav|haply", names[0]);
    if (kind < 0) return kn_complain("hand", KN_EXIT_USAGE, "no device `%s`: expected " DEVICES, names[0]);
    o->kind = (kn_hand_kind)kind;
    return KN_OPTIONS_READ;
}

// Check conditions between options, and the URLs.
static int check(const kn_hand_options *o)
{
    char error[256];
    if (o->kind == KN_HAND_PADDLE && !o->tty)
        return kn_complain("hand", KN_EXIT_USAGE, "expected --tty DEVICE; knead devices lists candidates");
    if (o->kind == KN_HAND_SPACENAV && o->local)
        return kn_complain("hand", KN_EXIT_USAGE, "--local: a puck has no motors, expected paddle or haply");
    if (!kn_bus_client_check(o->lcm_url, KN_FORCE_URL, error, sizeof error) ||
        !kn_bus_client_check(o->mesh_url, KN_MESH_URL, error, sizeof error))
        return kn_complain("hand", KN_EXIT_USAGE, "%s", error);
    return KN_OPTIONS_READ;
}

#define AT(member) .offset = offsetof(kn_hand_options, member)
static const kn_option rows[] = {
    KN_OPTION("tty", TEXT, AT(tty)),
    KN_OPTION("baud", SPECIAL, AT(baud), .take = take_baud),
    KN_OPTION("speed", QUANTITY, AT(puck.speed_m_s), .unit = "m/s", .expected = "something like '5 cm/s'"),
    KN_OPTION("turn", REAL, AT(puck.turn_rad_s), KN_RANGE(0, 10), .expected = "0 to 10 rad/s"),
    KN_OPTION("dead", INTEGER, AT(puck.dead), KN_RANGE(1, KN_PUCK_FULL - 1), .expected = "1 to 349 counts"),
    KN_OPTION("reach", QUANTITY, AT(puck.reach_m), .unit = "m", .expected = "something like '8 cm'"),
    KN_OPTION("url", SPECIAL, .take = take_url),
    KN_OPTION("device", SPECIAL, AT(device_id), .take = take_id, .expected = "an id like 049D"),
    KN_OPTION("preset", SPECIAL, AT(preset), .take = take_id, .expected = "a name like " KN_HAPLY_PRESET),
    KN_OPTION("probe", TEXT, AT(probe)),
    KN_OPTION("origin", SPECIAL, .take = take_origin),
    KN_OPTION("basis", SPECIAL, AT(basis), .take = take_basis),
    KN_OPTION("scale", REAL, AT(scale), .expected = "a number above 0"),
    KN_OPTION("force-limit", QUANTITY, AT(force_limit_n), .unit = "N", .expected = "something like '3.3 N'"),
    KN_OPTION("seconds", REAL, AT(seconds), .expected = "a number above 0"),
    KN_OPTION("lcm-url", TEXT, AT(lcm_url)),
    KN_OPTION("mesh-url", TEXT, AT(mesh_url)),
    KN_OPTION("quiet", FLAG, AT(quiet)),
    KN_OPTION("local", FLAG, AT(local)),
    KN_OPTION("no-watchdog", FLAG, AT(unwatched)),
};

int kn_hand_options_parse(kn_hand_options *o, int argc, char **argv)
{
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help,
                                          .unknown = "unknown option; knead hand --help lists them"};
    // Set the defaults. Fields that stay 0 get their value from the scene or from the driver.
    *o = (kn_hand_options){.baud = KN_PADDLE_BAUD, .puck.turn_rad_s = 1.0, .device_id = "", .preset = KN_HAPLY_PRESET};
    kn_haply_url(KN_HAPLY_URL, o->host, &o->port);
    int code = kn_options_read(&table, o, argc, argv);
    if (code == KN_OPTIONS_READ) code = device(o, argc - optind, argv + optind);
    return code == KN_OPTIONS_READ ? check(o) : code;
}
