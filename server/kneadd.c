// kneadd serves one object to haptic devices. This file parses the command line; daemon.h does the rest.
#include "core/scene/scene.h"
#include "server/control.h"
#include "server/backend/fpga.h"
#include "server/daemon.h"
#include "server/console.h"
#include <arpa/inet.h>
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char usage[] =
    "usage: kneadd --scene FILE [--set KEY=VALUE]... [--lcm-url URL] [--mesh-url URL] [--realtime auto|require|off]\n"
    "              [--phase lock|free] [--quality NAME] [--backend cpu|fixed|DEVICE] [--local-model] [--touch]\n"
    "              [--control PATH] [--state-dir DIR] [--trace FILE] [--key FILE] [--lan IFACE] [--peer ADDRESS]...\n"
    "\n"
    "  --scene FILE      serve this scene, the object and its probes (YAML); knead check FILE shows its cost\n"
    "  --set KEY=VALUE   override a key of the scene, e.g. material.k1='300 gf/cm^3'; knead check --keys lists them\n"
    "  --quality NAME    use this quality point of the scene: fast, balanced or accurate; own: none of them\n"
    "  --lcm-url URL     bus of poses, forces, status (default: LCM_DEFAULT_URL, else " KN_LCM_URL ")\n"
    "  --mesh-url URL    bus of meshes (default: " KN_MESH_URL ")\n"
    "  --realtime MODE   auto: take what the machine grants, report what is missing; require: exit 3 if any of it is\n"
    "                    missing; off: ask for nothing (default: auto)\n"
    "  --phase MODE      lock: ticks follow the poses of the first engaged tool, and a pose waits only tens of us;\n"
    "                    free: ticks keep a grid of their own (default: lock)\n"
    "  --backend WHERE   step the lattice there. cpu: as the scene says; fixed: in the integers of hdl's circuit;\n"
    "                    uart:/dev/ttyUSB0?baud=3000000, pty:PATH, pcie:0000:01:00.0, shm:NAME: on that circuit, in\n"
    "                    step with its twin here, which continues with the same bits if the circuit is lost\n"
    "                    (default: cpu)\n"
    "  --local-model     publish the contact of every tool as KNEAD_CONTACT_<probe>, for clients behind a slow link\n"
    "  --touch           publish the touch of every tool as KNEAD_TOUCH_<probe>, for fingertip displays, at 250 Hz\n"
    "  --control PATH    open a socket there for knead ctl: status, reset, snapshot, undo, set, load, estop ...\n"
    "  --state-dir DIR   save the object there, at most every 0.5 s, and start with the last one that fits; an\n"
    "                    emergency stop then outlasts a restart, too (default: save and restore nothing)\n"
    "  --trace FILE      write a CSV row per tick: times of its pose's arrival, its wake, its step, its guarded force\n"
    "  --key FILE        accept only poses signed with this key (64 hexadecimal digits, mode 0600); sign forces, too\n"
    "  --lan IFACE       serve that network instead of this machine alone; needs --key or --peer, and URLs with ttl=1\n"
    "  --peer ADDRESS    accept only poses from there (up to 16 times); no authentication: an address can be forged\n"
    "  --help, --version\n"
    "\n"
    "SIGINT or SIGTERM: forces go to zero, then exit 0. Exit: 2 bad input, 3 the machine refuses.\n";

static int bad(const char *what, const char *expected)
{
    fprintf(stderr, "kneadd: %s: expected %s\n", what, expected);
    return 2;
}

// Parse the options and run the daemon. `sets` has room for 2 * argc entries, because one option may add two settings.
static int run(int argc, char **argv, const char **sets)
{
    static const struct option options[] = {{"scene", required_argument, NULL, 's'},
                                            {"set", required_argument, NULL, 'k'},
                                            {"lcm-url", required_argument, NULL, 'l'},
                                            {"mesh-url", required_argument, NULL, 'm'},
                                            {"realtime", required_argument, NULL, 'r'},
                                            {"backend", required_argument, NULL, 'b'},
                                            {"control", required_argument, NULL, 'c'},
                                            {"quality", required_argument, NULL, 'q'},
                                            {"phase", required_argument, NULL, 'p'},
                                            {"trace", required_argument, NULL, 't'},
                                            {"state-dir", required_argument, NULL, 'd'},
                                            {"key", required_argument, NULL, 'K'},
                                            {"lan", required_argument, NULL, 'L'},
                                            {"peer", required_argument, NULL, 'P'},
                                            {"local-model", no_argument, NULL, 'o'},
                                            {"touch", no_argument, NULL, 'T'},
                                            {"help", no_argument, NULL, 'h'},
                                            {"version", no_argument, NULL, 'v'},
                                            {0}};
    kn_daemon_def def = {.realtime = KN_RT_AUTO, .object.sets = sets};
    char why[KN_LINK_WHY];
    for (int option; (option = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        switch (option) {
        case 's': def.object.scene_path = optarg; break;
        case 'k': sets[def.object.set_count++] = optarg; break;
        case 'q':
            if (!(sets[def.object.set_count++] = kn_quality_set(optarg))) return bad(optarg, kn_quality_names);
            break;
        case 'l': def.lcm_url = optarg; break;
        case 'm': def.mesh_url = optarg; break;
        case 'r':
            if (!kn_rt_mode_parse(optarg, &def.realtime)) return bad(optarg, "--realtime auto, require or off");
            break;
        case 'p':
            def.free = strcmp(optarg, "free") == 0;
            if (!def.free && strcmp(optarg, "lock") != 0) return bad(optarg, "--phase lock or free");
            break;
        case 'b':
            if (kn_backend_is_device(optarg)) {
                if (!kn_link_is_uri(optarg, why)) return fprintf(stderr, "kneadd: --backend %s\n", why), 2;
                def.object.device = optarg;
            } else if (strcmp(optarg, "cpu") != 0 && strcmp(optarg, "fixed") != 0)
                return bad(optarg, "--backend cpu, fixed, uart:, pty:, pcie: or shm:");
            // The circuit and --backend fixed need the same settings of the scene: the integers of the circuit.
            for (int i = 0; i < KN_FIXED_SETS && strcmp(optarg, "cpu") != 0; i++)
                sets[def.object.set_count++] = kn_fixed_set[i];
            break;
        case 'K': def.key = optarg; break;
        case 'L': def.lan = optarg; break;
        case 'P':
            if (def.peers == KN_PEERS_MAX || inet_pton(AF_INET, optarg, &def.peer[def.peers++]) != 1)
                return bad(optarg, "--peer with an IPv4 address, 16 of them at most");
            break;
        case 't': def.trace = optarg; break;
        case 'd': def.object.state_dir = optarg; break;
        case 'o': def.object.local_model = true; break;
        case 'T': def.touch = true; break;
        case 'c':
            def.control = optarg;
            if (!*optarg || strlen(optarg) > KN_CONTROL_PATH) return bad(optarg, "--control PATH of 1 to 107 bytes");
            break;
        case 'h': fputs(usage, stdout); return 0;
        case 'v': puts("kneadd " KN_VERSION); return 0;
        default: return 2; // getopt has already reported the bad option
        }
    }
    // Check combinations of options before anything is opened.
    if (optind < argc) return bad(argv[optind], "options only, the scene as --scene FILE");
    if (def.lan && !def.key && def.peers == 0)
        return bad("--lan", "--key FILE or --peer ADDRESS beside it: on a network anybody may move the tool");
    if (def.peers > 0 && !def.lan) return bad("--peer", "--lan IFACE beside it");
    if (!def.object.scene_path) return bad("no scene", "--scene FILE");
    if (!kn_rt_files(why, sizeof why)) return fprintf(stderr, "kneadd: %s\n", why), 3;
    return kn_daemon_run(&def);
}

int main(int argc, char **argv)
{
    const char **sets = calloc(2 * (size_t)argc, sizeof *sets);
    int code = sets ? run(argc, argv, sets) : 70;
    free(sets);
    // Evaluate both: fflush alone does not report an earlier error.
    if (!(fflush(stdout) | ferror(stdout)) && kn_console_complete(STDOUT_FILENO)) return code;
    kn_console_err("kneadd: standard output could not be written completely");
    return code ? code : 3;
}
