#include "clients/sweep/sweep_plan.h"
#include "clients/cli/yaml_patch.h"
#include "clients/sweep/replay_trace.h"
#include "core/hash.h"
#include "core/lattice/lattice.h"
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define FINE_STEPS 16 // number of time steps of the reference FINE in one time step of the scene
// CG tolerance of the reference FINE. A tolerance of 1e-6 instead changes the force of a press by only 1e-7.
#define FINE_TOLERANCE 1e-4
#define SAME_TOLERANCE 1e-8
// SAME_PASSES: number of linearisations per time step of the reference SAME. LEAST, CAP: smallest and largest number of
// CG iterations of a reference. CAP_TIMES, CAP_LEAST: see cap_of.
enum { SAME_PASSES = 5, LEAST = 2, CAP = 1000, CAP_TIMES = 3, CAP_LEAST = 24 };

static const char *const names[] = {"blend", "secant", "tangent", "rk4"};

const char *kn_method_name(kn_method method) { return names[method]; }

const char *kn_sweep_run_effort(const kn_sweep_run *run, char text[64])
{
    char passes[16] = "";
    if (run->passes > 1) snprintf(passes, sizeof passes, " x%d", run->passes);
    if (run->method == KN_METHOD_RK4) snprintf(text, 64, "-");
    else if (run->iterations == run->iterations_max) snprintf(text, 64, "%d%s", run->iterations, passes);
    else snprintf(text, 64, "%d..%d to %g%s", run->iterations, run->iterations_max, run->tolerance, passes);
    return text;
}

const char *kn_sweep_run_name(const kn_sweep_run *run, char text[96])
{
    static const char *const roles[] = {"", "reference at the same step: ", "reference: "};
    char effort[64], lattice[32] = "";
    if (run->spacing_m > 0) snprintf(lattice, sizeof lattice, "%.4g mm, ", 1e3 * run->spacing_m);
    snprintf(text, 96, "%s%s%.4g ms, %s %s, %s", roles[run->role], lattice, 1e3 * run->dt_s, names[run->method],
             run->precision == KN_PRECISION_F64 ? "f64" : "f32", kn_sweep_run_effort(run, effort));
    return text;
}

// Add one formatted setting `key=value` to the list.
__attribute__((format(printf, 2, 3))) static void put(kn_sweep_run_sets *s, const char *format, ...)
{
    char *text = s->made[s->count];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof s->made[0], format, args);
    va_end(args);
    s->set[s->count++] = text;
}

void kn_sweep_run_sets_make(kn_sweep_run_sets *s, const kn_sweep_run *run)
{
    s->count = 0;
    put(s, "solver.kind=%s", run->method == KN_METHOD_RK4 ? "rk4" : "implicit");
    put(s, "solver.precision=%s", run->precision == KN_PRECISION_F64 ? "f64" : "f32");
    put(s, "solver.dt=%.17g s", run->dt_s);
    if (run->spacing_m > 0) put(s, "object.spacing=%.17g m", run->spacing_m);
    if (run->force_factor != 1) put(s, "object.force_factor=%.17g", run->force_factor);
    // The settings below belong to the implicit solver only.
    if (run->method == KN_METHOD_RK4) return;
    put(s, "solver.linearization=%s", names[run->method]);
    put(s, "solver.iterations=%d", run->iterations);
    put(s, "solver.iterations_max=%d", run->iterations_max);
    put(s, "solver.tolerance=%.17g", run->tolerance);
    put(s, "solver.passes=%d", run->passes);
}

// ---- one run

// Read the scene with the keys of the run to find its id and number of nodes. Return false and one line in error if the
// scene refuses the keys.
static bool resolve(const kn_sweep_plan *plan, kn_sweep_run *run, char *error, size_t error_size)
{
    kn_sweep_run_sets sets;
    kn_sweep_run_sets_make(&sets, run);
    kn_scene *scene = kn_scene_parse_beside(plan->scene_path, plan->scene_path, plan->text, strlen(plan->text),
                                            sets.set, sets.count, error, error_size);
    kn_model *model = NULL;
    bool composite = scene && kn_composite_is(&scene->model), built = composite || run->method == KN_METHOD_RK4;
    // Some invalid settings are found only when the model is built, so build the model.
    if (scene && built) model = kn_model_build(&scene->model, error, error_size);
    bool ok = scene && (model || !built);
    if (ok) {
        // In a lattice with two resolutions the motion of some nodes is interpolated from other nodes. Such nodes are
        // not counted.
        const int *n = scene->model.nodes;
        run->nodes = scene->mesh ? scene->mesh->node_count : n[0] * n[1] * n[2];
        if (composite) run->nodes = model->node_count - kn_composite_tied(model);
        // Two runs with the same canonical text are the same computation.
        uint64_t id = kn_hash_bytes(plan->origin, scene->text, strlen(scene->text));
        snprintf(run->id, sizeof run->id, "%016llx", (unsigned long long)id);
    }
    kn_model_destroy(model);
    kn_scene_destroy(scene);
    return ok;
}

// Append a note, unless the plan already has this note or already has four notes.
static void note(kn_sweep_plan *plan, const char *text)
{
    for (int i = 0; i < plan->notes; i++)
        if (!strcmp(plan->note[i], text)) return;
    if (plan->notes < 4) snprintf(plan->note[plan->notes++], sizeof plan->note[0], "%s", text);
}

// Add a run, unless the plan already has a run of the same role and id. Return the index of this run in the plan. On
// failure return -1 and write one line to `error`.
static int take(kn_sweep_plan *plan, kn_sweep_run run, char *error, size_t error_size)
{
    if (!resolve(plan, &run, error, error_size)) return -1;
    for (int i = 0; i < plan->count; i++) {
        kn_sweep_run *known = &plan->run[i];
        if (known->role != run.role || strcmp(known->id, run.id) != 0) continue;
        known->own |= run.own;
        return i;
    }
    if (plan->count == KN_SWEEP_RUNS_MAX) {
        snprintf(error, error_size, "the sweep has more than %d runs, expected shorter lists", KN_SWEEP_RUNS_MAX);
        return -1;
    }
    plan->run[plan->count] = run;
    return plan->count++;
}

// ---- the whole plan

bool kn_sweep_plan_open(kn_sweep_plan *plan, char *error, size_t error_size)
{
    plan->scene = kn_scene_load(plan->scene_path, plan->sets, plan->set_count, error, error_size);
    uint64_t hash[2];
    if (!plan->scene) return false;
    if (!kn_replay_trace_hash("/proc/self/exe", &hash[0]) || !kn_replay_trace_hash(plan->log_path, &hash[1])) {
        snprintf(error, error_size, "%s: %s, expected a log", plan->log_path, strerror(errno));
        return false;
    }
    plan->origin = kn_hash_bytes(KN_HASH_SEED, hash, sizeof hash);
    plan->text = kn_yaml_patch(plan->scene->text, "quality", "", error, error_size);
    return plan->text;
}

void kn_sweep_plan_close(kn_sweep_plan *plan)
{
    kn_scene_destroy(plan->scene);
    free(plan->text);
    plan->scene = NULL;
    plan->text = NULL;
}

// Return the run that plays the scene with its own settings.
static kn_sweep_run own_run(const kn_sweep_plan *plan)
{
    static const kn_method method[] = {[KN_LINEARIZATION_BLEND] = KN_METHOD_BLEND,
                                       [KN_LINEARIZATION_SECANT] = KN_METHOD_SECANT,
                                       [KN_LINEARIZATION_TANGENT] = KN_METHOD_TANGENT};
    const kn_model_def *def = &plan->scene->model;
    const kn_solver_def *s = &def->solver;
    return (kn_sweep_run){.spacing_m = def->mesh ? 0 : def->spacing_m,
                          .force_factor = def->force_factor,
                          .dt_s = s->dt_s,
                          .method = s->kind == KN_SOLVER_RK4 ? KN_METHOD_RK4 : method[s->linearization],
                          .precision = s->precision,
                          .iterations = s->iterations,
                          .iterations_max = s->iterations_max,
                          .passes = s->passes,
                          .tolerance = s->tolerance,
                          .same = -1,
                          .fine = -1};
}

bool kn_sweep_plan_add_own(kn_sweep_plan *plan, char *error, size_t error_size)
{
    kn_sweep_run run = own_run(plan);
    run.own = true;
    return take(plan, run, error, error_size) >= 0;
}

// Return the largest number of CG iterations that a time step may take. Without a tolerance every step takes exactly
// `count` iterations. Otherwise the largest number is CAP_TIMES times the count, but at least CAP_LEAST and at most
// CAP.
static int cap_of(const kn_sweep_run *run)
{
    if (run->tolerance == 0) return run->iterations;
    int cap = CAP_TIMES * run->iterations;
    return cap < CAP_LEAST ? CAP_LEAST : cap > CAP ? CAP : cap;
}

// Add the runs of one method, precision, step and lattice: one run for each combination of passes, counts and
// tolerances.
static bool add_efforts(kn_sweep_plan *plan, const kn_axes_def *a, kn_sweep_run run, char *error, size_t error_size)
{
    if (run.method == KN_METHOD_RK4) {
        // An explicit solver has no iterations, so there is only one run. If the scene refuses the run, add a note.
        if (take(plan, run, error, error_size) >= 0) return true;
        char why[300];
        snprintf(why, sizeof why, "rk4 cannot run here: %.250s", error);
        note(plan, why);
        return true;
    }
    for (int p = 0; p < (a->passes ? a->passes : 1); p++)
        for (int c = 0; c < a->counts; c++)
            for (int t = 0; t < a->tolerances; t++) {
                kn_sweep_run one = run;
                if (a->passes) one.passes = a->pass[p];
                one.iterations = a->count[c];
                one.tolerance = a->tolerance[t];
                one.iterations_max = cap_of(&one);
                if (take(plan, one, error, error_size) < 0) return false;
            }
    return true;
}

// Add the runs of one lattice: all combinations of steps, methods and precisions.
static bool add_lattice(kn_sweep_plan *plan, const kn_axes_def *a, kn_sweep_run run, char *error, size_t error_size)
{
    for (int d = 0; d < (a->steps ? a->steps : 1); d++)
        for (int m = 0; m < (a->methods ? a->methods : 1); m++)
            for (int p = 0; p < (a->precisions ? a->precisions : 1); p++) {
                kn_sweep_run one = run;
                if (a->steps) one.dt_s = a->dt_s[d];
                if (a->methods) one.method = a->method[m];
                if (a->precisions) one.precision = a->precision[p];
                if (one.method == KN_METHOD_RK4) one.precision = KN_PRECISION_F64; // rk4 exists in f64 only
                if (!add_efforts(plan, a, one, error, error_size)) return false;
            }
    return true;
}

bool kn_sweep_plan_add(kn_sweep_plan *plan, const kn_axes_def *a, bool strict, char *error, size_t error_size)
{
    for (int s = 0; s < (a->spacings ? a->spacings : 1); s++) {
        kn_sweep_run run = own_run(plan), probe;
        if (a->spacings && a->spacing_m[s] != run.spacing_m) run.spacing_m = a->spacing_m[s], run.force_factor = 1;
        // Check that the scene accepts this lattice before its runs are added.
        probe = run;
        if (!resolve(plan, &probe, error, error_size)) {
            if (strict) return false;
            char why[300];
            snprintf(why, sizeof why, "no lattice of %.4g mm: %.250s", 1e3 * run.spacing_m, error);
            note(plan, why);
        } else if (!add_lattice(plan, a, run, error, error_size)) return false;
    }
    return true;
}

// Find the reference run of the given role (SAME or FINE) for a point, and add the reference to the plan if it is
// missing. Return the index of the reference, or -1 and one line in `error`.
static int take_reference(kn_sweep_plan *plan, const kn_sweep_run *point, kn_role role, char *error, size_t error_size)
{
    kn_sweep_run run = *point;
    run.own = false;
    run.role = role;
    run.precision = KN_PRECISION_F64;
    run.method = role == KN_ROLE_SAME ? KN_METHOD_SECANT : KN_METHOD_BLEND;
    run.passes = role == KN_ROLE_SAME ? SAME_PASSES : 1;
    run.tolerance = role == KN_ROLE_SAME ? SAME_TOLERANCE : FINE_TOLERANCE;
    run.iterations = LEAST;
    run.iterations_max = CAP;
    if (role == KN_ROLE_FINE) run.dt_s = plan->scene->model.solver.dt_s / FINE_STEPS;
    return take(plan, run, error, error_size);
}

bool kn_sweep_plan_references(kn_sweep_plan *plan, char *error, size_t error_size)
{
    int points = plan->count;
    if (plan->scene->accuracy > 0)
        note(plan, "the lattice has two resolutions, and so have the references; knead check --log shows the error of "
                   "the coarse cells");
    for (int i = 0; i < points; i++) {
        kn_sweep_run run = plan->run[i];
        run.same = take_reference(plan, &run, KN_ROLE_SAME, error, error_size);
        run.fine = plan->fine ? take_reference(plan, &run, KN_ROLE_FINE, error, error_size) : -1;
        if (run.same < 0 || (plan->fine && run.fine < 0)) return false;
        plan->run[i] = run;
    }
    return true;
}
