// knead: all tools for the daemon kneadd in one command, with one file per subcommand. See commands.h.
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "server/rt.h"
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

typedef struct command {
    const char *name, *summary;
    int (*main)(int argc, char **argv);
} command;

static const command commands[] = {
#define KN_COMMAND(name, summary) {#name, summary, kn_##name##_main},
    KN_COMMANDS(KN_COMMAND)
#undef KN_COMMAND
        {NULL, NULL, NULL}};

static void print_help(FILE *out)
{
    fprintf(out, "knead: feel, record and replay deformable objects that flow. The daemon kneadd serves them.\n\n"
                 "usage: knead SUBCOMMAND [OPTION]...\n\n");
    for (const command *c = commands; c->name; c++) fprintf(out, "  %-10s %s\n", c->name, c->summary);
    fprintf(out,
            "\n`knead SUBCOMMAND --help` describes a subcommand; `knead --version` prints the version.\n"
            "Exit codes: 0 ok, 1 a requested check failed, 2 bad input, 3 device or transport, 70 internal error.\n");
}

static int run(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "";
    if (!strcmp(name, "--help") || !strcmp(name, "-h")) {
        print_help(stdout);
        return KN_EXIT_OK;
    }
    bool known = false;
    // Find the subcommand. `knead NAME --version` is answered here.
    for (const command *c = commands; c->name; c++) {
        if (strcmp(name, c->name)) continue;
        if (argc != 3 || strcmp(argv[2], "--version")) {
            char why[200], full[32]; // full: "knead NAME", the argv[0] with which getopt begins its messages
            snprintf(full, sizeof full, "knead %s", c->name);
            argv[1] = full;
            // Check first that enough files can be opened, because otherwise liblcm and libev hang or abort.
            if (!kn_rt_files(why, sizeof why)) return fprintf(stderr, "%s: %s\n", full, why), KN_EXIT_DEVICE;
            return c->main(argc - 1, argv + 1);
        }
        known = true;
    }
    if (known || !strcmp(name, "--version")) {
        printf("knead %s\n", KN_VERSION);
        return KN_EXIT_OK;
    }
    if (!*name) print_help(stderr);
    else fprintf(stderr, "knead: no subcommand `%s`; knead --help lists them\n", name);
    return KN_EXIT_USAGE;
}

int main(int argc, char **argv)
{
    int code = run(argc, argv);
    kn_result_close(code);
    // Check the result of fflush and the error flag of stdout, because fflush does not report an error of an earlier
    // write.
    if (!(fflush(stdout) | ferror(stdout))) return code;
    fputs("knead: standard output could not be written completely\n", stderr);
    return code == KN_EXIT_OK ? KN_EXIT_DEVICE : code;
}
