// knead stability: solves some thousands of small scenes with extreme parameters and compares each result with that of
// a converged reference solver (stability_trial.h).
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "clients/sweep/stability_trial.h"
#include "server/option_table.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char help[] =
    "usage: knead stability [OPTION]...\n\n"
    "Press, knock, load and release small objects with extreme parameters, and compare each result with a converged\n"
    "answer for the same scene, path and time step. The answer is computed in f64 and relinearised until the law is\n"
    "met to 1e-7. The default solver must be right, or refuse the scene with a reason. The results of secant,\n"
    "tangent, f64 and rk4 are printed beside it. The error of the time step, against the answer at half the step, is\n"
    "not the solver's fault and has a column of its own.\n\n"
    "verdicts:\n"
    "  right        the forces of all steps and the shape are within 5 % of the answer; a hand notices 7 %. If the\n"
    "               error of the time step is above 5 %, it is the limit, but 7 % at most. `most`: largest error of\n"
    "               a family\n"
    "  refused      the scene is not simulated, and a sentence gives the reason\n"
    "  chattering   the force goes up and down more than 1.5 times as much as in the answer\n"
    "  wrong        no chattering, but an error above the limit\n"
    "  diverged     a number is not finite, or a force is a hundred times too large\n"
    "  died         the process of the trial was killed; the other processes continue\n\n"
    "options:\n"
    "  --quick           fewer scenes in every family, under a minute\n"
    "  --family NAME     only one family of scenes:\n";

static const char help_end[] =
    "  --csv FILE        write one row per scene and solver: verdict, errors, reason\n"
    "  --json            print the counts of every family and solver as JSON\n"
    "  --png FILE        draw the verdicts on the default solver as maps (needs gnuplot)\n"
    "  --jobs N          N runs at a time, 256 at most; 0: one per processor (default: 0)\n\n"
    "Examples:\n"
    "    knead stability --quick --family bar --csv bar.csv\n"
    "    knead stability --quick --family k1 --png k1.png\n\n"
    "Exit codes: 0 ok, 1 a scene was neither solved right nor refused, 2 bad input, 3 a file cannot be written.\n";

typedef struct options {
    bool quick;
    int jobs;
    const char *family, *csv, *png;
} options;

// The help contains a list of the families of trials, so it is printed in three parts.
static void print_help(void)
{
    fputs(help, stdout);
    for (int f = 0; kn_stability_families[f]; f++)
        printf("      %-10s    %s\n", kn_stability_families[f], kn_stability_family_about(f));
    fputs(help_end, stdout);
}

// Accept the name of a family of trials.
static const char *take_family(void *family, const char *name)
{
    char known[200] = "";
    for (int f = 0; kn_stability_families[f]; f++) {
        if (!strcmp(kn_stability_families[f], name)) return *(const char **)family = name, NULL;
        snprintf(known + strlen(known), sizeof known - strlen(known), "%s%s", f ? ", " : "", kn_stability_families[f]);
    }
    kn_complain("stability", KN_EXIT_USAGE, "--family %s: expected one of %s", name, known);
    return KN_OPTION_TOLD;
}

int kn_stability_main(int argc, char **argv)
{
#define AT(member) .offset = offsetof(options, member)
    static const kn_option rows[] = {
        KN_OPTION("quick", FLAG, AT(quick)),
        KN_OPTION("json", CALL, .call = kn_result_open),
        KN_OPTION("family", SPECIAL, AT(family), .take = take_family),
        KN_OPTION("csv", TEXT, AT(csv)),
        KN_OPTION("png", TEXT, AT(png)),
        KN_OPTION("plot", RENAMED, .expected = "--png FILE"),
        KN_OPTION("jobs", INTEGER, AT(jobs), .expected = "a whole number, 0: one per processor", KN_RANGE(0, 256)),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .print_help = print_help};
    options opt = {0};
    int code = kn_options_read(&table, &opt, argc, argv);
    if (code != KN_OPTIONS_READ) return code;
    if (optind < argc)
        return kn_complain("stability", KN_EXIT_USAGE, "%s: expected options only; --help lists them", argv[optind]);
    code = KN_EXIT_OK;
    // Check that the outputs can be written before the long computation starts.
    if (opt.csv) code = kn_output_try("stability", opt.csv);
    if (code == KN_EXIT_OK && opt.png) code = kn_plot_try("stability", opt.png);
    if (code != KN_EXIT_OK) return code;
    kn_stability_atlas atlas;
    code = kn_stability_atlas_survey(&atlas, opt.quick, opt.family,
                                     opt.jobs ? opt.jobs : (int)fmin(256, (double)sysconf(_SC_NPROCESSORS_ONLN)));
    if (code != KN_EXIT_OK) return code;
    bool sound = kn_stability_atlas_print(&atlas);
    if (opt.csv) code = kn_stability_atlas_write(&atlas, opt.csv);
    if (code == KN_EXIT_OK && opt.png) code = kn_stability_atlas_draw(&atlas, opt.png);
    // Print the elapsed time to stderr, so that the text on stdout is the same in every run.
    if (code == KN_EXIT_OK) fprintf(stderr, "%d scenes took %.0f s\n", atlas.first[atlas.maps], atlas.seconds);
    kn_stability_atlas_free(&atlas);
    return code == KN_EXIT_OK && !sound ? KN_EXIT_FAILED : code;
}
