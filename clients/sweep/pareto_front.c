#include "clients/sweep/pareto_front.h"
#include "clients/cli/result.h"
#include "clients/sweep/contact_force_error.h"
#include "server/servo.h"
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

// If the errors of all points exceed the bounds of a name, points up to this factor times the least excess are
// accepted.
#define SLACK 1.1

const kn_pareto_bound kn_pareto_front_bounds[KN_QUALITY_OWN] = {
    [KN_QUALITY_FAST] = {0.03, 0.03}, [KN_QUALITY_BALANCED] = {0.005, 0.01}, [KN_QUALITY_ACCURATE] = {0.001, 0.002}};

typedef double (*measure)(const kn_replay_trace *a, const kn_replay_trace *b);

// Return the index of the best reference of a run (sweep_plan.h): FINE, or SAME if the plan has no FINE.
static int best_of(const kn_sweep_run *run) { return run->fine >= 0 ? run->fine : run->same; }

// Return the index of a point on the finest lattice. If the plan has no FINE references, the point has the scene's own
// time step.
static int find_finest(const kn_sweep_plan *plan)
{
    int finest = -1;
    for (int i = 0; i < plan->count; i++) {
        const kn_sweep_run *run = &plan->run[i];
        if (run->role != KN_ROLE_POINT) continue;
        if (!plan->fine && run->dt_s != plan->scene->model.solver.dt_s) continue;
        if (finest < 0 || run->nodes > plan->run[finest].nodes) finest = i;
    }
    return finest;
}

// Return the index of the run that represents a lattice when lattices are compared. It is FINE, or SAME at the scene's
// time step if the plan has no FINE.
static int stands_for(const kn_sweep_plan *plan, const kn_sweep_run *run)
{
    if (run->fine >= 0) return run->fine;
    for (int i = 0; i < plan->count; i++) {
        const kn_sweep_run *other = &plan->run[i];
        if (other->role == KN_ROLE_SAME && other->nodes == run->nodes && other->dt_s == plan->scene->model.solver.dt_s)
            return i;
    }
    return -1;
}

// Return the errors of one point against its references. The function `distance` measures the error between two traces.
static kn_pareto_errors errors_of(const kn_sweep_plan *plan, const kn_replay_trace *traces, int point, int finest,
                                  measure distance)
{
    const kn_sweep_run *run = &plan->run[point];
    int best = best_of(run), lattice = stands_for(plan, run);
    kn_pareto_errors e = {.solver = distance(&traces[point], &traces[run->same]), .step = NAN, .lattice = NAN};
    if (run->fine >= 0) e.step = distance(&traces[run->same], &traces[run->fine]);
    if (lattice >= 0 && finest >= 0) e.lattice = lattice == finest ? 0 : distance(&traces[lattice], &traces[finest]);
    e.all = distance(&traces[point], &traces[best]) + (isfinite(e.lattice) ? e.lattice : 0);
    return e;
}

// Compute the row of one point. The forces of two lattices can be compared tick by tick, but a mesh is compared only
// with itself.
static kn_pareto_row row_of(const kn_sweep_plan *plan, const kn_replay_trace *traces, int point, int finest)
{
    const kn_sweep_run *run = &plan->run[point];
    const kn_replay_trace *t = &traces[point], *best = &traces[best_of(run)];
    double peak_n = kn_contact_force_peak(best);
    kn_pareto_row r = {.run = run, .median_us = t->median_us, .p90_us = t->p90_us};
    r.force = errors_of(plan, traces, point, finest, kn_contact_force_error);
    r.shape = errors_of(plan, traces, point, finest, kn_contact_shape_error);
    r.peak = kn_contact_force_peak(t) / peak_n - 1;
    r.lag_s = kn_contact_force_lag(t, best);
    r.depth_m = kn_contact_depth(t) - kn_contact_depth(best);
    r.jump_n = kn_contact_force_jump(t);
    r.reference_jump_n = kn_contact_force_jump(best);
    r.same_jump_n = kn_contact_force_jump(&traces[run->same]);
    r.variation = kn_contact_force_variation(t) / peak_n;
    r.reference_variation = kn_contact_force_variation(best) / peak_n;
    // Faults and chatter of the point count only if they exceed those of its reference.
    r.latched = t->faults > best->faults || t->diverged > 0;
    r.chatters = !(r.variation <= KN_PARETO_CHATTER * r.reference_variation);
    return r;
}

static bool usable(const kn_pareto_row *r) { return !r->chatters && !r->latched && isfinite(r->force.all); }

// Mark the Pareto fronts: the points for which no faster point has a smaller or equal error.
static void find_fronts(kn_pareto_front *f)
{
    for (int i = 0; i < f->count; i++) {
        kn_pareto_row *r = &f->row[i];
        r->front = r->shape_front = usable(r);
        for (int j = 0; j < f->count; j++) {
            const kn_pareto_row *o = &f->row[j];
            if (!usable(o) || o->median_us >= r->median_us) continue;
            r->front &= o->force.all > r->force.all;
            r->shape_front &= o->shape.all > r->shape.all;
        }
    }
}

// Compare two rows for sorting: by lattice, time step, precision, method, number of linearisations (passes), time.
static int order(const void *a, const void *b)
{
    const kn_pareto_row *x = a, *y = b;
    if (x->run->nodes != y->run->nodes) return x->run->nodes < y->run->nodes ? -1 : 1;
    if (x->run->dt_s != y->run->dt_s) return x->run->dt_s > y->run->dt_s ? -1 : 1;
    if (x->run->precision != y->run->precision) return x->run->precision < y->run->precision ? -1 : 1;
    if (x->run->method != y->run->method) return x->run->method < y->run->method ? -1 : 1;
    if (x->run->passes != y->run->passes) return x->run->passes < y->run->passes ? -1 : 1;
    return (x->median_us > y->median_us) - (x->median_us < y->median_us);
}

// Return false if the force of any reference is zero throughout, because the errors of its point are relative to this
// force.
bool kn_pareto_front_make(kn_pareto_front *front, const kn_sweep_plan *plan, const kn_replay_trace *traces)
{
    memset(front, 0, sizeof *front);
    int point = find_finest(plan), finest = point < 0 ? -1 : stands_for(plan, &plan->run[point]);
    if (finest >= 0) front->finest_m = plan->run[finest].spacing_m;
    for (int i = 0; i < plan->count; i++) {
        if (plan->run[i].role != KN_ROLE_POINT) continue;
        const kn_replay_trace *best = &traces[best_of(&plan->run[i])];
        if (!(kn_contact_force_peak(best) > 0)) return false;
        if (plan->run[i].own) front->peak_n = kn_contact_force_peak(best);
        front->row[front->count++] = row_of(plan, traces, i, finest);
    }
    qsort(front->row, (size_t)front->count, sizeof front->row[0], order);
    find_fronts(front);
    return true;
}

const kn_pareto_row *kn_pareto_front_pick(const kn_pareto_front *front, double budget_us)
{
    const kn_pareto_row *best = NULL;
    for (int i = 0; i < front->count; i++) {
        const kn_pareto_row *r = &front->row[i];
        if (usable(r) && r->p90_us <= budget_us && (!best || r->force.all < best->force.all)) best = r;
    }
    return best;
}

// ---- the named points

static kn_linearization linearization_of(const kn_sweep_run *run)
{
    return run->method == KN_METHOD_SECANT    ? KN_LINEARIZATION_SECANT
           : run->method == KN_METHOD_TANGENT ? KN_LINEARIZATION_TANGENT
                                              : KN_LINEARIZATION_BLEND;
}

static kn_effort effort_of(const kn_sweep_run *run)
{
    return (kn_effort){run->iterations, run->iterations_max, run->tolerance, run->passes, linearization_of(run)};
}

// Return true if a running server can switch to the settings of the point, and the time of the point is within the
// budget.
static bool is_candidate(const kn_pareto_row *r, const kn_sweep_plan *plan)
{
    const kn_scene *scene = plan->scene;
    const kn_model_def *def = &scene->model;
    const kn_sweep_run *run = r->run;
    return usable(r) && r->p90_us <= 1e6 * scene->budget_s && run->method != KN_METHOD_RK4 &&
           run->dt_s == def->solver.dt_s && run->precision == def->solver.precision &&
           (run->spacing_m == 0 || run->spacing_m == def->spacing_m);
}

// Return true if point `a` needs less work than point `b` by the count that the server uses.
static bool is_less_work(const kn_pareto_row *a, const kn_pareto_row *b)
{
    kn_effort x = effort_of(a->run), y = effort_of(b->run);
    return kn_servo_cheaper(&x, &y);
}

double kn_pareto_front_excess(const kn_pareto_row *r, kn_quality q)
{
    double force = r->force.solver / kn_pareto_front_bounds[q].force,
           shape = r->shape.solver / kn_pareto_front_bounds[q].shape;
    return fmax(fmax(force, shape), r->jump_n / (KN_PARETO_JUMP * r->same_jump_n));
}

// Return true if point `a` is preferred to point `b` when their times are equal. The criteria are, in this order: the
// smaller maximum number of iterations, the smaller usual number of iterations, the scene's own linearisation, the
// smaller error.
static bool is_simpler(const kn_pareto_row *a, const kn_pareto_row *b, const kn_sweep_plan *plan)
{
    const kn_sweep_run *x = a->run, *y = b->run;
    int most = x->passes * x->iterations_max - y->passes * y->iterations_max;
    int every = x->passes * x->iterations - y->passes * y->iterations;
    if (most != 0) return most < 0;
    if (every != 0) return every < 0;
    kn_linearization own = plan->scene->model.solver.linearization;
    bool own_a = linearization_of(x) == own, own_b = linearization_of(y) == own;
    return own_a != own_b ? own_a : a->force.solver < b->force.solver;
}

// Limits for the choice of a named point. It must need more work than `below` and have a smaller error. It must need
// less work than `above`. NULL: no limit.
typedef struct between {
    const kn_pareto_row *below, *above;
} between;

static bool is_between(const kn_pareto_row *r, const kn_sweep_plan *plan, between limits)
{
    const kn_pareto_row *b = limits.below, *a = limits.above;
    return is_candidate(r, plan) && (!b || (is_less_work(b, r) && r->force.solver < b->force.solver)) &&
           (!a || is_less_work(r, a));
}

// Return the point for one name of quality, or NULL if no candidate is within the limits.
static const kn_pareto_row *name_one(const kn_pareto_front *front, const kn_sweep_plan *plan, kn_quality q,
                                     between limits)
{
    double least_excess = INFINITY, least_us = INFINITY;
    const kn_pareto_row *named = NULL, *end = front->row + front->count;
    // 1. Find the least excess over the error bounds among all candidates.
    for (const kn_pareto_row *r = front->row; r < end; r++)
        if (is_between(r, plan, limits)) least_excess = fmin(least_excess, kn_pareto_front_excess(r, q));
    // 2. Accept the candidates within the error bounds, or those close to the least excess. Find the fastest accepted
    // candidate.
    double most_excess = fmax(1, SLACK * least_excess);
    for (const kn_pareto_row *r = front->row; r < end; r++)
        if (is_between(r, plan, limits) && kn_pareto_front_excess(r, q) <= most_excess)
            least_us = fmin(least_us, r->p90_us);
    // 3. Times up to KN_PARETO_NOISE times that of the fastest candidate count as equal. Choose the simplest candidate
    // (is_simpler) among these.
    for (const kn_pareto_row *r = front->row; r < end; r++) {
        if (!is_between(r, plan, limits) || kn_pareto_front_excess(r, q) > most_excess) continue;
        if (r->p90_us <= KN_PARETO_NOISE * least_us && (!named || is_simpler(r, named, plan))) named = r;
    }
    return named;
}

static bool meets(const kn_pareto_row *r, kn_quality q) { return r && kn_pareto_front_excess(r, q) <= 1; }

void kn_pareto_front_name(const kn_pareto_front *front, const kn_sweep_plan *plan,
                          const kn_pareto_row *named[KN_QUALITY_OWN])
{
    // Choose accurate first, because the other names must need less work than accurate.
    const kn_pareto_row *accurate = name_one(front, plan, KN_QUALITY_ACCURATE, (between){NULL, NULL});
    const kn_pareto_row *fast = name_one(front, plan, KN_QUALITY_FAST, (between){NULL, accurate});
    // Never give a worse point than necessary: fall back to accurate if fast misses bounds that accurate meets.
    if (!fast || (meets(accurate, KN_QUALITY_FAST) && !meets(fast, KN_QUALITY_FAST))) fast = accurate;
    const kn_pareto_row *balanced = name_one(front, plan, KN_QUALITY_BALANCED, (between){fast, accurate});
    // If balanced misses its own bounds, fall back to fast or accurate.
    if (!meets(balanced, KN_QUALITY_BALANCED)) balanced = meets(fast, KN_QUALITY_BALANCED) ? fast : accurate;
    named[KN_QUALITY_FAST] = fast;
    named[KN_QUALITY_BALANCED] = balanced;
    named[KN_QUALITY_ACCURATE] = accurate;
}

const kn_pareto_row *kn_pareto_front_elsewhere(const kn_pareto_front *front, const kn_sweep_plan *plan,
                                               const kn_pareto_row *const named[KN_QUALITY_OWN])
{
    // Return the point only if its error is smaller than the errors of all named points.
    const kn_pareto_row *r = kn_pareto_front_pick(front, 1e6 * plan->scene->budget_s);
    if (!r || is_candidate(r, plan)) return NULL;
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++)
        if (named[q] && named[q]->force.all <= r->force.all) return NULL;
    return r;
}

// ---- CSV

// Numbers of a row: their names, and their places in kn_pareto_row.
#define NUMBER(name, member)                                                                                           \
    {                                                                                                                  \
        name, offsetof(kn_pareto_row, member)                                                                          \
    }
static const struct {
    const char *name;
    size_t place;
} numbers[] = {NUMBER("median_us", median_us),
               NUMBER("p90_us", p90_us),
               NUMBER("force_solver", force.solver),
               NUMBER("force_step", force.step),
               NUMBER("force_lattice", force.lattice),
               NUMBER("force_all", force.all),
               NUMBER("shape_solver", shape.solver),
               NUMBER("shape_step", shape.step),
               NUMBER("shape_lattice", shape.lattice),
               NUMBER("shape_all", shape.all),
               NUMBER("peak", peak),
               NUMBER("lag_s", lag_s),
               NUMBER("depth_m", depth_m),
               NUMBER("jump_n_per_ms", jump_n),
               NUMBER("reference_jump_n_per_ms", reference_jump_n),
               NUMBER("variation_peaks", variation),
               NUMBER("reference_variation_peaks", reference_variation)};
enum { NUMBERS = sizeof numbers / sizeof *numbers };

static double number_of(const kn_pareto_row *r, int k) { return *(const double *)((const char *)r + numbers[k].place); }

void kn_pareto_front_csv(const kn_pareto_front *front, FILE *f)
{
    fprintf(f, "spacing_m,nodes,backend,dt_s,solver,precision,iterations,iterations_max,tolerance,passes,own");
    for (int k = 0; k < NUMBERS; k++) fprintf(f, ",%s", numbers[k].name);
    fprintf(f, ",chatters,latched,force_front,shape_front\n");
    for (int i = 0; i < front->count; i++) {
        const kn_pareto_row *r = &front->row[i];
        const kn_sweep_run *run = r->run;
        fprintf(f, "%.9g,%d,cpu,%.9g,%s,%s,%d,%d,%.9g,%d,%d", run->spacing_m, run->nodes, run->dt_s,
                kn_method_name(run->method), run->precision == KN_PRECISION_F64 ? "f64" : "f32", run->iterations,
                run->iterations_max, run->tolerance, run->passes, run->own);
        for (int k = 0; k < NUMBERS; k++) {
            if (isfinite(number_of(r, k))) fprintf(f, ",%.6g", number_of(r, k));
            else fputc(',', f); // the field stays empty if the number was not measured
        }
        fprintf(f, ",%d,%d,%d,%d\n", r->chatters, r->latched, r->front, r->shape_front);
    }
}

void kn_pareto_front_result(const kn_pareto_front *front)
{
    for (int i = 0; i < front->count; i++) {
        const kn_pareto_row *r = &front->row[i];
        const kn_sweep_run *run = r->run;
        json_t *to = kn_result_add("points");
        char name[96];
        kn_result_text(to, "name", kn_sweep_run_name(run, name));
        kn_result_number(to, "spacing_m", run->spacing_m);
        kn_result_integer(to, "nodes", run->nodes);
        kn_result_number(to, "dt_s", run->dt_s);
        kn_result_text(to, "solver", kn_method_name(run->method));
        kn_result_text(to, "precision", run->precision == KN_PRECISION_F64 ? "f64" : "f32");
        kn_result_integer(to, "iterations", run->iterations);
        kn_result_integer(to, "iterations_max", run->iterations_max);
        kn_result_number(to, "tolerance", run->tolerance);
        kn_result_integer(to, "passes", run->passes);
        kn_result_bool(to, "own", run->own);
        for (int k = 0; k < NUMBERS; k++) kn_result_number(to, numbers[k].name, number_of(r, k));
        kn_result_bool(to, "chatters", r->chatters);
        kn_result_bool(to, "latched", r->latched);
        kn_result_bool(to, "force_front", r->front);
        kn_result_bool(to, "shape_front", r->shape_front);
    }
}
