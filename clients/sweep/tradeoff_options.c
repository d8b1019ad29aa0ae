#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/result.h"
#include "clients/sweep/sweep_plan.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: knead tradeoff SCENE LOG [OPTION]...\n\n"
    "Replays a whole log of this scene (from knead probe --record) with many combinations of solver settings.\n"
    "Each combination is a point. It runs in the daemon's own servo and is compared with references in f64.\n"
    "The output is a table of all points, and the three named points fast, balanced and accurate.\n\n"
    "    knead tradeoff dough.yaml press.lcmlog --plot tradeoff.png    some minutes (under one with --quick)\n"
    "    knead tradeoff dough.yaml press.lcmlog --budget-us 300        the most accurate point within 300 us\n"
    "    knead tradeoff dough.yaml press.lcmlog --write                fast, balanced, accurate for --quality\n\n"
    "  --quick            fewer points, no finer lattice, and no reference for the error of the time step\n"
    "  --budget-us N      pick the most accurate point whose p90 is at most N us; exit 1 if there is none\n"
    "  --write            replace `quality` of the scene by the three points; all other bytes of the file stay\n"
    "  --csv FILE         write every point and every number; an empty cell was not measured\n"
    "  --json             print every point, and the named ones, as JSON\n"
    "  --plot FILE.png    draw the time of a tick against the error (needs gnuplot)\n"
    "  --set KEY=VALUE    set a key of the scene, in every point\n"
    "points to play instead of the usual ones, as comma-separated lists. Every combination of the values is a point.\n"
    "Without a list the scene's own value is used. A block has a lattice for each spacing; a mesh has only one:\n"
    "  --solver LIST      blend, secant, tangent, rk4 (if the scene allows rk4; otherwise a line gives the reason)\n"
    "  --precision LIST   f32, f64\n"
    "  --iterations LIST  CG iterations in every step (default: 4,8,16)\n"
    "  --tolerance LIST   residual above which CG makes more iterations than --iterations; 0: never (default: 0).\n"
    "                     CG makes up to three times --iterations, or up to 24 if 24 is larger\n"
    "  --passes LIST      linearisations per step\n"
    "  --dt LIST          time steps, e.g. '1 ms,0.5 ms'\n"
    "  --spacing LIST     lattice spacings, e.g. '10 mm,5 mm'\n"
    "distribution of the runs:\n"
    "  --resume DIR       keep every finished run in DIR, so that the same command continues after an interruption.\n"
    "                     A DIR with runs of another program, scene or log is refused\n"
    "  --jobs N           N runs at a time by GNU parallel, 0: one per processor.\n"
    "                     Times of parallel runs cannot be compared, so the points are then timed one by one\n"
    "  --hosts LIST       distribute the runs to hosts; the syntax is that of parallel's --sshlogin:\n"
    "                     user@host, 'ssh -p 2222 user@host', or : for this machine.\n"
    "                     Each host needs rsync and the same build of knead in its PATH.\n"
    "                     Times are measured on this machine\n\n"
    "A time is the thread's own processor time in a tick.\n"
    "The median and the p90 are taken over all ticks in which a tool touches the object.\n"
    "Each tick is measured in two rounds, and the shorter time counts.\n"
    "Errors are relative L2 norms: of the contact force over the log, and of the displacements at its end.\n"
    "  solver   error of the point against f64 at the same step (secant, five linearisations, CG to 1e-8)\n"
    "  step     error of f64 at the same step against f64 at 1/16 of the scene's step\n"
    "  lattice  error of f64 at 1/16 of the step on this lattice against f64 on the finest lattice of the sweep.\n"
    "           The finest lattice has an error of its own, which is not known\n"
    "  all      error of the point against f64 at 1/16 of the step, plus lattice: ranks the points of all lattices\n"
    "Effects that a hand would notice, against f64 at 1/16 of the step (--quick: at the same step):\n"
    "  peak     error of the force peak, relative\n"
    "  lag      delay of the force at 10 Hz; -: the force has too little energy at this frequency.\n"
    "           The lag is the phase of the cross spectrum with the reference's force over the whole log,\n"
    "           summed over 8 to 12 Hz and divided by the mean angular frequency\n"
    "  depth    additional depth of the deepest node after the log\n"
    "  jump     largest change of the force from one ms to the next.\n"
    "           The heading of each lattice has the jump of the reference\n"
    "  TV/pk    total variation of the force, divided by the reference's peak force.\n"
    "           A point `chatters` if its TV/pk is above 1.3 times that of the reference.\n"
    "           A point is `latched` if it diverged, or if more faults occurred than in the reference.\n"
    "           Neither kind of point is ever picked\n"
    "fast, balanced and accurate have the scene's lattice, step and precision.\n"
    "So a server can switch between these points while it runs.\n"
    "Each name is given to the cheapest point, by p90, that meets all of the following conditions.\n"
    "Times within 25 % count as equal; among them the point with the fewest iterations is chosen:\n"
    "  - the error of the solver in force and in shape is at most 3 % and 3 % (fast), 0.5 % and 1 % (balanced),\n"
    "    0.1 % and 0.2 % (accurate)\n"
    "  - the force jumps by at most 1.5 times the jump of the converged force\n"
    "  - the time is within solver.budget (default: 0.8 ms)\n"
    "  - the point needs more work than the point of the next faster name: its least or its largest number of\n"
    "    iterations per step is larger, and neither number is smaller\n"
    "If no point meets the bounds of the errors, the cheapest of the most accurate points gets the name,\n"
    "marked MISSED.\n"
    "A name that has no point of its own is reported.\n"
    "The line `no name` gives a more accurate point that needs another lattice, step or precision.\n\n"
    "Exit codes: 0 ok, 1 no point within the budget, 2 bad input, 3 a file, gnuplot, parallel or a host failed.\n";

static const char *take_tolerance(void *tolerance, const char *text)
{
    // The value is 0 already, so there is nothing to store.
    if (!strcmp(text, "0") || kn_quantity_read(text, "1", true, KN_ABOVE_0, KN_BELOW_1, tolerance)) return NULL;
    return "at most 32 numbers from 0 to 1, separated by commas";
}

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
    KN_OPTION("budget-us", QUANTITY, AT(budget_us), .unit = "1",
              .expected = "a number of microseconds above 0, like 300"),
    KN_OPTION("write", FLAG, AT(write)),
    KN_OPTION("csv", TEXT, AT(csv)),
    KN_OPTION("plot", TEXT, AT(plot)),
    KN_OPTION("set", LIST, AT(sets), .count = offsetof(kn_tradeoff_options, set_count), .most = KN_TRADEOFF_SETS,
              .expected = "at most 64 of them"),
    KN_OPTION("solver", CHOICE, AXIS(method, methods, 4), .unit = "blend|secant|tangent|rk4",
              .expected = "any of blend, secant, tangent and rk4, separated by commas"),
    KN_OPTION("precision", CHOICE, AXIS(precision, precisions, 2), .unit = "f32|f64",
              .expected = "f32, f64 or f32,f64"),
    KN_OPTION("iterations", INTEGER, AXIS(count, counts, KN_AXIS_MAX), KN_RANGE(1, 1000),
              .expected = "at most 32 whole numbers from 1 to 1000, separated by commas"),
    KN_OPTION("tolerance", SPECIAL, AXIS(tolerance, tolerances, KN_AXIS_MAX), .take = take_tolerance,
              .expected = "at most 32 numbers from 0 to 1, separated by commas"),
    KN_OPTION("passes", INTEGER, AXIS(pass, passes, KN_AXIS_MAX), KN_RANGE(1, 20),
              .expected = "at most 32 whole numbers from 1 to 20, separated by commas"),
    KN_OPTION("dt", SPECIAL, AXIS(dt_s, steps, KN_AXIS_MAX), .take = take_step,
              .expected = "at most 32 times like '0.5 ms', 1 ms divided by a whole number, separated by commas"),
    KN_OPTION("spacing", QUANTITY, AXIS(spacing_m, spacings, KN_AXIS_MAX), .unit = "m",
              .expected = "at most 32 lengths like '5 mm', separated by commas"),
    KN_OPTION("resume", TEXT, AT(resume)),
    KN_OPTION("jobs", INTEGER, AT(jobs), KN_RANGE(0, 1000), .expected = "a whole number, 0: one per processor"),
    KN_OPTION("hosts", TEXT, AT(hosts), .expected = "host,host"),
    KN_OPTION("job", TEXT, AT(job)),
};

int kn_tradeoff_options_parse(kn_tradeoff_options *opt, int argc, char **argv)
{
    static const kn_option_table table = {KN_OPTION_ROWS(rows), .help = help};
    *opt = (kn_tradeoff_options){.jobs = 1};
    const int code = kn_options_read(&table, opt, argc, argv);
    const kn_axes_def *a = &opt->axes;
    opt->listed = a->methods + a->precisions + a->counts + a->tolerances + a->passes + a->steps + a->spacings > 0;
    // With --job the job contains all settings, so no other arguments are needed.
    if (code != KN_OPTIONS_READ || opt->job) return code;
    if (argc - optind != 2)
        return kn_complain("tradeoff", KN_EXIT_USAGE, "expected SCENE LOG; see knead tradeoff --help");
    if (kn_command_scene("tradeoff", &opt->scene, argv[optind]) != KN_EXIT_OK) return KN_EXIT_USAGE;
    opt->log = argv[optind + 1];
    if (opt->write && opt->set_count > 0)
        return kn_complain("tradeoff", KN_EXIT_USAGE,
                           "--write: the points would be valid only with --set %s, expected "
                           "no --set",
                           opt->sets[0]);
    return code;
}
