#include "clients/knead/trial.h"
#include "clients/knead/foot.h"
#include "core/kernel.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ERROR_MAX 0.05  // below what a hand feels, see trial.h
#define ERROR_MOST 0.07 // where the step itself costs that
#define VARIATION_MAX 1.5
#define BLOWN_UP 100.0
#define SPEED_MAX 0.03 // m/s, of the hand
#define DEVICE_S 1e-3
#define REFERENCE_PASSES 100

const char *const kn_way_name[KN_WAYS] = {"default", "secant", "tangent", "f64", "rk4"};
const char *const kn_judgement_name[KN_JUDGEMENTS] = {"right", "refused", "chattering", "wrong", "diverged", "died"};

typedef struct trace { // what came of a trial
    int steps, nodes;
    double (*way)[3];      // [steps] force on the probe, or where the top is
    double (*shape[2])[3]; // [nodes] displacements at the end of the pressing, and at the end
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

#define DOWN 0.4 // of the time: there
#define STAY 0.6 // until then
#define LOADED 0.5

static double smooth(double s) { return s <= 0 ? 0 : s >= 1 ? 1 : 0.5 - 0.5 * cos(acos(-1.0) * s); }

static double length_s(const kn_trial *t) { return t->steps * t->def.solver.dt_s; }

// Depth of the tool's foot below the top at a time.
static double depth_at(const kn_trial *t, double time_s)
{
    double whole = length_s(t), fastest = SPEED_MAX * DOWN * whole * 2 / acos(-1.0);
    double depth = fmin(t->depth_m, fastest), above = 0;
    return -above + (depth + above) * (smooth(time_s / (DOWN * whole)) - smooth((time_s / whole - STAY) / (1 - STAY)));
}

static kn_input input_at(const kn_trial *t, const kn_model *m, double time_s, double dt)
{
    kn_input in = {0};
    double whole = length_s(t), rest[3] = {1, 1, 1};
    if (t->hand == KN_HAND_LOAD && time_s < LOADED * whole + 0.5 * dt) { // that it is still there at half time
        kn_model_def_extent(&t->def, rest);
        double compliance = kn_material_compliance(&t->def.material, LOADED * whole);
        double across = t->def.spacing_m * t->def.spacing_m;
        if (t->def.mesh || t->def.nodes[0] > 1) across = rest[0] * rest[1];
        in.top_load_n = t->strain * across / compliance;
    }
    if (t->def.probe_count == 0) return in;
    double depth = depth_at(t, time_s - dt), next = depth_at(t, time_s);
    const kn_probe_def *probe = &m->def.probe[0];
    in.probe[0].attached = true;
    in.probe[0].position_m[2] = m->rest_m[m->top[0]][2] + kn_foot_m(probe) - depth;
    in.probe[0].velocity_m_s[2] = (depth - next) / dt;
    // never straight down: on a symmetric path rounding alone would decide which way a soft block buckles
    static const double aside[2] = {0.05, 0.03};
    for (int k = 0; k < 2; k++) {
        in.probe[0].position_m[k] = aside[k] * depth;
        in.probe[0].velocity_m_s[k] = aside[k] * (next - depth) / dt;
    }
    // three steps of the trial's own, whatever this one is
    double at = (time_s - 0.5 * dt) / t->def.solver.dt_s - floor(0.25 * t->steps);
    if (t->hand == KN_HAND_JUMP && at > 0 && at < 3)
        for (int k = 0; k < 3; k++) in.probe[0].position_m[k] += t->jump_m[k];
    return in;
}

// --- a run ----------------------------------------------------------------------------------------------------------

static void displacement(const kn_model *m, const kn_state *s, int node, double u[3])
{
    kn_state_position(m, s, node, u);
    for (int k = 0; k < 3; k++) u[k] -= m->rest_m[node][k];
}

// The nodes of the upper half move down until its height is that share of itself.
static void squeeze(const kn_trial *t, const kn_model *m, kn_state *s)
{
    double high = 0;
    for (int i = 0; i < m->node_count; i++) high = fmax(high, m->rest_m[i][2]);
    double middle = high - m->def.spacing_m;
    for (int i = 0; i < m->node_count; i++) {
        double above = m->rest_m[i][2] - middle;
        if (above > 0) kn_real_set(m, s->displacement, m->offset[i] + 2 * m->stride, above * (t->squeezed - 1));
    }
}

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

static bool finite_shape(const trace *t, int which)
{
    double sum = 0;
    for (int i = 0; i < t->nodes; i++)
        for (int k = 0; k < 3; k++) sum += t->shape[which][i][k];
    return isfinite(sum);
}

static void follow(const kn_trial *t, const kn_model *m, kn_state *s, int substeps, trace *out)
{
    double dt = m->def.solver.dt_s;
    if (t->squeezed != 1) squeeze(t, m, s);
    for (int i = 0; i < t->steps && !out->diverged; i++) {
        for (int k = 0; k < substeps; k++) {
            kn_input in = input_at(t, m, (i * substeps + k + 1) * dt, dt);
            kn_output now;
            out->diverged |= kn_step(m, s, &in, &now) != KN_OK;
            out->loose |= now.passes == REFERENCE_PASSES;
            if (m->def.probe_count > 0 || k == substeps - 1) read_sample(m, s, &now, out->way[i]);
        }
        for (int k = 0; k < 3 && m->def.probe_count > 0; k++) out->way[i][k] /= substeps;
        int which = i + 1 == t->steps ? 1 : 0;
        if (which || i + 1 == (int)((t->hand == KN_HAND_LOAD ? LOADED : STAY) * t->steps))
            for (int n = 0; n < m->node_count; n++) displacement(m, s, n, out->shape[which][n]);
    }
    out->diverged |= !finite_shape(out, 0) || !finite_shape(out, 1);
}

// A device is sent a force every millisecond: those of shorter steps are averaged over it, or over an eighth of all
// where that is less. A light node may bounce between the plate and the block a hundred times in between.
static void average(const kn_trial *t, trace *x)
{
    int window = (int)fmin(ceil(DEVICE_S / t->def.solver.dt_s - 1e-9), t->steps / 8.0);
    for (int i = t->steps - 1; i > 0; i--) { // from behind: what is read is not written yet
        int count = window < i + 1 ? window : i + 1;
        for (int k = 0; k < 3; k++) {
            double sum = 0;
            for (int n = 0; n < count; n++) sum += x->way[i - n][k];
            x->way[i][k] = sum / count;
        }
    }
}

static bool run(const kn_trial *t, const kn_model_def *def, int substeps, trace *out)
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
    out->nodes = m->node_count;
    out->way = calloc((size_t)t->steps, sizeof *out->way);
    for (int i = 0; i < 2; i++) out->shape[i] = calloc((size_t)m->node_count, sizeof *out->shape[i]);
    bool ok = s && out->way && out->shape[0] && out->shape[1];
    if (ok) follow(t, m, s, substeps, out);
    if (ok) average(t, out);
    kn_state_destroy(s);
    kn_model_destroy(m);
    return ok;
}

// --- the ways -------------------------------------------------------------------------------------------------------

static kn_model_def reference_def(const kn_trial *t, int substeps)
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

static kn_model_def way_def(const kn_trial *t, kn_way way)
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

static double peak(const trace *t)
{
    double most = 0;
    for (int i = 0; i < t->steps; i++) most = fmax(most, norm2(ROWS(&t->way[i]), NULL, 1));
    return most;
}

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

static kn_score judge(const trace *x, const trace *ref, const trace *finer, double bound)
{
    kn_score s = {.verdict = KN_TRIAL_REFUSED};
    snprintf(s.reason, sizeof s.reason, "%s", x->refused ? x->reason : ref->reason);
    if (x->refused || ref->refused || finer->refused) return s; // what has no answer cannot be judged
    s.verdict = KN_TRIAL_DIVERGED;
    if (x->diverged || !(peak(x) <= BLOWN_UP * peak(ref))) return s;
    s.force = way_error(x, ref);
    s.shape = shape_error(x, ref);
    double calm = fmin(variation(ref), variation(finer));
    s.variation = share(variation(x), calm);
    if (s.variation > VARIATION_MAX) s.verdict = KN_TRIAL_CHATTERING;
    else s.verdict = s.force <= bound && s.shape <= bound ? KN_TRIAL_RIGHT : KN_TRIAL_WRONG;
    return s;
}

// An explicit method does not share the error of the answer's step, which is some twice the difference to half of it.
static double bound_of(kn_way way, double step_error)
{
    if (way == KN_WAY_RK4) return ERROR_MAX + 2 * step_error;
    return fmax(ERROR_MAX, fmin(ERROR_MOST, step_error));
}

bool kn_trial_run(const kn_trial *trial, unsigned ways, kn_outcome *outcome)
{
    trace ref = {0}, finer = {0};
    kn_model_def def = reference_def(trial, 1), half = reference_def(trial, 2);
    kn_outcome none = {0};
    for (int w = 0; w < KN_WAYS; w++) none.score[w].verdict = KN_TRIAL_DIED;
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

void kn_trial_free(kn_trial *trial)
{
    kn_simplices_destroy(trial->mesh);
    trial->mesh = NULL;
}
