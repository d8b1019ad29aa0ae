// kneadd serves one object to haptic devices. This file parses the command line; daemon.h does the rest.
#include "core/scene/keys.h"
#include "core/scene/scene.h"
#include "server/control.h"
#include "server/backend/fpga.h"
#include "server/daemon.h"
#include "server/console.h"
#include "server/option_table.h"
#include "server/scene_name.h"
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char usage[] =
    "usage: kneadd [SCENE] [OPTION]...\n\n"
    "Serve one object to haptic devices and virtual hands. kneadd receives their poses over LCM, steps the object\n"
    "once a millisecond (a tick), and sends back the forces. After SIGINT, SIGTERM or SIGHUP the forces fade to zero,\n"
    "and kneadd ends.\n\n"
    "  SCENE             the object and its tools: a file, or a scene of Knead by its name, such as clay or liver\n"
    "                    (default: dough); knead check SCENE describes it\n"
    "  --set KEY=VALUE   set a key of the scene; knead check --keys lists the keys\n"
    "  --quality NAME    quality point of the scene: fast, balanced, accurate or own (its solver settings)\n"
    "  --local-model     publish a simple law of the force near every tool, 1 kHz: a client behind a slow link\n"
    "                    computes forces by it between two messages\n"
    "  --touch           publish where and how strongly every tool touches, 250 Hz, for fingertip displays\n\n"
    "control and state:\n"
    "  --control PATH    open a control socket at PATH, for knead ctl\n"
    "  --state-dir DIR   save the object in DIR, at most every 0.5 s, and start with the newest saved one.\n"
    "                    An emergency stop then also outlasts a restart (default: neither save nor restore)\n"
    "  --trace FILE      write a CSV row per tick and tool: when the pose arrived, the tick began, the object was\n"
    "                    stepped and the force was ready\n\n"
    "machine:\n"
    "  --realtime auto|require|off\n"
    "                    auto: use the real-time priority and the locked memory that the machine grants, and report\n"
    "                    what it refuses. require: exit 3 if it refuses any. off: request neither (default: auto)\n"
    "  --phase lock|free\n"
    "                    lock: a tick begins when a pose of the first tool in use comes; the pose waits tens of us.\n"
    "                    free: ticks do not follow the poses (default: lock)\n"
    "  --threads 1|2     threads that step the object, each on a processor of its own. The results are the same.\n"
    "                    knead check shows what the second one brings (default: the scene's, else 1)\n"
    "  --backend cpu|fixed|DEVICE\n"
    "                    cpu: the processor, with the scene's solver. fixed: the processor, with the integer\n"
    "                    arithmetic of Knead's FPGA circuit. DEVICE, such a circuit: uart:/dev/ttyUSB0?baud=3000000,\n"
    "                    pty:PATH, shm:NAME or pcie:0000:01:00.0 (knead doctor --card checks it). The processor\n"
    "                    computes every tick too, and continues alone if the circuit is lost. pcie: and shm: take\n"
    "                    ?shadow=off, and the circuit computes alone. If it is lost, the force fades and the object\n"
    "                    stands still until it is back; with &lost=go-on the processor computes it meanwhile.\n"
    "                    ?shadow=checked: as off, but the processor checks one tick in 50 (default: cpu)\n\n"
    "network:\n"
    "  --lcm-url URL     bus of poses, forces, status (default: LCM_DEFAULT_URL, else " KN_LCM_URL ")\n"
    "  --mesh-url URL    bus of meshes (default: " KN_MESH_URL ")\n"
    "  --lan IFACE       serve the network of this interface, not only this machine; needs --key or --peer. The\n"
    "                    default URLs then have ttl=1\n"
    "  --key FILE        accept only poses signed with this key (64 hexadecimal digits, mode 0600); sign all messages\n"
    "  --peer ADDRESS    accept poses from this address only; may be given up to 16 times. This is no\n"
    "                    authentication, because an address can be forged\n\n"
    "Examples:\n"
    "    kneadd clay\n"
    "    kneadd dough --set material.k1='300 gf/cm^3' --quality fast\n"
    "    mkdir state\n"
    "    kneadd dough-small --touch --control control --state-dir state\n\n"
    "Exit codes: 0 stopped, 2 bad input, 3 the machine refuses something that kneadd needs, another\n"
    "kneadd serves the bus, or output was lost.\n";

typedef struct options {
    kn_daemon_def def;
    const char **sets; // settings of the scene, in the order of the options that made them
} options;

static int bad(const char *what, const char *expected)
{
    fprintf(stderr, "kneadd: %s: expected %s\n", what, expected);
    return 2;
}

static const char *take_backend(void *to, const char *text)
{
    options *o = to;
    char why[KN_LINK_WHY];
    const bool device = strchr(text, ':');
    if (device && !kn_link_is_uri(text, why)) return fprintf(stderr, "kneadd: --backend %s\n", why), KN_OPTION_TOLD;
    if (device) o->def.object.device = text;
    else if (kn_choice_of("cpu|fixed", text) < 0) return "cpu, fixed, uart:, pty:, pcie: or shm:";
    // The circuit and --backend fixed compute with the same integers, so both need the settings in kn_fixed_set.
    for (int i = 0; i < KN_FIXED_SETS && strcmp(text, "cpu") != 0; i++)
        o->sets[o->def.object.set_count++] = kn_fixed_set[i];
    return NULL;
}

static const char *threads_set(const char *text)
{
    return !strcmp(text, "1") ? "solver.threads=1" : !strcmp(text, "2") ? "solver.threads=2" : NULL;
}

static const char *take_peer(void *to, const char *address)
{
    kn_daemon_def *def = to;
    const bool good = def->peers < KN_PEERS_MAX && inet_pton(AF_INET, address, &def->peer[def->peers++]) == 1;
    return good ? NULL : "an IPv4 address, 16 of them at most";
}

static const char *take_control(void *path, const char *text)
{
    *(const char **)path = text;
    return *text && strlen(text) <= KN_CONTROL_PATH ? NULL : "a path of 1 to 107 bytes";
}

// Parse the options and run the daemon. `sets` has room for 2 * argc entries, because one option may add two settings.
static int run(int argc, char **argv, const char **sets)
{
#define AT(member) .offset = offsetof(options, member)
    static const kn_option rows[] = {
        KN_OPTION("scene", RENAMED, .expected = "kneadd SCENE"),
        KN_OPTION("set", LIST, AT(sets), .count = offsetof(options, def.object.set_count)),
        KN_OPTION("lcm-url", TEXT, AT(def.lcm_url)),
        KN_OPTION("mesh-url", TEXT, AT(def.mesh_url)),
        KN_OPTION("realtime", CHOICE, AT(def.realtime), .unit = "auto|require|off"),
        KN_OPTION("backend", SPECIAL, .take = take_backend),
        KN_OPTION("control", SPECIAL, AT(def.control), .take = take_control),
        KN_OPTION("quality", LIST, AT(sets), .count = offsetof(options, def.object.set_count), .map = kn_quality_set,
                  .expected = kn_quality_names),
        KN_OPTION("threads", LIST, AT(sets), .count = offsetof(options, def.object.set_count), .map = threads_set,
                  .expected = "1 or 2"),
        KN_OPTION("phase", EITHER, AT(def.free), .unit = "lock|free"),
        KN_OPTION("trace", TEXT, AT(def.trace)),
        KN_OPTION("state-dir", TEXT, AT(def.object.state_dir)),
        KN_OPTION("key", TEXT, AT(def.key)),
        KN_OPTION("lan", TEXT, AT(def.lan)),
        KN_OPTION("peer", SPECIAL, AT(def), .take = take_peer),
        KN_OPTION("local-model", FLAG, AT(def.object.local_model)),
        KN_OPTION("touch", FLAG, AT(def.touch)),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .program = "kneadd", .help = usage,
                                          .version = "kneadd " KN_VERSION};
    options o = {.def = {.realtime = KN_RT_AUTO, .object.sets = sets}, .sets = sets};
    kn_daemon_def *def = &o.def;
    char why[KN_LINK_WHY];
    const int code = kn_options_read(&table, &o, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    // Check combinations of options before anything is opened.
    const bool given = optind < argc;
    const char *name = given ? argv[optind++] : "dough", *expected = kn_scene_take(&def->object.scene_path, name);
    if (optind < argc) return bad(argv[optind], "options after the one SCENE");
    if (expected) return bad(name, expected);
    if (def->lan && !def->key && def->peers == 0)
        return bad("--lan", "--key FILE or --peer ADDRESS as well: on a network anybody could move the tool");
    if (def->peers > 0 && !def->lan) return bad("--peer", "--lan IFACE as well");
    if (!kn_rt_files(why, sizeof why)) return fprintf(stderr, "kneadd: %s\n", why), 3;
    if (!given) puts("kneadd: dough is served, because no SCENE is given");
    fflush(stdout);
    return kn_daemon_run(def);
}

int main(int argc, char **argv)
{
    const char **sets = calloc(2 * (size_t)argc, sizeof *sets);
    int code = sets ? run(argc, argv, sets) : 70;
    free(sets);
    return kn_console_end("kneadd", code);
}
