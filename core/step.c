#include "core/step.h"
#include "core/scratch.h"
#include "core/solver_fixed.h"
#include "core/solver_implicit.h"

#include <math.h>
#include <string.h>

// --- RK4's boundary -------------------------------------------------------------------------------------------------

static void fill_boundary(const kn_model *m, const kn_input *input, kn_scratch *s)
{
    memcpy(s->fixed, m->support, (size_t)m->node_count);
    memset(s->velocity, 0, (size_t)m->node_count * sizeof *s->velocity);
    memset(s->force, 0, (size_t)m->node_count * sizeof *s->force);
    for (int t = 0; t < m->top_count; t++) s->force[m->top[t]][2] -= input->top_load_n * m->top_share[t];
}

static void solve_rk4(const kn_model *m, kn_state *state, const kn_input *input)
{
    kn_scratch *s = kn_state_scratch(state);
    fill_boundary(m, input, s);
    for (int i = 0; i < s->contact.hold_count; i++) {
        const kn_hold *hold = &s->contact.hold[i];
        for (int k = 0; k < 3; k++)
            if (!(s->fixed[hold->node] >> k & 1)) s->velocity[hold->node][k] = hold->velocity_m_s[k];
        s->fixed[hold->node] = 7;
    }
    for (int i = 0; i < s->contact.sample_count; i++) { // explicit: pressure at the depth of now
        kn_sample *sample = &s->contact.sample[i];
        kn_sample_push(sample);
        for (int a = 0; a < sample->nodes; a++)
            for (int k = 0; k < 3; k++) s->force[sample->node[a]][k] += sample->weight[a] * sample->force_n[k];
    }
    kn_rk4_step(m, state, &s->boundary, s->stages);
    for (int i = 0; i < s->contact.hold_count; i++)
        for (int k = 0; k < 3; k++) s->contact.hold[i].force_n[k] = -s->reaction[s->contact.hold[i].node][k];
}

// --- watch ----------------------------------------------------------------------------------------------------------

// A force that goes up and down by turns is the linearisation chattering: half a second of secants calms it.
#define CHATTER_SHARE 24   // sign changes in the last 64 steps
#define CHATTER_SIZE 0.005 // of the force: smaller ones are rounding

static void watch_chatter(const kn_model *m, kn_state *state, const kn_output *output)
{
    double force = 0;
    for (int p = 0; p < m->def.probe_count; p++)
        for (int k = 0; k < 3; k++) force += fabs(output->probe[p].force_n[k]);
    double delta = force - state->last_force_n;
    bool turned = delta * state->last_delta_n < 0 && fabs(delta) > CHATTER_SIZE * force;
    state->chatter_bits = state->chatter_bits << 1 | turned;
    state->last_force_n = force;
    state->last_delta_n = delta;
    if (__builtin_popcountll(state->chatter_bits) < CHATTER_SHARE) return;
    state->secant_steps = KN_SECANT_REST;
    state->chatter_bits = 0;
}

// The implicit solve's residual sums every node; Runge-Kutta has none, so its velocities are summed.
static bool all_finite(const kn_model *m, const kn_state *state, const kn_output *output)
{
    double sum = output->residual;
    if (m->def.solver.kind == KN_SOLVER_RK4)
        for (size_t i = 0; i < kn_model_field(m, 3); i++) sum += kn_real_get(m, state->velocity, i);
    for (int p = 0; p < m->def.probe_count; p++)
        for (int k = 0; k < 3; k++)
            sum += output->probe[p].force_n[k] + output->probe[p].torque_n_m[k] + output->probe[p].position_m[k];
    return isfinite(sum);
}

// --- the step -------------------------------------------------------------------------------------------------------

kn_status kn_step(const kn_model *model, kn_state *state, const kn_input *input, kn_output *output)
{
    kn_contact *contact = &kn_state_scratch(state)->contact;
    memset(output, 0, sizeof *output);
    if (state->bad) return KN_DIVERGED;
    const kn_solver kind = model->def.solver.kind;
    const bool rk4 = kind == KN_SOLVER_RK4;

    // who touches what, at the positions of now
    kn_contact_find(model, state, input, contact);
    // velocities of the lattice under these constraints; forces on holds and samples
    if (rk4) solve_rk4(model, state, input);
    else if (kind == KN_SOLVER_FIXED) kn_solve_fixed(model, state, input, output);
    else kn_solve_implicit(model, state, input, output);
    // forces on the probes; they move, and so does the lattice
    kn_contact_end(model, state, input, contact, output);
    if (kind == KN_SOLVER_IMPLICIT) kn_advance_implicit(model, state);
    if (state->secant_steps > 0) state->secant_steps--;
    watch_chatter(model, state, output);
    state->tick++;

    if (all_finite(model, state, output)) return KN_OK;
    state->bad = 1;
    memset(output, 0, sizeof *output);
    return KN_DIVERGED;
}
