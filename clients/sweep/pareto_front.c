#include "clients/sweep/pareto_front.h"
#include "clients/cli/plot.h"
#include "clients/cli/result.h"
#include "server/servo.h"
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

// If no point is within the bounds of a name, accept the points whose excess (kn_pareto_front_excess) is at most this
// factor times the least excess.
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

// Compute the row of one point. The forces on two lattices can be compared tick by tick. A mesh can be compared only
// with the same mesh.
static kn_pareto_row row_of(const kn_sweep_plan *plan, const kn_replay_trace *traces, int point, int finest)
{
    const kn_sweep_run *run = &plan->run[point];
    const kn_replay_trace *t = &traces[point], *best = &traces[best_of(run)];
    double peak_n = kn_contact_force_peak(best);
    kn_pareto_row r = {.run = run, .median_us = t->median_us, .p90_us = t->p90_us};
    r.force = errors_of(plan, traces, point, finest, kn_contact_force_error);
    r.shape = errors_of(plan, traces, point, finest, kn_contact_shape_error);
    r.factor = r.factor_left = NAN;
    const int lattice = stands_for(plan, run);
    if (lattice >= 0 && finest >= 0 && lattice != finest)
        r.factor = run->force_factor * kn_contact_force_factor(&traces[lattice], &traces[finest], &r.factor_left);
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

// Return false if the force of any reference is zero throughout, because errors are relative to the force of the
// reference.
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

// Return true if point `a` needs less work than point `b`, as the server compares them (kn_servo_cheaper).
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

// Limits for the choice of a named point. The chosen point must need more work than the point `below` and have a
// smaller error. It must need less work than the point `above`. NULL: no limit.
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
    // If the point `balanced` misses its own bounds, take `fast` if it meets them; otherwise take `accurate`.
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

// Numeric columns of the CSV file: name, and offset of the value in kn_pareto_row.
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
               NUMBER("force_factor", factor),
               NUMBER("force_factor_left", factor_left),
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

// ---- the table

static void print_head(void)
{
    printf("%69s | %-20s| %-13s| %s\n", "us of a tick", "force: error, %", "shape", "effects a hand notices");
    printf("%-8s %8s %-7s %3s  %-18s %-3s %8s %6s | %6s %5s %6s | %6s %5s | %6s %6s %6s %5s %6s\n", "lattice", "step",
           "solver", "", "CG iterations", "on", "p50", "p90", "solver", "step", "all", "solver", "all", "peak %",
           "lag ms", "mm deep", "N/ms", "TV/pk");
}

// Print a share (0 to 1) as a percentage, or "-" if the share is unknown.
static void put_percent(double share, int width, int digits)
{
    if (isfinite(share)) printf(" %*.*f", width, digits, 100 * share);
    else printf(" %*s", width, "-");
}

// Write the name of a lattice, which is its node spacing. A mesh has no spacing.
static const char *lattice_of(const kn_sweep_run *run, char text[16])
{
    if (run->spacing_m > 0) snprintf(text, 16, "%.4g mm", 1e3 * run->spacing_m);
    else snprintf(text, 16, "mesh");
    return text;
}

static void print_row(const kn_pareto_row *r, const kn_pareto_row *const named[KN_QUALITY_OWN])
{
    char lattice[16], effort[64];
    const kn_sweep_run *run = r->run;
    printf("%-8s %5.4g ms %-7s %s  %-18s cpu %8.1f %6.1f |", lattice_of(run, lattice), 1e3 * run->dt_s,
           kn_method_name(run->method), run->precision == KN_PRECISION_F64 ? "f64" : "f32",
           kn_sweep_run_effort(run, effort), r->median_us, r->p90_us);
    put_percent(r->force.solver, 6, 3);
    put_percent(r->force.step, 5, 2);
    put_percent(r->force.all, 6, 2);
    putchar(r->front ? '*' : ' ');
    printf("|");
    put_percent(r->shape.solver, 6, 3);
    put_percent(r->shape.all, 5, 2);
    printf("%c|", r->shape_front ? '*' : ' ');
    printf(" %+6.2f", 100 * r->peak);
    if (isfinite(r->lag_s)) printf(" %+6.2f", 1e3 * r->lag_s);
    else printf(" %6s", "-");
    printf(" %+6.3f %5.2f %6.2f", 1e3 * r->depth_m, r->jump_n, r->variation);
    if (r->chatters) printf("  chatters");
    if (r->latched) printf("  latched");
    if (run->own) printf("  scene");
    // Print the names of quality that this point was given: fast, balanced, accurate.
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++)
        if (named[q] == r) printf("  %s", kn_quality_name(q));
    putchar('\n');
}

// Print the heading above the table rows of one lattice.
static void print_lattice(const kn_pareto_front *front, const kn_pareto_row *r)
{
    char lattice[16];
    printf("-- %s, %d nodes: the converged force jumps by %.2f N/ms, TV/pk %.2f", lattice_of(r->run, lattice),
           r->run->nodes, r->reference_jump_n, r->reference_variation);
    // The finest lattice and a mesh have no measured lattice error.
    if (r->run->spacing_m == 0) puts("; the error against a finer mesh is not known");
    else if (r->force.lattice == 0) puts("; the finest lattice of this sweep");
    else
        printf("; force %.2f %%, shape %.2f %% off the lattice of %.4g mm; object.force_factor: %.3f leaves %.2f %% of "
               "the "
               "force\n",
               100 * r->force.lattice, 100 * r->shape.lattice, 1e3 * front->finest_m, r->factor, 100 * r->factor_left);
}

void kn_pareto_chart_print(const kn_pareto_front *front, const kn_sweep_plan *plan,
                           const kn_pareto_row *const named[KN_QUALITY_OWN])
{
    print_head();
    for (int i = 0; i < front->count; i++) {
        // The rows are sorted by lattice, so a row with another number of nodes begins a new lattice.
        const kn_pareto_row *r = &front->row[i];
        if (i == 0 || r->run->nodes != r[-1].run->nodes) print_lattice(front, r);
        print_row(r, named);
    }
    printf("solver: against f64, same step, secant, 5 linearisations, CG to 1e-8; ");
    if (plan->fine) puts("step: f64 at the same step against f64 at 1/16 of the scene's step;");
    else puts("step: not measured (--quick);");
    puts("all: error against f64 at 1/16 of the scene's step, plus the error of the lattice. "
         "*: no cheaper point is more accurate. The other columns: effects a hand notices.");
    for (int i = 0; i < plan->notes; i++) puts(plan->note[i]);
}

// ---- the picture

// Largest number of lattices that are drawn in a colour of their own.
enum { LATTICES = 6 };

typedef struct marker { // plot symbol of a point, which depends on solver and precision
    int type;
    const char *name;
} marker;

static const marker markers[] = {{7, "blend"}, {9, "secant"}, {11, "tangent"},
                                 {15, "rk4"},  {5, "f64"},    {13, "smaller step"}};
enum { MARKERS = sizeof markers / sizeof *markers };

// Return the index of the plot symbol of a point in the list of markers. The first three markers have the order of
// kn_method.
static int marker_of(const kn_pareto_row *r, const kn_sweep_plan *plan)
{
    if (r->run->method == KN_METHOD_RK4) return 3;
    if (r->run->dt_s < plan->scene->model.solver.dt_s) return 5;
    if (r->run->precision == KN_PRECISION_F64) return 4;
    return (int)r->run->method;
}

static bool is_sound(const kn_pareto_row *r) { return !r->chatters && !r->latched; }

// One panel of the picture. A panel shows either the shape error or the force error, and either the total error or the
// part due to the solver. The named points may be marked.
typedef struct panel {
    const char *title;
    bool shape, all, named;
} panel;

static const panel panels[] = {{"contact force: error of the solver", .named = true},
                               {"residual shape: error of the solver", .shape = true, .named = true},
                               {"contact force: error of solver, step and lattice", .all = true}};
enum { PANELS = sizeof panels / sizeof *panels };

typedef struct picture {
    const kn_pareto_front *front;
    const kn_sweep_plan *plan;
    const kn_pareto_row *const *named;
    int lattices, nodes[LATTICES];
    bool used[LATTICES][MARKERS], any_bad;
} picture;

// Return the error of a point that the panel shows on its vertical axis, %.
static double height(const panel *p, const kn_pareto_row *r)
{
    const kn_pareto_errors *e = p->shape ? &r->shape : &r->force;
    return 100 * (p->all ? e->all : e->solver);
}

// Return the index of a point's lattice among the lattices of the picture. The last index stands for all lattices
// beyond the number of colours.
static int lattice_number(const picture *pic, const kn_pareto_row *r)
{
    int l = 0;
    while (l < pic->lattices - 1 && pic->nodes[l] != r->run->nodes) l++;
    return l;
}

// Write a Pareto front as a staircase from left to right: the front of one lattice, or of all lattices if `lattice` <
// 0.
static void write_front(FILE *f, const picture *pic, int panel_number, int lattice)
{
    const panel *p = &panels[panel_number];
    fprintf(f, "$front%d_%d << END\n", panel_number, lattice + 1);
    for (double us = -1, least = INFINITY;;) {
        // Find the next corner of the staircase: the fastest usable point that is slower than the last corner and has a
        // smaller error.
        const kn_pareto_row *next = NULL;
        for (int i = 0; i < pic->front->count; i++) {
            const kn_pareto_row *r = &pic->front->row[i];
            if ((lattice >= 0 && r->run->nodes != pic->nodes[lattice]) || !is_sound(r)) continue;
            if (r->median_us <= us || !(height(p, r) < least)) continue;
            if (!next || r->median_us < next->median_us) next = r;
        }
        if (!next) break;
        us = next->median_us;
        least = height(p, next);
        fprintf(f, "%.6g %.6g\n", us, least);
    }
    fprintf(f, "END\n");
}

// Write one line of data per point. The columns are: median time per tick in us, error in %, index of the lattice,
// index of the marker, 1 if the point chatters or is latched and 0 otherwise, 90th percentile (p90) of the time in us.
static void write_points(FILE *f, const picture *pic, int panel_number)
{
    fprintf(f, "$points%d << END\n", panel_number);
    for (int i = 0; i < pic->front->count; i++) {
        const kn_pareto_row *r = &pic->front->row[i];
        fprintf(f, "%.6g %.6g %d %d %d %.6g\n", r->median_us, height(&panels[panel_number], r), lattice_number(pic, r),
                marker_of(r, pic->plan), !is_sound(r), r->p90_us);
    }
    fprintf(f, "END\n");
}

// Set the ranges of the logarithmic axes with a small margin, and axis ticks at round numbers.
static void write_ranges(FILE *f, const picture *pic, const panel *p)
{
    double us[2] = {INFINITY, 0}, error[2] = {INFINITY, 0};
    for (int i = 0; i < pic->front->count; i++) {
        const kn_pareto_row *r = &pic->front->row[i];
        us[0] = fmin(us[0], r->median_us), us[1] = fmax(us[1], r->p90_us);
        if (height(p, r) > 0) error[0] = fmin(error[0], height(p, r)), error[1] = fmax(error[1], height(p, r));
    }
    fprintf(f, "set xrange [%g:%g]\nset yrange [%g:%g]\nset xtics (1", us[0] / 1.5, us[1] * 1.2, error[0] / 1.8,
            error[1] * 1.5);
    for (double ten = 1; ten < 1e5; ten *= 10) fprintf(f, ", %g, %g, %g", 2 * ten, 5 * ten, 10 * ten);
    fprintf(f, ")\nset ytics (0.001");
    for (double ten = 0.001; ten < 100; ten *= 10) fprintf(f, ", %g, %g, %g", 2 * ten, 5 * ten, 10 * ten);
    fprintf(f, ")\n");
}

// Draw a ring around each named point (fast, balanced, accurate) and write the names beside the ring.
static void write_names(FILE *f, const picture *pic, const panel *p)
{
    static const char *const place[KN_QUALITY_OWN] = {"right offset -1.4,-0.6", "center offset 0,-1.3",
                                                      "center offset 0,1.3"};
    for (kn_quality q = 0; q < KN_QUALITY_OWN; q++) {
        const kn_pareto_row *r = pic->named[q];
        char words[64] = "";
        // Skip this name if the same point was already marked for the previous name.
        if (!r || !p->named || (q > 0 && r == pic->named[q - 1])) continue;
        // One point may have several names, so collect all its names in one label.
        for (kn_quality same = q; same < KN_QUALITY_OWN && pic->named[same] == r; same++)
            snprintf(words + strlen(words), sizeof words - strlen(words), "%s%s", same > q ? ", " : "",
                     kn_quality_name(same));
        // The panel of the shape error shows rings without names, because the panel of the force error has the names.
        if (p->shape) words[0] = '\0';
        fprintf(f, "set label %d '%s' at %g,%g %s point pt 6 ps 2.2 lw 2 lc rgb 'black' front\n", (int)q + 1, words,
                r->median_us, height(p, r), strchr(words, ',') ? "left offset -0.8,-1.4" : place[q]);
    }
}

static void write_panel(FILE *f, const picture *pic, int number)
{
    const panel *p = &panels[number];
    fprintf(f, "unset label\nset title '%s' offset 0,-0.4\nset ylabel '%s' offset 0.8,0\n", p->title,
            number == 0 ? "error, %, relative L2" : "");
    fprintf(f, "set origin %g,0.19\nset size %g,0.74\n", (double)number / PANELS, 1.0 / PANELS);
    write_ranges(f, pic, p);
    write_names(f, pic, p);
    fprintf(f, "plot ");
    // Draw the Pareto fronts: one of all lattices, or one for each lattice.
    for (int l = p->all ? -1 : 0; l < (p->all ? 0 : pic->lattices); l++)
        fprintf(f, "$front%d_%d using 1:2 with steps lw 2.5 lc rgb '#90%s' notitle, ", number, l + 1,
                l < 0 ? "000000" : kn_plot_colour[l]);
    // Draw a thin line from each point's median to its p90.
    for (int l = 0; l < pic->lattices && !p->all; l++)
        fprintf(f,
                "$points%d using ($3==%d ? $1 : NaN):2:($6-$1):(0) with vectors nohead lw 1.2 lc rgb '#b0%s' "
                "notitle, ",
                number, l, kn_plot_colour[l]);
    // Draw the points, with one plot for each lattice and marker that occur together.
    for (int l = 0; l < pic->lattices; l++)
        for (int m = 0; m < MARKERS; m++)
            if (pic->used[l][m])
                fprintf(f,
                        "$points%d using ($3==%d && $4==%d ? $1 : NaN):2 with points pt %d ps 1.2 "
                        "lc rgb '#%s' notitle, ",
                        number, l, m, markers[m].type, kn_plot_colour[l]);
    // Draw a red cross on each point that chatters or is latched.
    if (pic->any_bad)
        fprintf(f, "$points%d using ($5==1 ? $1 : NaN):2 with points pt 2 ps 1.8 lw 2 lc rgb '#cc0000' notitle, ",
                number);
    fprintf(f, "NaN notitle\n");
}

// Write the legend below the panels, as the key of a plot without axes.
static void write_legend(FILE *f, const picture *pic)
{
    fprintf(f, "unset title\nunset xlabel\nunset ylabel\nunset border\nunset tics\nunset grid\nunset logscale\n"
               "unset label\nset key at screen 0.5,0.01 center bottom font 'sans,10' maxrows 3 Left reverse\n"
               "set key samplen 1.5 width 1 "
               "spacing 1.3\nset origin 0,0\nset size 1,0.19\nset xrange [0:1]\nset yrange [0:1]\nplot ");
    for (int l = 0; l < pic->lattices; l++) {
        const kn_pareto_row *r = pic->front->row;
        char text[100] = "", off[48] = "";
        // Find any point of this lattice. All points of one lattice have the same spacing and lattice error.
        while (r->run->nodes != pic->nodes[l]) r++;
        if (r->run->spacing_m > 0) snprintf(text, sizeof text, "%.3g mm, ", 1e3 * r->run->spacing_m);
        if (r->force.lattice > 0)
            snprintf(off, sizeof off, ": force %.1f %% from %.3g mm", 100 * r->force.lattice,
                     1e3 * pic->front->finest_m);
        fprintf(f, "NaN with lines lw 5 lc rgb '#%s' title '%s%d nodes%s', ", kn_plot_colour[l], text, pic->nodes[l],
                off);
    }
    for (int m = 0; m < MARKERS; m++) {
        bool any = false;
        for (int l = 0; l < pic->lattices; l++) any |= pic->used[l][m];
        if (any)
            fprintf(f, "NaN with points pt %d ps 1.3 lc rgb '#555555' title '%s', ", markers[m].type, markers[m].name);
    }
    fprintf(f, "NaN with lines lw 1.2 lc rgb '#999999' title 'from median to p90', ");
    if (pic->any_bad) fprintf(f, "NaN with points pt 2 ps 1.6 lw 2 lc rgb '#cc0000' title 'chatters or latched', ");
    fprintf(f, "NaN notitle\n");
}

static void write_script(FILE *f, const picture *pic)
{
    char title[200];
    // Write the data blocks first, because the plot commands that follow refer to them.
    for (int p = 0; p < PANELS; p++) {
        for (int l = -1; l < pic->lattices; l++) write_front(f, pic, p, l);
        write_points(f, pic, p);
    }
    snprintf(title, sizeof title, "%s: processor time of a tick against its error, one core", pic->plan->scene->name);
    kn_plot_panels(f, title);
    fprintf(f, "set logscale xy\n"
               "set lmargin 9\nset rmargin 1.8\nset xlabel 'median of a 1 ms tick under the tool, µs' offset 0,0.4\n");
    for (int p = 0; p < PANELS; p++) write_panel(f, pic, p);
    write_legend(f, pic);
    fprintf(f, "unset multiplot\n");
}

int kn_pareto_chart_draw(const kn_pareto_front *front, const kn_sweep_plan *plan,
                         const kn_pareto_row *const named[KN_QUALITY_OWN], const char *path)
{
    int code;
    picture pic = {.front = front, .plan = plan, .named = named};
    // Collect the lattices and the markers that occur among the points.
    for (int i = 0; i < front->count; i++) {
        const kn_pareto_row *r = &front->row[i];
        bool begins = i == 0 || r->run->nodes != r[-1].run->nodes;
        if (begins && pic.lattices < LATTICES) pic.nodes[pic.lattices++] = r->run->nodes;
        pic.used[lattice_number(&pic, r)][marker_of(r, plan)] = true;
        pic.any_bad |= !is_sound(r);
    }
    FILE *f = kn_plot_open("tradeoff", path, 1280, 560, &code);
    if (!f) return code;
    write_script(f, &pic);
    return kn_plot_close(f, "tradeoff", path);
}
