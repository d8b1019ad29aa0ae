// knead tradeoff: measures speed and accuracy of many solver settings, by replaying a recorded hand on a scene.
// sweep_plan.h plans the runs, sweep_runs.h replays them, pareto_front.h evaluates and shows the results. This
// file runs these steps in order, and contains the list of usual points and the choice of points for the scene.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include "clients/cli/output.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "clients/cli/yaml_patch.h"
#include "clients/sweep/pareto_front.h"
#include "clients/sweep/sweep_plan.h"
#include "clients/sweep/sweep_runs.h"
#include "core/scene/mesh_file.h"
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

// State of one sweep.
typedef struct sweep {
    kn_tradeoff_options opt;
    kn_sweep_plan plan;
    kn_sweep_runs crew;
    kn_replay_trace traces[KN_SWEEP_RUNS_MAX];
    kn_pareto_front front;
    const kn_pareto_row *named[KN_QUALITY_OWN];
} sweep;

// ---- the usual points

#define BOTH .methods = 2, .method = {KN_METHOD_BLEND, KN_METHOD_SECANT}
#define BLEND .methods = 1, .method = {KN_METHOD_BLEND}
#define F32 .precisions = 1, .precision = {KN_PRECISION_F32}
#define ONE_TOLERANCE(value) .tolerances = 1, .tolerance = {value}

static const kn_axes_def usual[] = {
    // On the scene's own lattice and time step, vary the number of CG iterations and how they are spread over the time
    // steps.
    {BOTH, F32, .counts = 8, .count = {2, 3, 4, 6, 8, 12, 16, 24}, ONE_TOLERANCE(0)},
    {BOTH, F32, .counts = 4, .count = {2, 4, 8, 16}, ONE_TOLERANCE(1e-3)},
    {BLEND, F32, .counts = 1, .count = {2}, .tolerances = 2, .tolerance = {1e-2, 1e-4}},
    // Then vary the number of linearisations, and use double precision.
    {BLEND, F32, .counts = 2, .count = {4, 8}, .tolerances = 3, .tolerance = {0, 1e-3, 1e-4}, .passes = 1, .pass = {2}},
    {.methods = 2,
     .method = {KN_METHOD_BLEND, KN_METHOD_RK4},
     .precisions = 1,
     .precision = {KN_PRECISION_F64},
     .counts = 3,
     .count = {4, 8, 16},
     ONE_TOLERANCE(0)}};

static const kn_axes_def quick[] = {
    {BOTH, F32, .counts = 4, .count = {3, 4, 8, 16}, ONE_TOLERANCE(0)},
    {BLEND, F32, .counts = 2, .count = {2, 8}, ONE_TOLERANCE(1e-3)},
    {BLEND, F32, .counts = 1, .count = {4}, ONE_TOLERANCE(1e-3), .passes = 1, .pass = {2}}};

// Add the usual points: first on the scene's lattice, then on other lattices, then with half of the time step.
static bool add_usual(sweep *s, char *error, size_t error_size)
{
    kn_sweep_plan *plan = &s->plan;
    const kn_axes_def *list = s->opt.quick ? quick : usual;
    size_t count = s->opt.quick ? sizeof quick / sizeof *quick : sizeof usual / sizeof *usual;
    for (size_t i = 0; i < count; i++)
        if (!kn_sweep_plan_add(plan, &list[i], false, error, error_size)) return false;
    const kn_model_def *def = &plan->scene->model;
    kn_axes_def other = {BOTH, F32, .counts = 3, .count = {4, 8, 16}, ONE_TOLERANCE(0)};
    // Add a lattice with twice the spacing and, without --quick, a lattice with the spacing divided by 1.5.
    if (!def->mesh) {
        other.spacings = s->opt.quick ? 1 : 2;
        other.spacing_m[0] = 2 * def->spacing_m;
        other.spacing_m[1] = def->spacing_m / 1.5;
        if (!kn_sweep_plan_add(plan, &other, false, error, error_size)) return false;
    }
    if (s->opt.quick) return true;
    other.spacings = 0;
    other.methods = other.steps = 1;
    other.dt_s[0] = def->solver.dt_s / 2;
    return kn_sweep_plan_add(plan, &other, false, error, error_size);
}

// Plan the runs: the scene's own settings, the points, and their references.
static bool make_plan(sweep *s, char *error, size_t error_size)
{
    static const int counts[] = {4, 8, 16};
    kn_axes_def *axes = &s->opt.axes;
    // Default values of those axes of the sweep for which the user gave no list.
    if (axes->counts == 0) {
        memcpy(axes->count, counts, sizeof counts);
        axes->counts = 3;
    }
    if (axes->tolerances == 0) axes->tolerances = 1; // default of --tolerance: the single value 0
    s->plan.scene_path = s->opt.scene;
    s->plan.log_path = s->opt.log;
    s->plan.sets = s->opt.sets;
    s->plan.set_count = s->opt.set_count;
    s->plan.fine = !s->opt.quick;
    if (!kn_sweep_plan_open(&s->plan, error, error_size) || !kn_sweep_plan_add_own(&s->plan, error, error_size))
        return false;
    bool added =
        s->opt.listed ? kn_sweep_plan_add(&s->plan, axes, true, error, error_size) : add_usual(s, error, error_size);
    return added && kn_sweep_plan_references(&s->plan, error, error_size);
}

// ---- writing the named points into the scene

// Size of the buffer for the `quality` block, bytes. The three lines of the block fit even with the longest numbers.
#define BLOCK 2048

// Check that the scene file can be replaced. Check the permission bits, because root may write any file. A file that is
// writable for nobody is not replaced.
static int try_scene(const kn_sweep_plan *plan)
{
    char path[PATH_MAX], folder[PATH_MAX];
    struct stat there;
    if (plan->scene->model.solver.kind == KN_SOLVER_RK4)
        return kn_complain("tradeoff", KN_EXIT_USAGE,
                           "--write: %s: solver.kind is rk4, which has no quality points, expected implicit",
                           plan->scene_path);
    if (!realpath(plan->scene_path, path) || stat(path, &there) != 0)
        return kn_complain("tradeoff", KN_EXIT_DEVICE, "--write: %s: %s", plan->scene_path, strerror(errno));
    if (!S_ISREG(there.st_mode) || !(there.st_mode & 0222) || access(path, W_OK) != 0)
        return kn_complain("tradeoff", KN_EXIT_DEVICE,
                           "--write: %s: is read-only, expected a scene that may be changed", plan->scene_path);
    // The new file is created beside the old one, so the folder must be writable.
    snprintf(folder, sizeof folder, "%s", path);
    if (access(dirname(folder), W_OK | X_OK) == 0) return KN_EXIT_OK;
    return kn_complain("tradeoff", KN_EXIT_DEVICE,
                       "--write: %s: its folder is read-only, expected a writable folder, because the file is replaced",
                       plan->scene_path);
}

// Write the precision and spacing that the active quality point itself states: "precision: f64, spacing: 0.01 m, ".
static bool own_lattice(const kn_sweep_plan *plan, char text[96], char *error, size_t error_size)
{
    // Parse the scene without its quality block. If a value differs from that of the planned scene, the active quality
    // point has set this value.
    const kn_model_def *found = &plan->scene->model;
    kn_scene *bare = kn_scene_parse_beside(plan->scene_path, plan->scene_path, plan->text, strlen(plan->text), NULL, 0,
                                           error, error_size);
    text[0] = '\0';
    if (!bare) return false;
    if (bare->model.solver.precision != found->solver.precision)
        strcat(text, found->solver.precision == KN_PRECISION_F64 ? "precision: f64, " : "precision: f32, ");
    if (!found->mesh && bare->model.spacing_m != found->spacing_m)
        snprintf(text + strlen(text), 96 - strlen(text), "spacing: %.17g m, ", found->spacing_m);
    kn_scene_destroy(bare);
    return true;
}

// Format the new `quality` block of the scene. The caller frees the text. Return NULL when memory is short.
static char *quality_block(const kn_sweep_plan *plan, const kn_pareto_row *const named[KN_QUALITY_OWN],
                           const char *lattice)
{
    char *text = malloc(BLOCK);
    if (!text) return NULL;
    int n = snprintf(text, BLOCK, "quality:  # by knead tradeoff: time and error of the solver\n");
    if (plan->scene->quality != KN_QUALITY_OWN)
        n += snprintf(text + n, BLOCK - (size_t)n, "  chosen: %s\n", kn_quality_name(plan->scene->quality));
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++) {
        const kn_pareto_row *r = named[q];
        const kn_sweep_run *run = r->run;
        n += snprintf(text + n, BLOCK - (size_t)n,
                      "  %s: {%siterations: %d, iterations_max: %d, tolerance: %.9g, passes: %d, linearization: %s}"
                      "  # %.0f us, force %.2g %%, shape %.2g %%\n",
                      kn_quality_name(q), lattice, run->iterations, run->iterations_max, run->tolerance, run->passes,
                      kn_method_name(run->method), r->median_us, 100 * r->force.solver, 100 * r->shape.solver);
    }
    return text;
}

// Return true if text is the planned scene in everything but its quality. Somebody may have edited the file meanwhile.
static bool is_same_scene(const kn_sweep_plan *plan, const char *path, const char *text, char *error, size_t error_size)
{
    kn_scene *scene = kn_scene_parse_beside(path, path, text, strlen(text), NULL, 0, error, error_size);
    char *now = scene ? kn_yaml_patch(scene->text, "quality", "", error, error_size) : NULL;
    bool same = now && !strcmp(now, plan->text);
    if (now && !same) snprintf(error, error_size, "the scene file was changed meanwhile");
    free(now);
    kn_scene_destroy(scene);
    return same;
}

// Replace the file: write a new file in the same folder, with the owner and permissions of the old file, and rename it
// over the old file. A reader sees either the old scene or the new one.
static bool replace(const char *path, const char *text)
{
    char half[PATH_MAX];
    struct stat old;
    if (snprintf(half, sizeof half, "%s.XXXXXX", path) >= PATH_MAX || stat(path, &old) != 0) return false;
    const int fd = mkostemp(half, O_CLOEXEC); // creates a file of a name that did not exist before
    FILE *f = fd >= 0 ? fdopen(fd, "w") : NULL;
    if (!f) return false;
    // Only root may set the owner; otherwise the file belongs to the user of the sweep.
    if (fchown(fileno(f), old.st_uid, old.st_gid) != 0) errno = 0;
    bool ok =
        fchmod(fileno(f), old.st_mode & 07777) == 0 && fputs(text, f) >= 0 && fflush(f) == 0 && fsync(fileno(f)) == 0;
    ok = fclose(f) == 0 && ok && rename(half, path) == 0;
    if (!ok) unlink(half);
    return ok;
}

// Report which quality points were written, and which quality points of other lattices or precisions were removed.
static void tell_written(const kn_sweep_plan *plan)
{
    printf("wrote fast, balanced and accurate into %s\n", plan->scene_path);
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++)
        if (plan->scene->point[q].defined && !plan->scene->point[q].live)
            printf("removed the old quality point %s, which had another lattice or precision\n", kn_quality_name(q));
}

// Write the quality points into the `quality` block of the scene file. All other bytes of the file stay unchanged. A
// quality point states the five numbers of the solver. If the scene's active quality point states a precision or a
// spacing, the new points state it too. The new points were found on the lattice of that spacing, and a server that
// changes between quality points keeps its lattice.
static int write_scene(const kn_sweep_plan *plan, const kn_pareto_row *const named[KN_QUALITY_OWN])
{
    char error[512] = "not enough memory", path[PATH_MAX], lattice[96];
    size_t size;
    if (!realpath(plan->scene_path, path))
        return kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s", plan->scene_path, strerror(errno));
    unsigned char *bytes = kn_words_load(path, &size, error, sizeof error);
    char *old = bytes ? realloc(bytes, size + 1) : NULL, *block = NULL;
    if (old) old[size] = '\0';
    if (old && own_lattice(plan, lattice, error, sizeof error)) block = quality_block(plan, named, lattice);
    char *text = block ? kn_yaml_patch(old, "quality", block, error, sizeof error) : NULL;
    int code = KN_EXIT_OK;
    if (!text || !is_same_scene(plan, path, text, error, sizeof error))
        code = kn_complain("tradeoff", KN_EXIT_USAGE, "--write: %s", error);
    else if (!replace(path, text))
        code = kn_complain("tradeoff", KN_EXIT_DEVICE, "%s: %s, not written", path, strerror(errno));
    else tell_written(plan);
    free(text);
    free(block);
    free(old ? old : (char *)bytes);
    return code;
}

// ---- the report

static void print_begin(const sweep *s)
{
    const kn_sweep_plan *plan = &s->plan;
    printf("scene      %s, log %s\nruns       %d, of which %d were kept from before\n", plan->scene->name,
           plan->log_path, plan->count, s->crew.kept);
    fflush(stdout);
}

// Explain the measured times. Warn if the times are not comparable, because they come from several passes or from a
// busy machine.
static void print_times(const sweep *s)
{
    int64_t first = 0;
    bool several = false;
    for (int i = 0; i < s->plan.count; i++) {
        int64_t sitting = s->traces[i].sitting;
        if (s->plan.run[i].role != KN_ROLE_POINT) continue;
        several |= first && sitting != first;
        first = sitting;
    }
    printf("times      processor time of a servo tick: the shorter time of two rounds, one run at a time");
    if (several) printf("; NOT all measured in one session: compare with care");
    if (s->crew.unsteady > 0)
        printf("; %d of %d points took over 15 %% longer in one round than in the other: this machine is busy",
               s->crew.unsteady, s->crew.timed);
    putchar('\n');
}

// Print the quality points fast, balanced and accurate. The word MISSED marks a point that violates the bounds of its
// name.
static void print_named(const sweep *s)
{
    double budget_us = 1e6 * s->plan.scene->budget_s;
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++) {
        const kn_pareto_row *r = s->named[q];
        char name[96];
        printf("%-10s ", kn_quality_name(q));
        if (!r) printf("none: no point's p90 is %g us or less", budget_us);
        else if (q > 0 && r == s->named[q - 1])
            printf("the same point as %s, because no other point qualifies", kn_quality_name(q - 1));
        else
            printf("%s: %.0f us, p90 %.0f us, error of the solver: force %.2g %%, shape %.2g %%",
                   kn_sweep_run_name(r->run, name), r->median_us, r->p90_us, 100 * r->force.solver,
                   100 * r->shape.solver);
        if (r && kn_pareto_front_excess(r, q) > 1)
            printf("; MISSED: allowed are %g %% of force, %g %% of shape and a jump of %.2g N/ms",
                   100 * kn_pareto_front_bounds[q].force, 100 * kn_pareto_front_bounds[q].shape,
                   KN_PARETO_JUMP * r->same_jump_n);
        putchar('\n');
    }
}

// Print the options that select a point without a name.
static void print_sets(const sweep *s, const kn_pareto_row *r)
{
    kn_sweep_run_sets sets;
    kn_sweep_run_sets_make(&sets, r->run);
    if (s->plan.scene->quality != KN_QUALITY_OWN) printf(" --quality own");
    for (int i = 0; i < sets.count; i++) printf(" --set '%s'", sets.set[i]);
    putchar('\n');
}

// Print a point that is more accurate than the named ones but needs another lattice, step or precision.
static void print_elsewhere(const sweep *s)
{
    char name[96];
    const kn_pareto_row *r = kn_pareto_front_elsewhere(&s->front, &s->plan, s->named);
    if (!r) return;
    printf("no name    %s: p90 %.0f us, total force error %.3g %%, more accurate than the named points, but a "
           "running server cannot change to its lattice, step or precision; options of this point:",
           kn_sweep_run_name(r->run, name), r->p90_us, 100 * r->force.all);
    print_sets(s, r);
}

// Print the most accurate point whose 90th percentile of the tick times is within --budget.
static int pick(const sweep *s)
{
    char name[96];
    const kn_pareto_row *r = kn_pareto_front_pick(&s->front, s->opt.budget_us);
    if (!r)
        return kn_complain("tradeoff", KN_EXIT_FAILED, "--budget %g us: no usable point has a p90 within this budget",
                           s->opt.budget_us);
    printf("%g us     %s: p90 %.0f us, force %.3g %%, shape %.3g %% in all\n          ", s->opt.budget_us,
           kn_sweep_run_name(r->run, name), r->p90_us, 100 * r->force.all, 100 * r->shape.all);
    print_sets(s, r);
    return KN_EXIT_OK;
}

static int write_named(const sweep *s)
{
    if (s->named[0]) return write_scene(&s->plan, s->named);
    return kn_complain("tradeoff", KN_EXIT_FAILED,
                       "--write: no point of the scene's lattice, step and precision has a p90 of %g us or less",
                       1e6 * s->plan.scene->budget_s);
}

static int write_csv(const sweep *s)
{
    kn_beside out;
    FILE *f = kn_output_open(&out, "tradeoff", s->opt.csv);
    if (!f) return KN_EXIT_DEVICE;
    kn_pareto_front_csv(&s->front, f);
    return kn_output_close(&out, "tradeoff");
}

// Evaluate the traces, print and write all results. Return the exit code.
static int report(sweep *s)
{
    if (!kn_pareto_front_make(&s->front, &s->plan, s->traces))
        return kn_complain("tradeoff", KN_EXIT_USAGE,
                           "%s: its tools never touch the object, expected a log with a force", s->opt.log);
    kn_pareto_front_name(&s->front, &s->plan, s->named);
    kn_pareto_front_result(&s->front);
    for (int q = 0; q < KN_QUALITY_OWN; q++) {
        char name[96];
        if (s->named[q])
            kn_result_text(kn_result(), kn_quality_name((kn_quality)q), kn_sweep_run_name(s->named[q]->run, name));
    }
    kn_pareto_chart_print(&s->front, &s->plan, s->named);
    print_times(s);
    print_named(s);
    print_elsewhere(s);
    int code = s->opt.csv ? write_csv(s) : KN_EXIT_OK;
    if (code == KN_EXIT_OK && s->opt.png) code = kn_pareto_chart_draw(&s->front, &s->plan, s->named, s->opt.png);
    if (code == KN_EXIT_OK && s->opt.write) code = write_named(s);
    return code == KN_EXIT_OK && s->opt.budget_us > 0 ? pick(s) : code;
}

// Check that the outputs can be written, before the long computation. An output must not be one of the input files.
static int try_files(const sweep *s)
{
    const kn_tradeoff_options *opt = &s->opt;
    const char *const outputs[] = {opt->csv, opt->png};
    for (int i = 0; i < 2; i++)
        if (kn_output_same(outputs[i], opt->log) || kn_output_same(outputs[i], opt->scene))
            return kn_complain("tradeoff", KN_EXIT_USAGE, "%s: is being read, expected another file to write",
                               outputs[i]);
    int code = opt->csv ? kn_output_try("tradeoff", opt->csv) : KN_EXIT_OK;
    if (code == KN_EXIT_OK && opt->png) code = kn_plot_try("tradeoff", opt->png);
    return code == KN_EXIT_OK && opt->write ? try_scene(&s->plan) : code;
}

// Plan the runs, replay them and report. Close the folder of the sweep (s->crew) in any case.
static int run(sweep *s)
{
    char error[512];
    if (!make_plan(s, error, sizeof error)) return kn_complain("tradeoff", KN_EXIT_USAGE, "%s", error);
    int code = try_files(s);
    if (code != KN_EXIT_OK) return code;
    s->crew.plan = &s->plan;
    s->crew.resume = s->opt.resume;
    s->crew.trace = s->traces;
    s->crew.jobs.engine = s->opt.engine;
    code = kn_sweep_runs_open(&s->crew);
    if (code == KN_EXIT_OK) print_begin(s);
    if (code == KN_EXIT_OK) code = kn_sweep_runs_play(&s->crew);
    if (code == KN_EXIT_OK) code = report(s);
    kn_jobs_close(&s->crew.jobs);
    return code;
}

int kn_tradeoff_main(int argc, char **argv)
{
    sweep *s = calloc(1, sizeof *s);
    if (!s) return kn_complain("tradeoff", KN_EXIT_INTERNAL, "out of memory");
    int code = kn_tradeoff_options_parse(&s->opt, argc, argv);
    const kn_tradeoff_options *o = &s->opt;
    const kn_replay_def job = {
        .log_path = o->log, .scene_path = o->scene, .sets = o->sets, .set_count = o->set_count, .afresh = true};
    if (o->job) kn_jobs_begin();
    if (code == KN_OPTIONS_READ) code = o->job ? kn_sweep_run_play(&s->crew, o->job, &job, s->traces) : run(s);
    for (int i = 0; i < KN_SWEEP_RUNS_MAX; i++) kn_replay_trace_free(&s->traces[i]);
    kn_sweep_plan_close(&s->plan);
    free(s);
    return code;
}
