#include "clients/sweep/stability_trial.h"
#include "clients/hand/tool_height.h"
#include "core/solve/kernel.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ERROR_MAX                                                                                                      \
    0.05 // bound of the force error and the shape error, smaller than a hand can feel; see stability_trial.h
#define ERROR_MOST 0.07 // largest bound of the errors if the time-step error is above ERROR_MAX
// Bounds of two verdicts, as multiples of the value of the reference. VARIATION_MAX: a result with a larger total
// variation is chattering. BLOWN_UP: a result with a larger force has diverged.
#define VARIATION_MAX 1.5
#define BLOWN_UP 100.0
#define SPEED_MAX 0.03 // largest speed of the hand, m/s
#define DEVICE_S 1e-3  // time between two forces that a device receives, s
// Largest number of linearisations that the reference may take in a time step. A step that takes all of them has missed
// its tolerance.
#define REFERENCE_PASSES 100

const char *const kn_way_name[KN_WAYS] = {"default", "secant", "tangent", "f64", "rk4"};
const char *const kn_judgement_name[KN_JUDGEMENTS] = {"right", "refused", "chattering", "wrong", "diverged", "died"};

typedef struct trace { // forces and shapes of one run
    int steps, nodes;
    double (*way)[3];      // for each step: force on the probe, or, without a probe, mean displacement of the top
    double (*shape[2])[3]; // for each node: displacement at the end of the pressing, and at the end of the trial
    bool refused, diverged, loose;
    char reason[120];
} trace;

static void trace_free(trace *t)
{
    free(t->way);
    free(t->shape[0]);
    free(t->shape[1]);
}

// --- the hand -------------------------------------------------------------------------------------------------------

#define DOWN 0.4   // fraction of the trial's time after which the tool is at its depth
#define STAY 0.6   // fraction of the trial's time after which the tool moves up again
#define LOADED 0.5 // fraction of the trial's time during which the load acts

// Return a value that rises smoothly from 0 to 1, as half a period of a cosine.
static double smooth(double s) { return s <= 0 ? 0 : s >= 1 ? 1 : 0.5 - 0.5 * cos(acos(-1.0) * s); }

static double length_s(const kn_stability_trial *t) { return t->steps * t->def.solver.dt_s; }

// Return the depth of the tool's foot below the top at a time, m.
static double depth_at(const kn_stability_trial *t, double time_s)
{
    // The peak speed of the half cosine is pi/2 times its mean speed, so the speed limit bounds the depth.
    double whole = length_s(t), fastest = SPEED_MAX * DOWN * whole * 2 / acos(-1.0);
    double depth = fmin(t->depth_m, fastest), above = 0;
    return -above + (depth + above) * (smooth(time_s / (DOWN * whole)) - smooth((time_s / whole - STAY) / (1 - STAY)));
}

// Return the input of a step that ends at time_s.
static kn_input input_at(const kn_stability_trial *t, const kn_model *m, double time_s, double dt)
{
    kn_input in = {0};
    double whole = length_s(t), rest[3] = {1, 1, 1};
    // The load acts in all steps up to half of the run. Half a step is added to the bound, so that rounding does not
    // remove the load from the last of these steps.
    if (t->hand == KN_STABILITY_TRIAL_HAND_LOAD && time_s < LOADED * whole + 0.5 * dt) {
        kn_model_def_extent(&t->def, rest);
        // Choose the load that strains the material, from rest, to the wanted strain within the time of the load.
        double compliance = kn_material_compliance(&t->def.material, LOADED * whole);
        // The load acts on the cross section of one cell if there is a single column of nodes, otherwise on the whole
        // top.
        double across = t->def.spacing_m * t->def.spacing_m;
        if (t->def.mesh || t->def.nodes[0] > 1) across = rest[0] * rest[1];
        in.top_load_n = t->strain * across / compliance;
    }
    if (t->def.probe_count == 0) return in;
    // Set the tool's position at the beginning of the step, and its mean velocity over the step.
    double depth = depth_at(t, time_s - dt), next = depth_at(t, time_s);
    const kn_probe_def *probe = &m->def.probe[0];
    in.probe[0].attached = true;
    in.probe[0].position_m[2] = m->rest_m[m->top[0]][2] + kn_tool_height_m(probe) - depth;
    in.probe[0].velocity_m_s[2] = (depth - next) / dt;
    // Never go straight down: on a symmetric path rounding alone would decide to which side a soft block buckles.
    static const double aside[2] = {0.05, 0.03};
    for (int k = 0; k < 2; k++) {
        in.probe[0].position_m[k] = aside[k] * depth;
        in.probe[0].velocity_m_s[k] = aside[k] * (next - depth) / dt;
    }
    // The jump lasts three time steps of the trial. In a run with shorter time steps the jump lasts for the same time.
    double at = (time_s - 0.5 * dt) / t->def.solver.dt_s - floor(0.25 * t->steps);
    if (t->hand == KN_STABILITY_TRIAL_HAND_JUMP && at > 0 && at < 3)
        for (int k = 0; k < 3; k++) in.probe[0].position_m[k] += t->jump_m[k];
    return in;
}

// --- a run ----------------------------------------------------------------------------------------------------------

static void displacement(const kn_model *m, const kn_state *s, int node, double u[3])
{
    kn_state_position(m, s, node, u);
    for (int k = 0; k < 3; k++) u[k] -= m->rest_m[node][k];
}

// Move the upper nodes down until the height of the topmost cells is `squeezed` times its rest height.
static void squeeze(const kn_stability_trial *t, const kn_model *m, kn_state *s)
{
    double high = 0;
    for (int i = 0; i < m->node_count; i++) high = fmax(high, m->rest_m[i][2]);
    double middle = high - m->def.spacing_m;
    for (int i = 0; i < m->node_count; i++) {
        double above = m->rest_m[i][2] - middle;
        if (above > 0) kn_real_set(m, s->displacement, m->offset[i] + 2 * m->stride, above * (t->squeezed - 1));
    }
}

// Add the sample of a step: the force on the probes, or, without a probe, the mean displacement of the top.
static void read_sample(const kn_model *m, const kn_state *s, const kn_output *out, double sample[3])
{
    for (int p = 0; p < m->def.probe_count; p++)
        for (int k = 0; k < 3; k++) sample[k] += out->probe[p].force_n[k];
    for (int i = 0; i < m->top_count && m->def.probe_count == 0; i++) {
        double u[3];
        displacement(m, s, m->top[i], u);
        for (int k = 0; k < 3; k++) sample[k] += u[k] / m->top_count;
    }
}

// Return true if all displacements are finite.
static bool finite_shape(const trace *t, int which)
{
    double sum = 0;
    for (int i = 0; i < t->nodes; i++)
        for (int k = 0; k < 3; k++) sum += t->shape[which][i][k];
    return isfinite(sum);
}

// Step through the trial and record it. substeps: steps of the solver in one step of the trial.
static void follow(const kn_stability_trial *t, const kn_model *m, kn_state *s, kn_scratch *scratch, int substeps,
                   trace *out)
{
    double dt = m->def.solver.dt_s;
    if (t->squeezed != 1) squeeze(t, m, s);
    for (int i = 0; i < t->steps && !out->diverged; i++) {
        for (int k = 0; k < substeps; k++) {
            kn_input in = input_at(t, m, (i * substeps + k + 1) * dt, dt);
            kn_output now;
            out->diverged |= kn_step(m, s, scratch, &in, &now) != KN_OK;
            out->loose |= now.passes == REFERENCE_PASSES;
            // Average the forces over the substeps, but take the displacement of the top from the last substep.
            if (m->def.probe_count > 0 || k == substeps - 1) read_sample(m, s, &now, out->way[i]);
        }
        for (int k = 0; k < 3 && m->def.probe_count > 0; k++) out->way[i][k] /= substeps;
        // Record the shape at the end of the pressing (or of the load), and at the end of the trial.
        int which = i + 1 == t->steps ? 1 : 0;
        if (which || i + 1 == (int)((t->hand == KN_STABILITY_TRIAL_HAND_LOAD ? LOADED : STAY) * t->steps))
            for (int n = 0; n < m->node_count; n++) displacement(m, s, n, out->shape[which][n]);
    }
    out->diverged |= !finite_shape(out, 0) || !finite_shape(out, 1);
}

// Average the forces over a millisecond, because a device receives one force per millisecond. The window is at most an
// eighth of the trial. Without averaging, a light node could bounce between plate and block a hundred times per window.
static void average(const kn_stability_trial *t, trace *x)
{
    int window = (int)fmin(ceil(DEVICE_S / t->def.solver.dt_s - 1e-9), t->steps / 8.0);
    // Go from the last step backwards, because each average still needs the unaveraged samples before it.
    for (int i = t->steps - 1; i > 0; i--) {
        int count = window < i + 1 ? window : i + 1;
        for (int k = 0; k < 3; k++) {
            double sum = 0;
            for (int n = 0; n < count; n++) sum += x->way[i - n][k];
            x->way[i][k] = sum / count;
        }
    }
}

// Run a trial with the given solver settings. A refused model is a valid result. Return false when memory is short.
static bool run(const kn_stability_trial *t, const kn_model_def *def, int substeps, trace *out)
{
    *out = (trace){.steps = t->steps};
    char why[256] = "";
    if (def->mesh && !kn_simplices_check(def->mesh, why, sizeof why)) {
        snprintf(out->reason, sizeof out->reason, "%.119s", why);
        out->refused = true;
        return true;
    }
    kn_model *m = kn_model_build(def, why, sizeof why);
    if (!m) {
        snprintf(out->reason, sizeof out->reason, "%.119s", why);
        out->refused = true;
        return true;
    }
    kn_state *s = kn_state_create(m);
    kn_scratch *scratch = kn_scratch_create(m);
    out->nodes = m->node_count;
    out->way = calloc((size_t)t->steps, sizeof *out->way);
    for (int i = 0; i < 2; i++) out->shape[i] = calloc((size_t)m->node_count, sizeof *out->shape[i]);
    bool ok = s && scratch && out->way && out->shape[0] && out->shape[1];
    if (ok) follow(t, m, s, scratch, substeps, out);
    if (ok) average(t, out);
    kn_state_destroy(s);
    kn_scratch_destroy(scratch);
    kn_model_destroy(m);
    return ok;
}

// --- the ways -------------------------------------------------------------------------------------------------------

// Return the settings of the reference, with the time step divided by `substeps`. The finer reference (substeps > 1) is
// used only to estimate the time-step error, so a tolerance of 1e-4 is enough for it.
static kn_model_def reference_def(const kn_stability_trial *t, int substeps)
{
    kn_model_def def = t->def;
    kn_solver_def *s = &def.solver;
    s->precision = KN_PRECISION_F64;
    s->linearization = KN_LINEARIZATION_BLEND;
    s->dt_s /= substeps;
    s->passes = REFERENCE_PASSES;
    s->iterations_max = 2000;
    s->tolerance = substeps > 1 ? 1e-4 : 1e-7;
    return def;
}

// Return the settings of one way of solving a trial.
static kn_model_def way_def(const kn_stability_trial *t, kn_way way)
{
    kn_model_def def = t->def;
    kn_solver_def *s = &def.solver;
    if (way == KN_WAY_SECANT) s->linearization = KN_LINEARIZATION_SECANT;
    if (way == KN_WAY_TANGENT) s->linearization = KN_LINEARIZATION_TANGENT;
    if (way == KN_WAY_F64) s->precision = KN_PRECISION_F64;
    if (way == KN_WAY_RK4) {
        s->kind = KN_SOLVER_RK4;
        s->precision = KN_PRECISION_F64;
    }
    return def;
}

// --- judging --------------------------------------------------------------------------------------------------------

// Return the Euclidean norm of a - b over n rows. If b is NULL, return the norm of a.
static double norm2(const double (*a)[3], const double (*b)[3], int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 3; k++) {
            double d = a[i][k] - (b ? b[i][k] : 0);
            sum += d * d;
        }
    return sqrt(sum);
}

#define ROWS(x) ((const double(*)[3])(x))

// Return part / whole. Return 0 if both are 0.
static double share(double part, double whole) { return part == 0 ? 0 : part / whole; }

static double way_error(const trace *a, const trace *b)
{
    return share(norm2(ROWS(a->way), ROWS(b->way), b->steps), norm2(ROWS(b->way), NULL, b->steps));
}

static double shape_error(const trace *a, const trace *b)
{
    double error = 0, whole = 0;
    for (int i = 0; i < 2; i++) {
        error = fmax(error, norm2(ROWS(a->shape[i]), ROWS(b->shape[i]), b->nodes));
        whole = fmax(whole, norm2(ROWS(b->shape[i]), NULL, b->nodes));
    }
    return share(error, whole);
}

// Return the largest magnitude of the forces in a trace.
static double peak(const trace *t)
{
    double most = 0;
    for (int i = 0; i < t->steps; i++) most = fmax(most, norm2(ROWS(&t->way[i]), NULL, 1));
    return most;
}

// Return the total variation of the forces divided by their peak. The force before the first step counts as 0.
static double variation(const trace *t)
{
    double sum = 0, zero[3] = {0};
    const double *before = zero;
    for (int i = 0; i < t->steps; i++) {
        sum += norm2(ROWS(&t->way[i]), ROWS(before), 1);
        before = t->way[i];
    }
    return share(sum, peak(t));
}

// Judge the run x by comparison with the reference. finer: the reference with half the time step.
static kn_score judge(const trace *x, const trace *ref, const trace *finer, double bound)
{
    kn_score s = {.verdict = KN_STABILITY_TRIAL_REFUSED};
    snprintf(s.reason, sizeof s.reason, "%s", x->refused ? x->reason : ref->reason);
    if (x->refused || ref->refused || finer->refused) return s; // without a reference nothing can be judged
    s.verdict = KN_STABILITY_TRIAL_DIVERGED;
    if (x->diverged || !(peak(x) <= BLOWN_UP * peak(ref))) return s;
    s.force = way_error(x, ref);
    s.shape = shape_error(x, ref);
    double calm = fmin(variation(ref), variation(finer));
    s.variation = share(variation(x), calm);
    if (s.variation > VARIATION_MAX) s.verdict = KN_STABILITY_TRIAL_CHATTERING;
    else s.verdict = s.force <= bound && s.shape <= bound ? KN_STABILITY_TRIAL_RIGHT : KN_STABILITY_TRIAL_WRONG;
    return s;
}

// Return the bound of the force error and the shape error. An explicit method does not share the time-step error of the
// reference R(dt). So this error is added to the bound of an explicit method. The error is about twice the difference
// between R(dt) and R(dt/2).
static double bound_of(kn_way way, double step_error)
{
    if (way == KN_WAY_RK4) return ERROR_MAX + 2 * step_error;
    return fmax(ERROR_MAX, fmin(ERROR_MOST, step_error));
}

bool kn_stability_trial_run(const kn_stability_trial *trial, unsigned ways, kn_outcome *outcome)
{
    trace ref = {0}, finer = {0};
    kn_model_def def = reference_def(trial, 1), half = reference_def(trial, 2);
    // Set all verdicts to DIED first. If the process dies before the judgement, this verdict remains.
    kn_outcome none = {0};
    for (int w = 0; w < KN_WAYS; w++) none.score[w].verdict = KN_STABILITY_TRIAL_DIED;
    *outcome = none;
    bool ok = run(trial, &def, 1, &ref) && run(trial, &half, 2, &finer);
    if (ok && !ref.refused) outcome->step_error = fmax(way_error(&ref, &finer), shape_error(&ref, &finer));
    outcome->loose = ref.loose || ref.diverged;
    for (int w = 0; w < KN_WAYS && ok; w++) {
        if (!(ways >> w & 1)) continue;
        trace x = {0};
        kn_model_def how = way_def(trial, (kn_way)w);
        ok = run(trial, &how, 1, &x);
        if (ok) outcome->score[w] = judge(&x, &ref, &finer, bound_of((kn_way)w, outcome->step_error));
        trace_free(&x);
    }
    trace_free(&ref);
    trace_free(&finer);
    return ok;
}

void kn_stability_trial_free(kn_stability_trial *trial)
{
    kn_simplices_destroy(trial->mesh);
    trial->mesh = NULL;
}
