#include "core/step.h"
#include "core/solve/solver.h"
#include "core/solver_fixed.h"

#include <math.h>
#include <string.h>

// --- Runge-Kutta ----------------------------------------------------------------------------------------------------

// Take one Runge-Kutta step. The contact prescribes velocities of nodes under plates and adds external forces.
static void solve_rk4(const kn_model *m, kn_state *state, kn_scratch *s, const kn_input *input)
{
    // begin with the constraints of the support, velocities of 0, and the dead load on the top
    memcpy(s->fixed, m->support, (size_t)m->node_count);
    memset(s->velocity, 0, (size_t)m->node_count * sizeof *s->velocity);
    memset(s->force, 0, (size_t)m->node_count * sizeof *s->force);
    for (int t = 0; t < m->top_count; t++) s->force[m->top[t]][2] -= input->top_load_n * m->top_share[t];
    // a held node moves with its plate, except in components that the support already fixes, or that slide
    for (int i = 0; i < s->contact.hold_count; i++) {
        const kn_held_node *hold = &s->contact.hold[i];
        const int components = hold->slides ? 4 : 7; // bits as in kn_model.support
        for (int k = 0; k < 3; k++)
            if ((components & ~s->fixed[hold->node]) >> k & 1) s->velocity[hold->node][k] = hold->velocity_m_s[k];
        s->fixed[hold->node] |= (uint8_t)components;
    }
    // each sample pushes its nodes with the pressure at its present depth (explicit contact)
    for (int i = 0; i < s->contact.sample_count; i++) {
        kn_sample *sample = &s->contact.sample[i];
        kn_sample_push(sample);
        for (int a = 0; a < sample->patch->nodes; a++)
            for (int k = 0; k < 3; k++) s->force[sample->patch->node[a]][k] += sample->weight[a] * sample->force_n[k];
    }
    const kn_boundary boundary = {s->fixed, (const double(*)[3])s->velocity, (const double(*)[3])s->force, s->reaction};
    kn_rk4_step(m, state, &boundary, s->stages);
    // the force on the plate is the reaction of the held node with the opposite sign
    for (int i = 0; i < s->contact.hold_count; i++)
        for (int k = s->contact.hold[i].slides ? 2 : 0; k < 3; k++)
            s->contact.hold[i].force_n[k] = -s->reaction[s->contact.hold[i].node][k];
}

// --- watch ----------------------------------------------------------------------------------------------------------

// Chatter watch. If the contact force rises and falls from step to step, the linearisation of the law chatters. Half a
// second of steps with the secant linearisation stops the chatter.
#define CHATTER_SHARE 24   // number of sign changes of the force's increment in 64 steps that counts as chatter
#define CHATTER_SIZE 0.005 // an increment below this share of the force counts as rounding and is ignored

// Count the sign changes of the contact force's increment. If there are too many, switch to the secant linearisation.
static void watch_chatter(const kn_model *m, kn_state *state, const kn_output *output)
{
    // one number shows an oscillation: the sum of the absolute values of all force components
    double force = 0;
    for (int p = 0; p < m->def.probe_count; p++)
        for (int k = 0; k < 3; k++) force += fabs(output->probe[p].force_n[k]);
    // record one bit per step: 1 if the increment of the force has changed its sign and is larger than rounding
    double delta = force - state->last_force_n;
    bool turned = delta * state->last_delta_n < 0 && fabs(delta) > CHATTER_SIZE * force;
    state->chatter_bits = state->chatter_bits << 1 | turned;
    state->last_force_n = force;
    state->last_delta_n = delta;
    if (__builtin_popcountll(state->chatter_bits) < CHATTER_SHARE) return;
    // there were too many sign changes in the last 64 steps: use the secant for a while, and count from 0 again
    state->secant_steps = KN_SECANT_REST;
    state->chatter_bits = 0;
}

// Return whether the results of the step are finite. One sum is enough, because any NaN or infinity makes the sum
// non-finite. The residual of the implicit solver is a sum over all nodes. Runge-Kutta has no residual, so the
// velocities of all nodes are added instead.
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

const char *kn_version(void) { return KN_VERSION; }

const char *kn_status_text(kn_status status)
{
    switch (status) {
    case KN_OK: return "the step was taken";
    case KN_DIVERGED: return "a number is not finite; all forces are 0 until the state is reset";
    case KN_BAD_INPUT: return "the input attaches a probe that the model does not have, or its effort is out of range";
    }
    return "unknown status";
}

bool kn_input_fits(const kn_model *model, const kn_input *input)
{
    const kn_effort *e = &input->effort;
    for (int p = model->def.probe_count; p < KN_PROBES_MAX; p++)
        if (input->probe[p].attached) return false;
    if (e->iterations == 0) return true;
    return e->iterations > 0 && e->iterations_max >= e->iterations && e->iterations_max <= 100000 &&
           e->tolerance >= 0 && e->tolerance <= 1 && e->passes >= 1 && e->passes <= 100 && (int)e->linearization >= 0 &&
           e->linearization <= KN_LINEARIZATION_TANGENT;
}

kn_status kn_step(const kn_model *model, kn_state *state, kn_scratch *scratch, const kn_input *input, kn_output *output)
{
    kn_contact *contact = &scratch->contact;
    memset(output, 0, sizeof *output);
    scratch->state = NULL; // until the step has ended, the scratch holds no contact of a state
    if (!kn_input_fits(model, input)) return KN_BAD_INPUT;
    if (state->bad) return KN_DIVERGED;
    const kn_solver kind = model->def.solver.kind;
    const bool rk4 = kind == KN_SOLVER_RK4;

    // find which tool touches which nodes, at the present positions; a step that a circuit was late for knows already
    const bool fixed = kind == KN_SOLVER_FIXED;
    if (!fixed || !kn_fixed_late(scratch)) kn_contact_find(model, state, input, contact);
    // solve for the velocities of the nodes, and for the forces of held nodes and samples
    if (rk4) solve_rk4(model, state, scratch, input);
    else if (fixed && !kn_solve_fixed(model, state, scratch, input, output)) return KN_OK;
    else if (!fixed) kn_solve_implicit(model, state, scratch, input, output);
    // sum the forces on the probes, then move the probes and the lattice
    kn_contact_end(model, state, input, contact, output);
    if (kind == KN_SOLVER_IMPLICIT) model->kernels->integrate(model, state, &scratch->work);
    // watch the force for chatter
    if (state->secant_steps > 0) state->secant_steps--;
    watch_chatter(model, state, output);
    state->tick++;

    if (all_finite(model, state, output)) {
        scratch->state = state;
        memcpy(scratch->after, state, sizeof scratch->after);
        return KN_OK;
    }
    // A result is not finite: all forces are 0 from now on until kn_state_reset. Clear the scratch, because its next
    // step may be of another state.
    state->bad = 1;
    memset(output, 0, sizeof *output);
    kn_scratch_reset(model, scratch);
    return KN_DIVERGED;
}
