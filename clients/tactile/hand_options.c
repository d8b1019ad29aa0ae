#include "clients/tactile/hand_options.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/join.h"
#include "clients/tactile/paddle.h"
#include "core/scene/units.h"
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: knead hand paddle --tty DEVICE [--baud N] [OPTION]...\n"
    "       knead hand spacenav [--speed V] [--turn W] [--dead N] [--reach L] [OPTION]...\n"
    "       knead hand haply [--url URL] [--device ID] [--preset NAME] [OPTION]...\n\n"
    "Use a real device as the hand of a running kneadd: send its poses as they come, and give its motors each force as "
    "soon\n"
    "as kneadd sends it. A watchdog sets the force to 0 N 20 ms after the last force or the last pose; then follow 1.2 "
    "s of\n"
    "silence and a new session, which begins with the tool clear of the object. The same happens if a force would jump "
    "by\n"
    "more than the scene's device.guard. Forces older than 5 ms are refused. If the device disappears, this program "
    "waits\n"
    "for it. It runs until SIGINT or SIGTERM, then prints its counters. UNTESTED ON HARDWARE: all drivers have been "
    "tested\n"
    "with simulated devices only. Begin with a low --force-limit, and with a hand on the device's switch.\n\n"
    "  paddle    force-feedback paddle with one degree of freedom on a serial line (Hapkit class): 20-byte frames, "
    "see\n"
    "            clients/tactile/README.md. Its position is z\n"
    "    --tty DEVICE   serial line, e.g. /dev/ttyACM0; knead devices lists candidates\n"
    "    --baud N       " KN_PADDLE_BAUDS "\n"
    "                   (default: 921600)\n"
    "  spacenav  3Dconnexion puck through spacenavd and libspnav: six degrees of freedom, no force. The deflection of "
    "the\n"
    "            puck sets the velocity of the tool; its buttons become those of the pose\n"
    "    --speed V      speed at full deflection (default: '5 cm/s')\n"
    "    --turn W       rad/s at full twist; 0 keeps the tool's orientation (default: 1)\n"
    "    --dead N       dead zone in counts of 350 (default: 15)\n"
    "    --reach L      largest distance from the zero along each axis (default: '8 cm'); downwards at most half the\n"
    "                   object's height, since without force nothing else stops the tool\n"
    "  haply     Inverse3 or Minverse through Haply's Inverse Service 3.5: three degrees of freedom with force, and "
    "the\n"
    "            orientation and buttons of a grip\n"
    "    --url URL      address of the service, ws://HOST:PORT (default: " KN_HAPLY_URL ")\n"
    "    --device ID    arm to use (default: the first)\n"
    "    --preset NAME  placement of the arm, a name of the service (default: " KN_HAPLY_PRESET ")\n\n"
    "  --probe NAME        tool of the scene (default: its first round one, else its first probe)\n"
    "  --origin X,Y,Z      place of the device's zero in the scene, like '0,0,6 cm' (default: device.position; where "
    "that\n"
    "                      is 0, over the middle of the object, with the tool 2 cm above it)\n"
    "  --basis PERMUTATION axes of the device along x, y and z of the scene, like XYZ or Y-XZ (default: device.basis; "
    "XYZ\n"
    "                      is x to the right, y forward, z up)\n"
    "  --scale F           metres of the scene per metre of the device (default: device.scale)\n"
    "  --local             paddle, haply: compute the force here, from the contact that kneadd --local-model sends and "
    "the\n"
    "                      device's own poses; for links with a round trip above 5 ms, whose forces are refused\n"
    "  --force-limit F     largest force asked of the motors, like '3 N' (default: device.clamp; 3.3 N for profile "
    "bench)\n"
    "  --no-watchdog       paddle, haply: give force even if the device has not shown a watchdog of its own\n"
    "  --seconds N         end after N seconds\n"
    "  --lcm-url URL       bus of poses, forces and scene (default: $LCM_DEFAULT_URL, else " KN_FORCE_URL ")\n"
    "  --mesh-url URL      bus of meshes (default: " KN_MESH_URL ")\n"
    "  --quiet             do not print the line that follows the tool\n\n"
    "Exit codes: 0 ok, 2 bad input, 3 no device, no bus or no kneadd.\n";

#define DEVICES "paddle, spacenav or haply"

static int bad(const char *option, const char *text, const char *expected)
{
    return kn_complain("hand", KN_EXIT_USAGE, "--%s %s: expected %s", option, text, expected);
}

// Read a finite number above 0.
static int number(const char *option, const char *text, double *value)
{
    char *end;
    *value = strtod(text, &end);
    if (end != text && !*end && isfinite(*value) && *value > 0.0) return KN_EXIT_OK;
    return bad(option, text, "a number above 0");
}

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

// Read a quantity above 0, like '5 cm/s'.
static int quantity_option(const char *option, const char *text, const char *unit, const char *example, double *value)
{
    kn_unit said;
    if (quantity(text, unit, NULL, &said, value) && *value > 0.0) return KN_EXIT_OK;
    return kn_complain("hand", KN_EXIT_USAGE, "--%s %s: expected something like '%s'", option, text, example);
}

// Read three lengths. The last must have a unit, and the others use this unit if they have none.
static int origin(const char *text, double origin_m[3])
{
    char part[3][48];
    kn_unit unit, said;
    bool ok = sscanf(text, "%47[^,],%47[^,],%47[^,]", part[0], part[1], part[2]) == 3;
    ok = ok && quantity(part[2], "m", NULL, &unit, &origin_m[2]);
    for (int i = 0; ok && i < 2; i++) ok = quantity(part[i], "m", &unit, &said, &origin_m[i]);
    return ok ? KN_EXIT_OK : bad("origin", text, "three lengths like '0,0,6 cm'");
}

// Read the name of the device, which is the only argument that is not an option.
static int device(kn_hand_options *o, int count, char **names)
{
    static const char *const known[] = {
        [KN_HAND_PADDLE] = "paddle", [KN_HAND_SPACENAV] = "spacenav", [KN_HAND_HAPLY] = "haply"};
    if (count != 1)
        return kn_complain("hand", KN_EXIT_USAGE, "expected one device: " DEVICES "; knead hand --help tells the rest");
    for (int i = 0; i < (int)(sizeof known / sizeof *known); i++)
        if (!strcmp(names[0], known[i])) return o->kind = (kn_hand_kind)i, KN_EXIT_OK;
    return kn_complain("hand", KN_EXIT_USAGE, "no device `%s`: expected " DEVICES, names[0]);
}

// Check conditions between options, and the URLs.
static int check(const kn_hand_options *o)
{
    char error[256];
    if (o->kind == KN_HAND_PADDLE && !o->tty)
        return kn_complain("hand", KN_EXIT_USAGE, "expected --tty DEVICE; knead devices lists candidates");
    if (o->kind == KN_HAND_SPACENAV && o->local)
        return kn_complain("hand", KN_EXIT_USAGE, "--local: a puck has no motors, expected paddle or haply");
    if (!kn_join_check(o->lcm_url, KN_FORCE_URL, error, sizeof error) ||
        !kn_join_check(o->mesh_url, KN_MESH_URL, error, sizeof error))
        return kn_complain("hand", KN_EXIT_USAGE, "%s", error);
    return KN_EXIT_OK;
}

// Values of the long options. All values are above those of characters, so that none is taken for a short option.
enum { TTY = 256, BAUD, SPEED, TURN, DEAD, REACH, URL, DEVICE, PRESET };
enum { PROBE = PRESET + 1, ORIGIN, BASIS, SCALE, LIMIT, SECONDS, LCM_URL, MESH_URL, QUIET, LOCAL, UNWATCHED, HELP };

// Store an option that belongs to one kind of device.
static int take_of_device(kn_hand_options *o, int option, const char *text)
{
    char *end;
    switch (option) {
    case TTY: o->tty = text; break;
    case BAUD: o->baud = atoi(text); return kn_paddle_baud_known(o->baud) ? 0 : bad("baud", text, KN_PADDLE_BAUDS);
    case SPEED: return quantity_option("speed", text, "m/s", "5 cm/s", &o->puck.speed_m_s);
    case REACH: return quantity_option("reach", text, "m", "8 cm", &o->puck.reach_m);
    case TURN:
        o->puck.turn_rad_s = strtod(text, &end);
        if (end != text && !*end && o->puck.turn_rad_s >= 0.0 && o->puck.turn_rad_s <= 10.0) break;
        return bad("turn", text, "0 to 10 rad/s");
    case DEAD:
        o->puck.dead = (int)strtol(text, &end, 10);
        if (end != text && !*end && o->puck.dead >= 1 && o->puck.dead < KN_PUCK_FULL) break;
        return bad("dead", text, "1 to 349 counts");
    case URL: return kn_haply_url(text, o->host, &o->port) ? 0 : bad("url", text, "ws://HOST:PORT");
    case DEVICE: o->device_id = text; return kn_haply_id_known(text) ? 0 : bad("device", text, "an id like 049D");
    case PRESET:
        o->preset = text;
        return kn_haply_id_known(text) ? 0 : bad("preset", text, "a name like " KN_HAPLY_PRESET);
    }
    return KN_EXIT_OK;
}

// Store an option that applies to all devices.
static int take(kn_hand_options *o, int option, const char *text)
{
    char why[128];
    kn_device_def any;
    switch (option) {
    case PROBE: o->probe = text; break;
    case ORIGIN: o->origin = text; return origin(text, o->origin_m);
    case BASIS:
        o->basis = text;
        // Check the text of the basis now, with a temporary device. The scene's device, to which the basis applies, is
        // not known yet.
        kn_mount_init(&any);
        if (kn_mount_basis(&any, text, why, sizeof why)) break;
        return kn_complain("hand", KN_EXIT_USAGE, "--basis %s: %s", text, why);
    case SCALE: return number("scale", text, &o->scale);
    case LIMIT: return quantity_option("force-limit", text, "N", "3.3 N", &o->force_limit_n);
    case SECONDS: return number("seconds", text, &o->seconds);
    case LCM_URL: o->lcm_url = text; break;
    case MESH_URL: o->mesh_url = text; break;
    case QUIET: o->quiet = true; break;
    case LOCAL: o->local = true; break;
    case UNWATCHED: o->unwatched = true; break;
    default: return take_of_device(o, option, text);
    }
    return KN_EXIT_OK;
}

int kn_hand_options_parse(kn_hand_options *o, int argc, char **argv, bool *done)
{
    static const struct option list[] = {{"tty", 1, 0, TTY},           {"baud", 1, 0, BAUD},
                                         {"speed", 1, 0, SPEED},       {"turn", 1, 0, TURN},
                                         {"dead", 1, 0, DEAD},         {"reach", 1, 0, REACH},
                                         {"url", 1, 0, URL},           {"device", 1, 0, DEVICE},
                                         {"preset", 1, 0, PRESET},     {"probe", 1, 0, PROBE},
                                         {"origin", 1, 0, ORIGIN},     {"basis", 1, 0, BASIS},
                                         {"scale", 1, 0, SCALE},       {"force-limit", 1, 0, LIMIT},
                                         {"seconds", 1, 0, SECONDS},   {"lcm-url", 1, 0, LCM_URL},
                                         {"mesh-url", 1, 0, MESH_URL}, {"quiet", 0, 0, QUIET},
                                         {"local", 0, 0, LOCAL},       {"no-watchdog", 0, 0, UNWATCHED},
                                         {"help", 0, 0, HELP},         {0, 0, 0, 0}};
    // Set the defaults. Fields that stay 0 get their value from the scene or from the driver.
    *o = (kn_hand_options){.baud = KN_PADDLE_BAUD, .puck.turn_rad_s = 1.0, .device_id = "", .preset = KN_HAPLY_PRESET};
    kn_haply_url(KN_HAPLY_URL, o->host, &o->port);
    optind = 1;
    int code = KN_EXIT_OK;
    for (int c; code == KN_EXIT_OK && (c = getopt_long(argc, argv, ":", list, NULL)) != -1;) {
        if (c == HELP) {
            *done = true;
            fputs(help, stdout);
            return KN_EXIT_OK;
        }
        // getopt returns '?' for an unknown option and ':' for a missing value.
        if (c != '?' && c != ':') code = take(o, c, optarg);
        else
            code = kn_complain("hand", KN_EXIT_USAGE, "%s: %s", argv[optind - 1],
                               c == ':' ? "expected a value" : "unknown option; knead hand --help lists them");
    }
    if (code == KN_EXIT_OK) code = device(o, argc - optind, argv + optind);
    return code == KN_EXIT_OK ? check(o) : code;
}
