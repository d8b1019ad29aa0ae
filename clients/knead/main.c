// knead: all tools for the daemon kneadd in one command, with one file per subcommand. See commands.h.
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "core/scene/keys.h"
#include "server/console.h"
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
    fprintf(out, "usage: knead COMMAND [OPTION]...\n\n"
                 "Feel, record and replay deformable objects that flow. The daemon kneadd serves them. `knead help\n"
                 "COMMAND` describes a command; `knead --version` prints the version.\n\n");
    for (const command *c = commands; c->name; c++) fprintf(out, "  %-11s %s\n", c->name, c->summary);
    fprintf(out,
            "\n`The first paper` is Tomokuni, Sugiyama, Hirai: construction of virtual rheological objects.\n\n"
            "Examples:\n    knead check dough\n    knead creep dough\n    knead help probe\n\n"
            "Exit codes: 0 ok, 1 a check failed or a result cannot be used, 2 bad input, 3 device, transport or file,\n"
            "70 internal error.\n");
}

// Return the subcommand with this name. If there is none, return NULL and print the reason.
static const command *find(const char *name)
{
    const char *nearest = NULL;
    int edits = 0;
    for (const command *c = commands; c->name; c++) {
        if (!strcmp(name, c->name)) return c;
        if (kn_word_nearer(name, c->name, &edits)) nearest = c->name;
    }
    fprintf(stderr, "knead: no command `%s`; %s%s%s\n", name, nearest ? "did you mean " : "knead --help lists them",
            nearest ? nearest : "", nearest ? "?" : "");
    return NULL;
}

int kn_command_run(int argc, char **argv)
{
    char why[200], full[32]; // full: "knead NAME", the argv[0] with which messages begin
    const char *name = argc > 1 ? argv[1] : "", *second = argc > 2 ? argv[2] : NULL;
    if (!*name) return print_help(stderr), KN_EXIT_USAGE;
    const bool help = !strcmp(name, "help");
    if (!strcmp(name, "--help") || !strcmp(name, "-h") || (help && (!second || *second == '-')))
        return print_help(stdout), KN_EXIT_OK;
    if (help && !strncmp(second, "kneadd", 6))
        return fprintf(stderr, "knead: %s is a program of its own; see %s --help\n", second, second), KN_EXIT_USAGE;
    // `knead help NAME` is `knead NAME --help`. Further words name a part: `knead help identify creep`.
    if (help) {
        memmove(argv + 1, argv + 2, (size_t)(argc - 2) * sizeof *argv);
        argv[argc - 1] = "--help";
        name = second;
    }
    const command *c = strcmp(name, "--version") ? find(name) : NULL;
    if (!c && strcmp(name, "--version")) return KN_EXIT_USAGE;
    if (!c || (argc == 3 && !strcmp(argv[2], "--version"))) return printf("knead %s\n", KN_VERSION), KN_EXIT_OK;
    snprintf(full, sizeof full, "knead %s", c->name);
    argv[1] = full;
    // Check first that enough files can be opened, because otherwise liblcm and libev hang or abort.
    if (!kn_rt_files(why, sizeof why)) return fprintf(stderr, "%s: %s\n", full, why), KN_EXIT_DEVICE;
    return c->main(argc - 1, argv + 1);
}

int main(int argc, char **argv)
{
    int code = kn_command_run(argc, argv);
    kn_result_close(code);
    return kn_console_end("knead", code);
}
