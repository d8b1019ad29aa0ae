#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "clients/sweep/sweep_plan.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: knead tradeoff SCENE LOG [OPTION]...\n\n"
    "Replay a whole log of this scene (from knead probe --record) with many combinations of solver settings. Each\n"
    "combination is a point. It runs in the daemon's own servo and is compared with references in f64. The output is\n"
    "a table of all points, and the three named points fast, balanced and accurate.\n\n"
    "  --quick            fewer points, no finer lattice, and no reference for the error of the time step\n"
    "  --budget TIME      pick the most accurate point whose p90 is at most TIME, e.g. '300 us'; exit 1 if there is\n"
    "                     none\n"
    "  --write            replace `quality` of the scene by the three points; all other bytes of the file stay\n"
    "  --csv FILE         write every point and every number; an empty cell was not measured\n"
    "  --json             print every point, and the named ones, as JSON\n"
    "  --png FILE         draw the time of a tick against the error (needs gnuplot)\n"
    "  --set KEY=VALUE    set a key of the scene, in every point\n\n"
    "points to play instead of the usual ones, as comma-separated lists. Every combination of the values is a point.\n"
    "Without a list the scene's own value is used. A block has a lattice for each spacing; a mesh has only one:\n"
    "  --solver LIST      blend, secant, tangent, rk4 (if the scene allows rk4; otherwise a line gives the reason)\n"
    "  --precision LIST   f32, f64\n"
    "  --iterations LIST  CG iterations in every step (default: 4,8,16)\n"
    "  --tolerance LIST   residual above which CG makes more iterations than --iterations; 0: never (default: 0).\n"
    "                     CG makes up to three times --iterations, or up to 24 if 24 is larger\n"
    "  --passes LIST      linearisations per step\n"
    "  --dt LIST          time steps, e.g. '1 ms,0.5 ms'\n"
    "  --spacing LIST     lattice spacings, e.g. '10 mm,5 mm'\n\n"
    "distribution of the runs:\n"
    "  --resume DIR       keep every finished run in DIR, so that the same command continues after an interruption.\n"
    "                     Runs of another program, scene or log are kept, too, but not used\n" KN_JOBS_HELP
    "Meshes of the scene are sent to the hosts, too. Times of runs beside each other cannot be compared, so the "
    "points\n"
    "are then timed one by one, on this machine. --slurm needs --resume.\n\n"
    "Errors are relative L2 norms, of the contact force over the log and of the displacements at its end.\n"
    "clients/README.md explains the columns of the table and the conditions for the named points.\n\n"
    "Examples:\n"
    "    knead tradeoff dough-small press.lcmlog --quick --png tradeoff.png\n"
    "    knead tradeoff dough-small press.lcmlog --solver blend --iterations 4,8 --budget '100 ms'\n\n"
    "Exit codes: 0 ok, 1 no point within the budget, 2 bad input, 3 a file, gnuplot, an engine or a host failed.\n";

static const char *take_step(void *dt_s, const char *text)
{
    if (kn_quantity_read(text, "s", false, KN_ABOVE_0, DBL_MAX, dt_s) && kn_backend_steps(*(double *)dt_s) > 0)
        return NULL;
    return "at most 32 times like '0.5 ms', 1 ms divided by a whole number, separated by commas";
}

#define AT(member) .offset = offsetof(kn_tradeoff_options, member)
#define AXIS(member, number, most) AT(axes.member), .count = offsetof(kn_tradeoff_options, axes.number), .items = most
static const kn_option rows[] = {
    KN_OPTION("json", CALL, .call = kn_result_open),
    KN_OPTION("quick", FLAG, AT(quick)),
    KN_OPTION("budget", QUANTITY, AT(budget_us), .unit = "us", .expected = "a time like '300 us'"),
    KN_OPTION("budget-us", RENAMED, .expected = "--budget TIME, such as '300 us'"),
    KN_OPTION("write", FLAG, AT(write)),
    KN_OPTION("csv", TEXT, AT(csv)),
    KN_OPTION("png", TEXT, AT(png)),
    KN_OPTION("plot", RENAMED, .expected = "--png FILE"),
    KN_OPTION("set", LIST, AT(sets), .count = offsetof(kn_tradeoff_options, set_count), .most = KN_TRADEOFF_SETS,
              .expected = "at most 64 of them"),
    KN_OPTION("solver", CHOICE, AXIS(method, methods, 4), .unit = "blend|secant|tangent|rk4",
              .expected = "any of blend, secant, tangent and rk4, separated by commas"),
    KN_OPTION("precision", CHOICE, AXIS(precision, precisions, 2), .unit = "f32|f64",
              .expected = "f32, f64 or f32,f64"),
    KN_OPTION("iterations", INTEGER, AXIS(count, counts, KN_AXIS_MAX), KN_RANGE(1, 1000),
              .expected = "at most 32 whole numbers from 1 to 1000, separated by commas"),
    KN_OPTION("tolerance", QUANTITY, AXIS(tolerance, tolerances, KN_AXIS_MAX), .unit = "1", KN_RANGE(0, KN_BELOW_1),
              .expected = "at most 32 numbers from 0 to 1, separated by commas"),
    KN_OPTION("passes", INTEGER, AXIS(pass, passes, KN_AXIS_MAX), KN_RANGE(1, 20),
              .expected = "at most 32 whole numbers from 1 to 20, separated by commas"),
    KN_OPTION("dt", SPECIAL, AXIS(dt_s, steps, KN_AXIS_MAX), .take = take_step,
              .expected = "at most 32 times like '0.5 ms', 1 ms divided by a whole number, separated by commas"),
    KN_OPTION("spacing", QUANTITY, AXIS(spacing_m, spacings, KN_AXIS_MAX), .unit = "m",
              .expected = "at most 32 lengths like '5 mm', separated by commas"),
    KN_OPTION("resume", TEXT, AT(resume)),
    KN_JOBS_OPTIONS(kn_tradeoff_options),
};

int kn_tradeoff_options_parse(kn_tradeoff_options *opt, int argc, char **argv)
{
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    *opt = (kn_tradeoff_options){0};
    // An engine runs this program for a single run, with --job PATH in front.
    if (argc > 2 && !strcmp(argv[1], "--job")) {
        opt->job = argv[2];
        argv[2] = argv[0];
        argv += 2, argc -= 2;
    }
    const int code = kn_options_read(&table, opt, argc, argv);
    const kn_axes_def *a = &opt->axes;
    opt->listed = a->methods + a->precisions + a->counts + a->tolerances + a->passes + a->steps + a->spacings > 0;
    if (code != KN_OPTIONS_READ) return code;
    if (argc - optind != 2)
        return kn_complain("tradeoff", KN_EXIT_USAGE, "expected SCENE LOG; see knead tradeoff --help");
    if (kn_command_scene("tradeoff", &opt->scene, argv[optind]) != KN_EXIT_OK) return KN_EXIT_USAGE;
    opt->log = argv[optind + 1];
    if (opt->engine.slurm && !opt->resume)
        return kn_complain("tradeoff", KN_EXIT_USAGE, "--slurm: expected --resume DIR, a folder that all nodes share");
    if (opt->write && opt->set_count > 0)
        return kn_complain("tradeoff", KN_EXIT_USAGE,
                           "--write: the points would be valid only with --set %s, expected "
                           "no --set",
                           opt->sets[0]);
    return code;
}
