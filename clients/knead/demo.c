// knead demo: the first minute. Serves a block of dough, presses it once with a virtual hand, and opens a page on which
// the mouse presses it. A bash script does this with kneadd, knead probe, knead web and knead view.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// Text of the script. It is a file of the source tree that the build embeds in the program.
extern const char demo_bash[];
__asm__(".section .rodata\ndemo_bash: .incbin \"" KN_CLIENTS_DIR "/knead/demo.bash\"\n.byte 0\n.previous\n");

static const char help[] =
    "usage: knead demo [SCENE] [OPTION]...\n\n"
    "Serve an object, press it once with a virtual hand, and serve a page on which the mouse presses it.\n"
    "Messages stay on this machine: LCM's multicast group is routed to the loopback device as long as the demo runs.\n"
    "A user who may not add this route gets a network namespace instead.\n\n"
    "  SCENE              scene to serve (default: dough)\n"
    "  --once             serve no page, and end after the press\n"
    "  --out DIR          folder for press.lcmlog, press.csv, press.png and dent.png (default: knead-demo)\n"
    "  --set KEY=VALUE    set a key of the scene; knead check --keys lists them\n"
    "  --quality NAME     quality point of the scene: fast, balanced, accurate or own\n\n"
    "Examples:\n"
    "    knead demo --once\n"
    "    knead demo jelly --out jelly-demo --once\n\n"
    "Exit codes: 0 done, 2 bad input, 3 the machine refuses, or (--once) three presses were disturbed.\n";

#define SETS 64

typedef struct options {
    const char *set[SETS], *quality, *out;
    int sets;
    bool once;
} options;

int kn_demo_main(int argc, char **argv)
{
#define AT(member) .offset = offsetof(options, member)
    static const kn_option rows[] = {
        KN_OPTION("once", FLAG, AT(once)),
        KN_OPTION("out", TEXT, AT(out), .expected = "a folder"),
        KN_OPTION("set", LIST, AT(set), .expected = "KEY=VALUE", .most = SETS, .count = offsetof(options, sets)),
        KN_OPTION("quality", TEXT, AT(quality), .expected = "fast, balanced, accurate or own"),
    };
#undef AT
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    options opt = {.out = "knead-demo"};
    int code = kn_options_read(&table, &opt, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (argc - optind > 1) return kn_complain("demo", KN_EXIT_USAGE, "%s: expected one scene", argv[optind + 1]);
    const char *scene = argc > optind ? argv[optind] : "dough", *path;
    if (kn_command_scene("demo", &path, scene) != KN_EXIT_OK) return KN_EXIT_USAGE;
    char self[PATH_MAX];
    ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    if (length < 0) return kn_complain("demo", KN_EXIT_DEVICE, "/proc/self/exe: %s", strerror(errno));
    self[length] = '\0';
    const char *to[2 * SETS + 16] = {"bash", "-c", demo_bash, self, scene, opt.out, opt.once ? "1" : "0"};
    int n = 7;
    for (int i = 0; i < opt.sets; i++) to[n++] = "--set", to[n++] = opt.set[i];
    if (opt.quality) to[n++] = "--quality", to[n++] = opt.quality;
    execvp("bash", (char **)to);
    return kn_complain("demo", KN_EXIT_DEVICE, "bash: %s", strerror(errno));
}
