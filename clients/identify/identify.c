// The `knead identify` command: find the parameters of a virtual lump from measurements on a real one. The command runs
// one experiment of experiments.h.
#include "clients/identify/experiments.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include <stdio.h>
#include <string.h>

typedef struct experiment {
    const char *name, *summary;
    int (*main)(int argc, char **argv);
} experiment;

static const experiment experiments[] = {
#define KN_EXPERIMENT(name, summary) {#name, summary, kn_identify_##name##_main},
    KN_EXPERIMENTS(KN_EXPERIMENT)
#undef KN_EXPERIMENT
        {NULL, NULL, NULL}};

static void print_help(void)
{
    printf("usage: knead identify COMMAND [OPTION]... FILE...\n\n"
           "Fit the parameters of a virtual object to measurements of a real specimen, each parameter with its "
           "uncertainty.\n\n");
    for (const experiment *e = experiments; e->name; e++) printf("  %-6s %s\n", e->name, e->summary);
    printf("\n`knead identify COMMAND --help` lists the options.\n");
}

int kn_identify_main(int argc, char **argv)
{
    if (argc > 1 && (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h"))) {
        print_help();
        return KN_EXIT_OK;
    }
    for (const experiment *e = experiments; argc > 1 && e->name; e++) {
        if (strcmp(argv[1], e->name) != 0) continue;
        char full[40]; // argv[0] of the experiment; getopt prints this name in front of its messages
        snprintf(full, sizeof full, "knead identify %s", e->name);
        argv[1] = full;
        return e->main(argc - 1, argv + 1);
    }
    return kn_complain("identify", KN_EXIT_USAGE, "expected creep, relax, sweep or shape; --help tells the rest");
}
