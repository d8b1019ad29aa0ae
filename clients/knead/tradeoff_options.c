#include "clients/knead/tradeoff_options.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/result.h"
#include "core/scene/units.h"
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char help[] =
    "usage: knead tradeoff SCENE LOG [OPTION]...\n\n"
    "Replays a whole log of this scene (knead probe --record) at many points of speed against accuracy, each\n"
    "through the daemon's own servo, and compares them with references in double precision. Prints a table and\n"
    "three named points.\n\n"
    "    knead tradeoff dough.yaml press.lcmlog --plot tradeoff.png    some minutes; --quick: under one\n"
    "    knead tradeoff dough.yaml press.lcmlog --budget-us 300        the most accurate point within 300 us\n"
    "    knead tradeoff dough.yaml press.lcmlog --write                fast, balanced, accurate for --quality\n\n"
    "  --quick            no reference for the error of the step; fewer of the usual points, on no finer lattice\n"
    "  --budget-us N      pick the most accurate point whose p90 is at most N us; exit 1 if there is none\n"
    "  --write            replace `quality` of the scene by the three points; the rest of the file stays, byte for\n"
    "                     byte\n"
    "  --csv FILE         write every point and every number; an empty cell was not measured\n"
    "  --json             print every point, and the named ones, as JSON\n"
    "  --plot FILE.png    draw the time of a tick against the error (needs gnuplot)\n"
    "  --set KEY=VALUE    set a key of the scene, in every point\n"
    "points to play instead of the usual ones: comma-separated lists, in all combinations; the scene's own value is\n"
    "taken where no list is given. A lattice is given by the spacing of the block; a mesh has only one:\n"
    "  --solver LIST      blend, secant, tangent, rk4 (if its stable step allows it; else a line gives the reason)\n"
    "  --precision LIST   f32, f64\n"
    "  --iterations LIST  CG iterations in every step (default: 4,8,16)\n"
    "  --tolerance LIST   residual above which up to three times as many iterations, or 24, are made; 0: never more\n"
    "                     (default: 0)\n"
    "  --passes LIST      linearisations per step\n"
    "  --dt LIST          time steps, e.g. '1 ms,0.5 ms'\n"
    "  --spacing LIST     lattice spacings, e.g. '10 mm,5 mm'\n"
    "distribution of the runs:\n"
    "  --resume DIR       keep every finished run in DIR: the same command continues after an interruption. Runs of\n"
    "                     another program, scene or log are recognised and refused\n"
    "  --jobs N           N runs at a time by GNU parallel, 0: one per processor. Times of parallel runs cannot be\n"
    "                     compared, so the points are played again, one at a time, for their times\n"
    "  --hosts LIST       distribute the runs to hosts, as in parallel's --sshlogin (user@host, 'ssh -p 2222\n"
    "                     user@host', : is this machine). Each needs rsync and the same build of knead in its PATH;\n"
    "                     times are measured here\n\n"
    "A time is the thread's own processor time in a tick: median and p90 over all ticks in which a tool touches the\n"
    "object (the others have little to do), for each tick the better of two rounds. Errors are relative L2 norms,\n"
    "of the contact force over the log and of the displacements after it.\n"
    "  solver   error against f64 at the same step, secant, five linearisations, CG to 1e-8\n"
    "  step     error of that reference against f64 at 1/16 of the scene's step\n"
    "  lattice  error of f64 at 1/16 against the same on the finest lattice of the sweep, which has an error of its\n"
    "           own\n"
    "  all      error of the point against f64 at 1/16, plus lattice: ranks the points of all lattices\n"
    "Effects that a hand would notice, against f64 at 1/16 of the step (--quick: at the same step):\n"
    "  peak     error of the force peak, relative\n"
    "  lag      delay of the force at 10 Hz: phase of its cross spectrum with the reference's force over the whole\n"
    "           log, summed over 8 to 12 Hz, divided by the mean angular frequency; - if there is no force to\n"
    "           compare\n"
    "  depth    additional depth of the deepest node after the log\n"
    "  jump     largest change of the force from one ms to the next; the reference's own is in the line of the\n"
    "           lattice\n"
    "  TV/pk    total variation over the reference's peak; `chatters` above 1.3 times the reference's. `latched`:\n"
    "           the output stage took the force away where the reference kept it. Neither is ever picked\n"
    "fast, balanced and accurate are on the scene's lattice, step and precision, so that a server can switch\n"
    "between them. Each is the cheapest point by p90 (times within 25 % are equal; then fewer iterations count)\n"
    "that meets all of these:\n"
    "  - the error of the solver is at most 3 % of force and 3 % of shape; 0.5 and 1 %; 0.1 and 0.2 %\n"
    "  - the force jumps by at most 1.5 times the converged one's\n"
    "  - the time is within solver.budget (default: 0.8 ms)\n"
    "  - the work exceeds that of the name before: more iterations in every step or at most, and neither fewer\n"
    "If no point is that accurate, the cheapest of the most accurate is named and marked MISSED. A name without a\n"
    "point of its own is reported. `no name` is a more accurate point that needs another lattice, step or\n"
    "precision.\n\n"
    "Exit codes: 0 ok, 1 no point within the budget, 2 bad input, 3 a file, gnuplot, parallel or a host failed.\n";

static int bad(const char *option, const char *text, const char *expected)
{
    return kn_complain("tradeoff", KN_EXIT_USAGE, "--%s %s: expected %s", option, text, expected);
}

// Parse one item of a list into element i of an axis. Return false if the item is not valid.
typedef bool (*take_item)(kn_axes_def *axes, int i, const char *text);

// Parse a whole number in least..most.
static bool whole(const char *text, long least, long most, long *value)
{
    char *end;
    *value = strtol(text, &end, 10);
    return end != text && *end == '\0' && *value >= least && *value <= most;
}

// Parse a quantity > 0 in unit_text. Only the unit "1" may be left out.
static bool quantity(const char *text, const char *unit_text, double *value)
{
    kn_unit unit;
    kn_quantity q;
    char why[128];
    if (!kn_unit_parse(&unit, unit_text, why, sizeof why) || !kn_quantity_parse(&q, text, why, sizeof why))
        return false;
    if (q.bare ? strcmp(unit_text, "1") != 0 : !kn_unit_same_dimension(&q.unit, &unit)) return false;
    *value = kn_quantity_in(&q, &unit);
    return isfinite(*value) && *value > 0;
}

static bool take_method(kn_axes_def *a, int i, const char *text)
{
    for (kn_method m = KN_METHOD_BLEND; m <= KN_METHOD_RK4; m++)
        if (!strcmp(text, kn_method_name(m))) {
            a->method[i] = m;
            a->methods = i + 1;
            return true;
        }
    return false;
}

static bool take_precision(kn_axes_def *a, int i, const char *text)
{
    a->precision[i] = strcmp(text, "f64") ? KN_PRECISION_F32 : KN_PRECISION_F64;
    a->precisions = i + 1;
    return !strcmp(text, "f64") || !strcmp(text, "f32");
}

static bool take_count(kn_axes_def *a, int i, const char *text)
{
    long value;
    if (!whole(text, 1, 1000, &value)) return false;
    a->count[i] = (int)value;
    a->counts = i + 1;
    return true;
}

static bool take_pass(kn_axes_def *a, int i, const char *text)
{
    long value;
    if (!whole(text, 1, 20, &value)) return false;
    a->pass[i] = (int)value;
    a->passes = i + 1;
    return true;
}

static bool take_tolerance(kn_axes_def *a, int i, const char *text)
{
    a->tolerances = i + 1;
    // The element of the list is 0 already, so nothing is stored.
    if (!strcmp(text, "0")) return true;
    return quantity(text, "1", &a->tolerance[i]) && a->tolerance[i] < 1;
}

static bool take_step(kn_axes_def *a, int i, const char *text)
{
    a->steps = i + 1;
    return quantity(text, "s", &a->dt_s[i]) && kn_backend_steps(a->dt_s[i]) > 0;
}

static bool take_spacing(kn_axes_def *a, int i, const char *text)
{
    a->spacings = i + 1;
    return quantity(text, "m", &a->spacing_m[i]);
}

// Options that take lists. most: largest number of items in the list.
static const struct axis {
    char letter;
    const char *option;
    int most;
    take_item take;
    const char *expected;
} list_axes[] = {
    {'s', "solver", 4, take_method, "any of blend, secant, tangent and rk4, separated by commas"},
    {'p', "precision", 2, take_precision, "f32, f64 or f32,f64"},
    {'i', "iterations", KN_AXIS_MAX, take_count, "at most 32 whole numbers from 1 to 1000, separated by commas"},
    {'t', "tolerance", KN_AXIS_MAX, take_tolerance, "at most 32 numbers from 0 to 1, separated by commas"},
    {'P', "passes", KN_AXIS_MAX, take_pass, "at most 32 whole numbers from 1 to 20, separated by commas"},
    {'d', "dt", KN_AXIS_MAX, take_step,
     "at most 32 times like '0.5 ms', 1 ms divided by a whole number, separated by commas"},
    {'x', "spacing", KN_AXIS_MAX, take_spacing, "at most 32 lengths like '5 mm', separated by commas"}};

// Parse a list separated by commas.
static int take_list(kn_tradeoff_options *opt, const struct axis *axis, const char *text)
{
    int i = 0;
    opt->listed = true;
    for (const char *at = text; at; at = strchr(at, ',') ? strchr(at, ',') + 1 : NULL) {
        char item[64];
        int length = snprintf(item, sizeof item, "%.*s", (int)strcspn(at, ","), at);
        if (i == axis->most || length >= (int)sizeof item || !axis->take(&opt->axes, i, item))
            return bad(axis->option, text, axis->expected);
        i++;
    }
    return KN_EXIT_OK;
}

static int take_option(kn_tradeoff_options *opt, int letter, const char *value)
{
    long jobs;
    // Handle the options that take lists first.
    for (size_t i = 0; i < sizeof list_axes / sizeof *list_axes; i++)
        if (list_axes[i].letter == letter) return take_list(opt, &list_axes[i], value);
    switch (letter) {
    case 'q': opt->quick = true; return KN_EXIT_OK;
    case 'o': kn_result_open(); return KN_EXIT_OK;
    case 'w': opt->write = true; return KN_EXIT_OK;
    case 'c': opt->csv = value; return KN_EXIT_OK;
    case 'f': opt->plot = value; return KN_EXIT_OK;
    case 'r': opt->resume = value; return KN_EXIT_OK;
    case 'H': opt->hosts = value; return *value ? KN_EXIT_OK : bad("hosts", value, "host,host");
    case 'J': opt->job = value; return KN_EXIT_OK;
    case 'b':
        if (quantity(value, "1", &opt->budget_us)) return KN_EXIT_OK;
        return bad("budget-us", value, "a number of microseconds above 0, like 300");
    case 'j':
        if (!whole(value, 0, 1000, &jobs)) return bad("jobs", value, "a whole number, 0: one per processor");
        opt->jobs = (int)jobs;
        return KN_EXIT_OK;
    case 'k':
        if (opt->set_count == KN_TRADEOFF_SETS) return bad("set", value, "at most 64 of them");
        opt->sets[opt->set_count++] = value;
        return KN_EXIT_OK;
    default: return KN_EXIT_USAGE; // getopt has printed the reason
    }
}

// Check combinations of options.
static int check(const kn_tradeoff_options *opt)
{
    if (opt->write && opt->set_count > 0)
        return kn_complain("tradeoff", KN_EXIT_USAGE,
                           "--write: the points would be of the scene with --set %s, expected "
                           "no --set",
                           opt->sets[0]);
    return KN_EXIT_OK;
}

int kn_tradeoff_options_parse(kn_tradeoff_options *opt, int argc, char **argv, bool *done)
{
    static const struct option options[] = {{"json", no_argument, NULL, 'o'},
                                            {"quick", no_argument, NULL, 'q'},
                                            {"budget-us", required_argument, NULL, 'b'},
                                            {"write", no_argument, NULL, 'w'},
                                            {"csv", required_argument, NULL, 'c'},
                                            {"plot", required_argument, NULL, 'f'},
                                            {"set", required_argument, NULL, 'k'},
                                            {"solver", required_argument, NULL, 's'},
                                            {"precision", required_argument, NULL, 'p'},
                                            {"iterations", required_argument, NULL, 'i'},
                                            {"tolerance", required_argument, NULL, 't'},
                                            {"passes", required_argument, NULL, 'P'},
                                            {"dt", required_argument, NULL, 'd'},
                                            {"spacing", required_argument, NULL, 'x'},
                                            {"resume", required_argument, NULL, 'r'},
                                            {"jobs", required_argument, NULL, 'j'},
                                            {"hosts", required_argument, NULL, 'H'},
                                            {"job", required_argument, NULL, 'J'},
                                            {"help", no_argument, NULL, 'h'},
                                            {NULL, 0, NULL, 0}};
    memset(opt, 0, sizeof *opt);
    opt->jobs = 1;
    optind = 0; // restart getopt, because a test calls this function more than once
    for (int letter; (letter = getopt_long(argc, argv, "", options, NULL)) != -1;) {
        if (letter == 'h') {
            fputs(help, stdout);
            *done = true;
            return KN_EXIT_OK;
        }
        int code = take_option(opt, letter, optarg);
        if (code != KN_EXIT_OK) return code;
    }
    // With --job the job contains all settings, so no other arguments are needed.
    if (opt->job) return KN_EXIT_OK;
    if (argc - optind != 2)
        return kn_complain("tradeoff", KN_EXIT_USAGE, "expected SCENE LOG; see knead tradeoff --help");
    opt->scene = argv[optind];
    opt->log = argv[optind + 1];
    return check(opt);
}
