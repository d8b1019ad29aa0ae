// knead stability: solves some thousands of small scenes with extreme parameters and compares each result with that of
// a converged reference solver (stability_trial.h).
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "clients/sweep/stability_trial.h"
#include "server/option_table.h"
#include <stdio.h>

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
    "  died         the process of the trial was killed or not started; the other trials continue\n\n"
    "options:\n"
    "  --quick           fewer scenes in every family, under a minute\n"
    "  --family NAME     only one family of scenes:\n"
    "      k1            stiffness k1 of the spring, 1e-6 to 1e6 times dough's, at every time step\n"
    "      c1            damper c1 parallel to the spring, scaled like k1\n"
    "      c2            damper c2 in series, scaled like k1\n"
    "      mass          the density\n"
    "      pairs         two of k1, c1, c2 and mass scaled at once, 1 ms steps\n"
    "      limits        materials with a parameter of zero, a linear damper or stops\n"
    "      bar           a single edge or a single node\n"
    "      aspect        tetrahedra elongated or flattened\n"
    "      sliver        tetrahedra of almost no volume\n"
    "      squash        compression up to 95 %\n"
    "      gas           gas cells that start at zero volume or inside out\n"
    "      jump          a tool pose displaced by up to 10 cm for three steps\n"
    "      mixed         all parameters at random over ten decades\n"
    "      size          finer blocks, stiffer springs\n"
    "  --csv FILE        write one row per scene and solver: verdict, errors, reason\n"
    "  --json            print the counts of every family and solver as JSON\n"
    "  --png FILE        draw the verdicts on the default solver as maps (needs gnuplot)\n\n"
    "Examples:\n"
    "    knead stability --quick --family bar --csv bar.csv\n"
    "    knead stability --quick --family k1 --png k1.png\n\n"
    "Exit codes: 0 ok, 1 a scene was neither solved right nor refused, 2 bad input, 3 a file cannot be written.\n";

typedef struct options {
    bool quick;
    int family;
    const char *csv, *png;
} options;

int kn_stability_main(int argc, char **argv)
{
#define AT(member) .offset = offsetof(options, member)
    static const kn_option rows[] = {
        KN_OPTION("quick", FLAG, AT(quick)),
        KN_OPTION("json", CALL, .call = kn_result_open),
        KN_OPTION("family", CHOICE, AT(family),
                  .unit = "k1|c1|c2|mass|pairs|limits|bar|aspect|sliver|squash|gas|jump|mixed|size"),
        KN_OPTION("csv", TEXT, AT(csv)),
        KN_OPTION("png", TEXT, AT(png)),
        KN_OPTION("plot", RENAMED, .expected = "--png FILE"),
        KN_OPTION("jobs", RENAMED, .expected = "knead batch with one --family per line"),
    };
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    options opt = {.family = -1};
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
    code = kn_stability_atlas_survey(&atlas, opt.quick, opt.family);
    if (code != KN_EXIT_OK) return code;
    bool sound = kn_stability_atlas_print(&atlas);
    if (opt.csv) code = kn_stability_atlas_write(&atlas, opt.csv);
    if (code == KN_EXIT_OK && opt.png) code = kn_stability_atlas_draw(&atlas, opt.png);
    // Print the elapsed time to stderr, so that the text on stdout is the same in every run.
    if (code == KN_EXIT_OK) fprintf(stderr, "%d scenes took %.0f s\n", atlas.first[atlas.maps], atlas.seconds);
    kn_stability_atlas_free(&atlas);
    return code == KN_EXIT_OK && !sound ? KN_EXIT_FAILED : code;
}
