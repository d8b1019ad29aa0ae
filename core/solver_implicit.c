#include "core/solver_implicit.h"
#include "core/foundation.h"
#include "core/impact.h"
#include "core/rigid.h"

#include <math.h>
#include <string.h>

typedef struct node_at { // where a node's three components are
    size_t offset, stride;
} node_at;

static node_at locate(const kn_model *m, int node) { return (node_at){m->offset[node], m->stride}; }

// --- boundary -------------------------------------------------------------------------------------------------------

static void free_last_held(const kn_model *m, kn_scratch *s)
{
    for (int i = 0; i < s->last_held_count; i++) {
        node_at n = locate(m, s->last_held[i]);
        int mask = m->support[s->last_held[i]];
        for (size_t k = 0; k < 3; k++) kn_real_set(m, s->work.free, n.offset + k * n.stride, mask >> k & 1 ? 0 : 1);
    }
    s->last_held_count = 0;
    memcpy(s->work.row_held, s->row_base, (size_t)m->row_count);
    memset(s->work.row_moved, 0, (size_t)m->row_count);
}

static void hold_node(const kn_model *m, const kn_state *state, kn_scratch *s, const kn_hold *hold)
{
    node_at n = locate(m, hold->node);
    size_t row = n.offset / (3 * n.stride);
    int mask = m->support[hold->node];
    for (size_t k = 0; k < 3; k++) {
        size_t o = n.offset + k * n.stride;
        kn_real_set(m, s->work.free, o, 0);
        if (mask >> k & 1) continue;
        kn_real_set(m, s->work.guess, o, hold->velocity_m_s[k]);
        if (kn_real_get(m, s->work.guess, o) != kn_real_get(m, state->velocity, o)) s->work.row_moved[row] = 1;
    }
    s->work.row_held[row] = 1;
    s->last_held[s->last_held_count++] = hold->node;
}

static void prescribe(const kn_model *m, kn_state *state, kn_scratch *s)
{
    size_t bytes = kn_model_field(m, 3) * m->kernels->real_size;
    free_last_held(m, s);
    memcpy(s->work.guess, state->velocity, bytes);
    for (int i = 0; i < s->contact.hold_count; i++) hold_node(m, state, s, &s->contact.hold[i]);
}

// --- loads -----------------------------------------------------------------------------------------------------------

static void add_top_load(const kn_model *m, kn_scratch *s, double load_n)
{
    for (int t = 0; t < m->top_count; t++)
        kn_real_add(m, s->work.r, m->offset[m->top[t]] + 2 * m->stride, -load_n * m->top_share[t]);
}

static void add_external(const kn_model *m, kn_scratch *s, const kn_input *input)
{
    memset(s->work.r, 0, kn_model_field(m, 3) * m->kernels->real_size);
    memset(s->work.p, 0, kn_model_field(m, 6) * m->kernels->real_size);
    if (input->top_load_n != 0) add_top_load(m, s, input->top_load_n);
    kn_foundation_push(m, s);
}

// --- conjugate gradients --------------------------------------------------------------------------------------------

// Products of f32 begin to underflow below this power, and a quotient of them may be anything.
static double least_w(const kn_model *m) { return m->def.solver.precision == KN_PRECISION_F32 ? 1e-28 : 0; }

// Power below which the object rests and there is nothing to solve.
static double nothing_of(const kn_model *m, const kn_state *state)
{
    return fmax(1e-30 * state->residual_scale, least_w(m));
}

// Of the residual that a step begins with, and of the largest of the last second, what a further line through the law
// need not go below: a step at rest begins with rounding, and the thousandth of that is never reached.
#define REST 1e-3

// Takes note of the residual that a step begins with; returns what its lines are measured against. A NaN stays one.
static double note_start(const kn_model *m, kn_state *state, double rz)
{
    double faded = state->residual_scale * (1 - fmin(1, m->def.solver.dt_s)); // over a second
    double most = kn_impact_power(m);
    state->residual_scale = rz <= faded ? faded : rz > most ? most : rz;
    return fmin(fmax(rz, REST * REST * state->residual_scale), state->residual_scale);
}

static double update(const kn_model *m, kn_state *state, kn_scratch *s, double alpha)
{
    double rz = m->kernels->update(m, state, alpha);
    return rz + kn_rigid_add(m, s);
}

// A hurried line that others follow is solved to this share of the residual that it began with: the next one's law is
// off by more. In 0.6 ms a plate's blow on dough with gas is off by 2.8 % so, by 3.7 % with 0.1, by 3.4 % with 0.3.
#define HURRIED 0.2

// From r.z of the residual in place; returns r.z at the end.
static double iterate(const kn_model *m, kn_state *state, kn_scratch *s, double rz, int wanted, kn_output *output)
{
    const kn_effort *solver = &s->effort;
    double enough = solver->tolerance * solver->tolerance * state->residual_scale;
    double nothing = nothing_of(m, state);
    double beta = 0;
    if (s->deadline.hurried && enough > 0) enough = fmax(enough, HURRIED * HURRIED * rz), wanted = 0;
    for (int i = 0; output->iterations < solver->iterations_max; i++, output->iterations++) {
        if ((i >= wanted && rz <= enough) || !(rz > nothing)) return rz;
        if (i >= wanted && solver->tolerance == 0) return rz;
        if (!kn_deadline_spend(&s->deadline, s->deadline.iteration)) {
            output->capped = true;
            return rz;
        }
        double dq = m->kernels->apply(m, state, beta) + kn_foundation_apply(m, s);
        if (!(dq > 0)) return rz;
        double next = update(m, state, s, rz / dq);
        beta = next / rz;
        rz = next;
    }
    output->capped = solver->tolerance > 0 && rz > enough;
    return rz;
}

// First along the way that the last step went, as far as serves best: what changes slowly between ticks is solved there
// already, and the gradients need not find it again. Half the iterations to the same error; counts as one.
static double go_on(const kn_model *m, kn_state *state, kn_scratch *s, double rz, kn_output *output)
{
    if (!(rz > nothing_of(m, state))) return rz;
    double rd = m->kernels->recall(m, state), dq = m->kernels->apply(m, state, 0) + kn_foundation_apply(m, s);
    output->iterations++;
    return update(m, state, s, dq > least_w(m) ? rd / dq : 0);
}

static double solve_linear(const kn_model *m, kn_state *state, kn_scratch *s, double rz, bool first, kn_output *output)
{
    int wanted = s->effort.iterations;
    if (first && wanted > 1) {
        rz = go_on(m, state, s, rz, output);
        s->deadline.spent += s->deadline.iteration; // of the shortest step
        wanted--;
    }
    rz = iterate(m, state, s, rz, wanted, output);
    for (int again = 0; again < 2; again++) {
        if (again > 0 && !kn_deadline_spend(&s->deadline, s->deadline.look)) break;
        if (kn_foundation_change(m, s) == 0) break;
        rz = iterate(m, state, s, update(m, state, s, 0), (wanted + 1) / 2, output);
    }
    return rz;
}

static void read_forces(const kn_model *m, kn_scratch *s)
{
    for (int i = 0; i < s->contact.hold_count; i++) {
        kn_hold *hold = &s->contact.hold[i];
        node_at n = locate(m, hold->node);
        for (size_t k = 0; k < 3; k++)
            hold->force_n[k] = hold->gone ? 0 : kn_real_get(m, s->work.r, n.offset + k * n.stride);
    }
    kn_foundation_read(m, s);
}

static kn_effort effort_of(const kn_model *m, const kn_input *input)
{
    const kn_solver_def *own = &m->def.solver;
    if (input->effort.iterations > 0) return input->effort;
    return (kn_effort){own->iterations, own->iterations_max, own->tolerance, own->passes, own->linearization};
}

// Where even edges at rest give way by their dampers, c2 < A/3, the law is a curve from end to end: there the tangent's
// half of a blend goes up and down between two steps when a press ends.
static kn_linearization linearization_of(const kn_model *m, const kn_scratch *s)
{
    bool flows = m->law.s1_pa > 0 && m->law.slope_rest < 0.25;
    return flows && s->effort.linearization == KN_LINEARIZATION_BLEND ? KN_LINEARIZATION_SECANT
                                                                      : s->effort.linearization;
}

// A plate that is torn away would take what it held along for a step: at once is the only way to let go of it then.
static void let_go(const kn_model *m, const kn_state *state, kn_scratch *s)
{
    for (int i = 0; i < s->contact.hold_count; i++) {
        kn_hold *hold = &s->contact.hold[i];
        node_at n = locate(m, hold->node);
        if (hold->gone || kn_real_get(m, s->work.r, n.offset + 2 * n.stride) >= 0) continue;
        hold->gone = true;
        for (size_t k = 0; k < 3; k++) {
            if (m->support[hold->node] >> k & 1) continue;
            kn_real_set(m, s->work.free, n.offset + k * n.stride, 1);
            kn_real_set(m, s->work.guess, n.offset + k * n.stride,
                        kn_real_get(m, state->velocity, n.offset + k * n.stride));
        }
    }
}

void kn_solve_implicit(const kn_model *model, kn_state *state, const kn_input *input, kn_output *output)
{
    kn_scratch *s = kn_state_scratch(state);
    s->effort = effort_of(model, input);
    output->secant = state->secant_steps > 0;
    kn_linearization how = output->secant ? KN_LINEARIZATION_SECANT : linearization_of(model, s);
    prescribe(model, state, s);
    double rz = 0, start = 0;
    int least = kn_impact_lines(model), passes = s->effort.passes > least ? s->effort.passes : least;
    bool impact = false;
    kn_deadline_begin(&s->deadline, model, &s->contact, input->deadline);
    const int64_t guess = kn_deadline_guess(&s->deadline, model, KN_IMPACT_PASSES, s->effort.iterations_max);
    if (guess > 0 && kn_impact_guess(model, state, &s->contact)) s->deadline.spent += guess;
    for (int pass = 0; pass < passes; pass++) {
        if (!kn_deadline_line(&s->deadline, pass == 0)) {
            output->capped = true;
            break;
        }
        if (impact) let_go(model, state, s);
        add_external(model, s, input);
        kn_rigid_begin(model, state, s);
        rz = model->kernels->edge(model, state, how, pass > 0);
        rz += kn_rigid_add(model, s);
        if (pass == 0) start = note_start(model, state, rz);
        if (pass == 0 && kn_impact(model, state, &s->contact, rz)) {
            impact = true;
            if (passes < KN_IMPACT_PASSES) passes = KN_IMPACT_PASSES;
        }
        // the law itself is met, not only its straight line
        if (pass > 0 && rz <= s->effort.tolerance * s->effort.tolerance * start) break;
        output->iterations = 0;
        if (input->deadline > 0) output->capped = false; // the last line tells
        kn_deadline_share(&s->deadline, passes - pass, s->effort.iterations_max);
        rz = solve_linear(model, state, s, rz, pass == 0, output);
        output->passes = pass + 1;
    }
    // not a number when the physics has gone bad; all of it where a contact came up in a step that began with nothing
    double scale = state->residual_scale > 0 ? state->residual_scale : rz;
    output->residual = rz == 0 ? 0 : sqrt(rz / scale);
    read_forces(model, s);
    output->units = s->deadline.spent;
}

void kn_advance_implicit(const kn_model *model, kn_state *state) { model->kernels->integrate(model, state); }
