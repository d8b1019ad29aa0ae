#include "core/solve/solver.h"
#include "core/algebra/algebra.h"

#include <math.h>
#include <string.h>

// --- boundary -------------------------------------------------------------------------------------------------------

// Undo the constraints of the last step's held nodes. Only these nodes are visited, not all nodes.
static void free_last_held(const kn_model *m, kn_scratch *s)
{
    for (int i = 0; i < s->last_held_count; i++) {
        const size_t at = m->offset[s->last_held[i]];
        int mask = m->support[s->last_held[i]];
        // a component is free again unless the support holds it
        for (size_t k = 0; k < 3; k++) kn_real_set(m, s->work.free, at + k * m->stride, mask >> k & 1 ? 0 : 1);
    }
    s->last_held_count = 0;
    memcpy(s->work.row_held, s->row_base, (size_t)m->row_count);
    memset(s->work.row_moved, 0, (size_t)m->row_count);
}

// Prescribe the velocity of one held node. Mark its row as held, and also as moved if the velocity differs from the
// last velocity.
static void hold_node(const kn_model *m, const kn_state *state, kn_scratch *s, const kn_held_node *hold)
{
    const size_t at = m->offset[hold->node];
    size_t row = at / (3 * m->stride);
    int mask = m->support[hold->node];
    for (size_t k = hold->slides ? 2 : 0; k < 3; k++) {
        size_t o = at + k * m->stride;
        kn_real_set(m, s->work.free, o, 0);
        // a component that the support holds keeps its zero velocity
        if (mask >> k & 1) continue;
        kn_real_set(m, s->work.guess, o, hold->velocity_m_s[k]);
        if (kn_real_get(m, s->work.guess, o) != kn_real_get(m, state->velocity, o)) s->work.row_moved[row] = 1;
    }
    s->work.row_held[row] = 1;
    s->last_held[s->last_held_count++] = hold->node;
}

// Set the guess to the last velocities, and overwrite the components that plates prescribe.
static void prescribe(const kn_model *m, kn_state *state, kn_scratch *s)
{
    free_last_held(m, s);
    m->kernels->begin(m, state, &s->work, false);
    for (int i = 0; i < s->contact.hold_count; i++) hold_node(m, state, s, &s->contact.hold[i]);
}

// --- loads -----------------------------------------------------------------------------------------------------------

static void add_top_load(const kn_model *m, kn_scratch *s, double load_n)
{
    for (int t = 0; t < m->top_count; t++)
        kn_real_add(m, s->work.r, m->offset[m->top[t]] + 2 * m->stride, -load_n * m->top_share[t]);
}

// Add the dead load on the top and the forces of the contact.
static void add_external(const kn_model *m, kn_scratch *s, const kn_input *input)
{
    if (input->top_load_n != 0) add_top_load(m, s, input->top_load_n);
    kn_foundation_push(m, s);
}

// --- rigid motions --------------------------------------------------------------------------------------------------

// The rigid level of the preconditioner: the six rigid motions of an object that nothing holds.
//
//     z = P r + R (R'AR)^-1 R'r        R: [nodes] (v, w) -> v + w x (x - centre)
//
// The resistance of a lattice to deformation is a thousand times the resistance of its inertia to a motion as a whole.
// The 3 x 3 blocks of P contain the first resistance only, so an object that falls or is lifted would need hundreds of
// iterations. Edges do no work under rigid motions. So R'AR is mass and inertia over dt plus the contact, and needs no
// product with A.

static size_t arm_of(const kn_model *m, int node)
{
    size_t row = m->offset[node] / (3 * m->stride);
    return row * 4 * m->stride + m->offset[node] % (3 * m->stride);
}

// Add mass and inertia of the object, divided by dt, to the lower half of the matrix.
static void add_inertia(const kn_model *m, const kn_rigid *rigid, double a[6][6])
{
    double scale = m->def.solver.mass_scale / m->def.solver.dt_s;
    for (int i = 0; i < m->node_count; i++) {
        const float *arm = rigid->arm + arm_of(m, i);
        double mass = scale * m->node_mass_kg[i], x = (double)arm[0], y = (double)arm[m->stride],
               z = (double)arm[2 * m->stride];
        a[0][0] += mass, a[1][1] += mass, a[2][2] += mass;
        a[3][1] -= mass * z, a[3][2] += mass * y, a[4][0] += mass * z; // coupling of v and w: mass (w x arm)
        a[4][2] -= mass * x, a[5][0] -= mass * y, a[5][1] += mass * x;
        a[3][3] += mass * (y * y + z * z), a[4][4] += mass * (x * x + z * z), a[5][5] += mass * (x * x + y * y);
        a[4][3] -= mass * x * y, a[5][3] -= mass * x * z, a[5][4] -= mass * y * z;
    }
}

// Compute the centre of mass of the object, and the vector from it to every node.
static void find_centre(const kn_model *m, const kn_state *state, kn_rigid *rigid)
{
    double mass = 0, sum[3] = {0}, x[3];
    for (int i = 0; i < m->node_count; i++) {
        kn_state_position(m, state, i, x);
        mass += m->node_mass_kg[i];
        for (int k = 0; k < 3; k++) sum[k] += m->node_mass_kg[i] * x[k];
    }
    for (int k = 0; k < 3; k++) rigid->centre_m[k] = sum[k] / mass;
    for (int i = 0; i < m->node_count; i++) {
        float *arm = rigid->arm + arm_of(m, i);
        kn_state_position(m, state, i, x);
        for (size_t k = 0; k < 3; k++) arm[k * m->stride] = (float)(x[k] - rigid->centre_m[k]);
        arm[3 * m->stride] = 1;
    }
}

// Prepare the vectors of R and the Cholesky factor of R'AR for the present positions and active samples.
static void rigid_begin(const kn_model *model, const kn_state *state, kn_scratch *scratch)
{
    kn_rigid *rigid = &scratch->rigid;
    rigid->on = kn_rigid_wanted(model) && scratch->contact.hold_count == 0;
    if (!rigid->on) return;
    find_centre(model, state, rigid);
    memset(rigid->factor, 0, sizeof rigid->factor);
    // R'AR, the matrix of the rigid motions, is the sum of inertia over dt and contact stiffness
    add_inertia(model, rigid, rigid->factor);
    kn_foundation_rigid(model, scratch, rigid->centre_m, rigid->factor);
    double *w[3] = {&rigid->factor[3][3], &rigid->factor[4][4], &rigid->factor[5][5]}, spin = *w[0] + *w[1] + *w[2];
    // a straight row of nodes has no inertia about its axis: add a small number, so that the matrix stays regular
    for (int k = 0; k < 3; k++) *w[k] += 1e-9 * spin + 1e-30;
    kn_six_factor(rigid->factor);
}

// Loops over the nodes of one row, for both precisions. GATHER adds the force and torque of the row's residual to
// `sum`. SCATTER adds the rigid motion c to z. A row of a field holds x, y and z of `stride` nodes one after the other.
#define GATHER(real)                                                                                                   \
    const real *r = (const real *)scratch->work.r + 3 * at;                                                            \
    const float *x = rigid->arm + 4 * at, *y = x + stride, *z = y + stride;                                            \
    for (size_t i = 0; i < stride; i++) {                                                                              \
        double f[3] = {(double)r[i], (double)r[stride + i], (double)r[2 * stride + i]};                                \
        const double arm[3] = {(double)x[i], (double)y[i], (double)z[i]};                                              \
        kn_six_wrench(arm, f, 1, sum);                                                                                 \
    }

#define SCATTER(real)                                                                                                  \
    real *out = (real *)scratch->work.z + 3 * at;                                                                      \
    const float *x = rigid->arm + 4 * at, *y = x + stride, *z = y + stride, *here = z + stride;                        \
    for (size_t i = 0; i < stride; i++) {                                                                              \
        const double arm[3] = {(double)x[i], (double)y[i], (double)z[i]};                                              \
        double v[3];                                                                                                   \
        kn_six_velocity(c, arm, v);                                                                                    \
        for (size_t k = 0; k < 3; k++) out[k * stride + i] += (real)v[k] * (real)here[i];                              \
    }

// Add the rigid level of the preconditioner, R (R'AR)^-1 R'r, to work.z. Return the increase of r.z.
static double rigid_add(const kn_model *model, kn_scratch *scratch)
{
    const kn_rigid *rigid = &scratch->rigid;
    const size_t stride = model->stride, end = (size_t)model->row_count * stride;
    double sum[6] = {0}, c[6], more = 0;
    if (!rigid->on) return 0;
    // compute sum = R'r, the total force and torque of the residual r
    for (size_t at = 0; at < end; at += stride) {
        if (kn_model_single(model)) {
            GATHER(float)
        } else {
            GATHER(double)
        }
    }
    // solve the 6 x 6 system, then add the rigid motion to z
    memcpy(c, sum, sizeof c);
    kn_six_solve((const double(*)[6])rigid->factor, c);
    for (int k = 0; k < 6; k++) more += c[k] * sum[k];
    for (size_t at = 0; at < end; at += stride) {
        if (kn_model_single(model)) {
            SCATTER(float)
        } else {
            SCATTER(double)
        }
    }
    return more;
}

// --- conjugate gradients --------------------------------------------------------------------------------------------

// Add the coarse level to work.z, which is P r. Return the increase of r.z.
static double coarse_add(const kn_model *m, kn_scratch *s)
{
    if (!m->coarse) return 0;
    memset(s->work.coarse, 0, (size_t)m->coarse->padded * kn_model_real(m));
    m->kernels->restriction(m, &s->work);
    const double more = m->kernels->coarse_solve(m, &s->work);
    m->kernels->prolongation(m, &s->work);
    return more;
}

// Return a limit for the powers r.z and d.q, W. Below this limit, their f32 terms begin to underflow, and a quotient of
// two such powers is meaningless.
static double least_w(const kn_model *m) { return kn_model_single(m) ? 1e-28 : 0; }

// Return the value of r.z below which the object is at rest, so that no iteration is needed.
static double nothing_of(const kn_model *m, const kn_state *state)
{
    return fmax(1e-30 * state->residual_scale, least_w(m));
}

// Least reference residual of a step, as a share of the largest residual of the last second. Without this limit, a step
// at rest would relinearise in vain: it begins with rounding errors only, and nothing reduces them to a thousandth.
#define REST 1e-3

// Record the squared residual rz with which a step begins. Return the reference: a further linearisation is needed
// while the squared residual exceeds tolerance^2 times the reference. A NaN stays a NaN.
static double note_start(const kn_model *m, kn_state *state, double rz)
{
    double faded = state->residual_scale * (1 - fmin(1, m->def.solver.dt_s)); // decay with a time constant of 1 s
    // an impact raises the residual scale at most to the limit of kn_impact_power, see step_effort.h
    double most = kn_impact_power(m);
    state->residual_scale = rz <= faded ? faded : rz > most ? most : rz;
    return fmin(fmax(rz, REST * REST * state->residual_scale), state->residual_scale);
}

// Update guess and residual, and apply the preconditioner except for its coarse level. Return r.z.
static double update(const kn_model *m, kn_scratch *s, double alpha)
{
    double rz = m->kernels->update(m, &s->work, alpha);
    return rz + rigid_add(m, s);
}

// A hurried linearisation ends at this share of its initial residual. A deadline hurries all linearisations but the
// last. Their remaining error matters little, because the next linearisation starts from a larger residual. Measured
// for a plate's blow on dough with gas in 0.6 ms: the force error is 2.8 % with 0.2, 3.7 % with 0.1, and 3.4 % with
// 0.3.
#define HURRIED 0.2

// Run conjugate gradients. rz is r.z of the present residual; return r.z at the end. Do `wanted` iterations, and more
// while the residual exceeds the tolerance.
static double iterate(const kn_model *m, kn_state *state, kn_scratch *s, double rz, int wanted, kn_output *output)
{
    const kn_effort *solver = &s->effort;
    // all thresholds are in r.z, which is a squared norm
    double enough = solver->tolerance * solver->tolerance * state->residual_scale;
    double nothing = nothing_of(m, state);
    double last = 0; // r.z of the last iteration, with all levels of the preconditioner
    if (s->deadline.hurried && enough > 0) enough = fmax(enough, HURRIED * HURRIED * rz), wanted = 0;
    for (int i = 0; output->iterations < solver->iterations_max; i++, output->iterations++) {
        // stop if the tolerance is met, if the object is at rest, or if rz is NaN
        if ((i >= wanted && rz <= enough) || !(rz > nothing)) return rz;
        if (i >= wanted && solver->tolerance == 0) return rz;
        // stop when the deadline leaves no time for another iteration
        if (!kn_deadline_iterate(&s->deadline, output->iterations)) {
            output->capped = true;
            return rz;
        }
        // d: next search direction, conjugate to the last one; q = A d
        const double all = rz + coarse_add(m, s), beta = last > 0 ? all / last : 0;
        double dq = m->kernels->apply(m, state, &s->work, beta) + kn_foundation_apply(m, s);
        if (!(dq > 0)) { // no minimum along d: leave nothing of this direction to the next step
            memset(s->work.d, 0, kn_state_field(m, 3));
            memset(s->work.q, 0, kn_state_field(m, 3));
            return rz;
        }
        // step to the minimum along d
        rz = update(m, s, all / dq);
        last = all;
    }
    // iterations_max was reached
    output->capped = solver->tolerance > 0 && rz > enough;
    return rz;
}

// Take the first iteration of a step along the last step's change of velocity, to the minimum in this direction. It
// solves the components that change slowly from tick to tick, so the conjugate gradients need not find them again. This
// halves the number of iterations for a given error. Return r.z.
static double go_on(const kn_model *m, kn_state *state, kn_scratch *s, double rz, kn_output *output)
{
    if (!(rz > nothing_of(m, state))) return rz;
    double rd = m->kernels->recall(m, state, &s->work),
           dq = m->kernels->apply(m, state, &s->work, 0) + kn_foundation_apply(m, s);
    output->iterations++;
    return update(m, s, dq > least_w(m) ? rd / dq : 0);
}

// Solve one linearised system. During the solve, the contact may change its active set up to twice.
static double solve_linear(const kn_model *m, kn_state *state, kn_scratch *s, double rz, bool first, kn_output *output)
{
    int wanted = s->effort.iterations;
    if (first && wanted > 1) {
        rz = go_on(m, state, s, rz, output);
        // count this iteration without asking the deadline, because even the shortest step contains it
        s->deadline.spent += s->deadline.iteration;
        wanted--;
    }
    rz = iterate(m, state, s, rz, wanted, output);
    // judge the samples of the contact again at the new guess; if some have changed, solve again with fewer iterations
    for (int again = 0; again < 2; again++) {
        if (again > 0 && !kn_deadline_spend(&s->deadline, s->deadline.look)) break;
        // the first look at the contact is not counted here, because its work was counted with the linearisation
        if (kn_foundation_change(m, s) == 0) break;
        rz = iterate(m, state, s, update(m, s, 0), (wanted + 1) / 2, output);
    }
    return rz;
}

// Read the contact forces. The residual at a held node is the force of the node on the plate.
static void read_forces(const kn_model *m, kn_scratch *s)
{
    for (int i = 0; i < s->contact.hold_count; i++) {
        kn_held_node *hold = &s->contact.hold[i];
        const size_t at = m->offset[hold->node];
        for (size_t k = 0; k < 3; k++)
            hold->force_n[k] =
                hold->gone || (hold->slides && k < 2) ? 0 : kn_real_get(m, s->work.r, at + k * m->stride);
    }
    kn_foundation_read(m, s);
}

// Return the effort of this step: the effort of the input, or the effort of the model if the input has none.
static kn_effort effort_of(const kn_model *m, const kn_input *input)
{
    const kn_solver_def *own = &m->def.solver;
    if (input->effort.iterations > 0) return input->effort;
    return (kn_effort){own->iterations, own->iterations_max, own->tolerance, own->passes, own->linearization};
}

// Choose the linearisation of the law. If edges flow even at rest (c2 < A/3), the tangent in a BLEND makes the force
// oscillate from step to step when a press ends. So a BLEND is then replaced by a SECANT.
static kn_linearization linearization_of(const kn_model *m, const kn_scratch *s)
{
    bool flows = m->law.s1_pa > 0 && m->law.slope_rest < 0.25;
    return flows && s->effort.linearization == KN_LINEARIZATION_BLEND ? KN_LINEARIZATION_SECANT
                                                                      : s->effort.linearization;
}

// Release held nodes that pull harder than the adhesion, within the step. If they were released only after the step, a
// plate that is torn away would drag them along for a whole step.
static void let_go(const kn_model *m, const kn_state *state, kn_scratch *s)
{
    for (int i = 0; i < s->contact.hold_count; i++) {
        kn_held_node *hold = &s->contact.hold[i];
        const size_t at = m->offset[hold->node];
        if (hold->gone || kn_real_get(m, s->work.r, at + 2 * m->stride) >= hold->lowest_n) continue;
        hold->gone = true;
        for (size_t k = hold->slides ? 2 : 0; k < 3; k++) {
            if (m->support[hold->node] >> k & 1) continue;
            // free the component, and start its guess from its last velocity
            kn_real_set(m, s->work.free, at + k * m->stride, 1);
            kn_real_set(m, s->work.guess, at + k * m->stride, kn_real_get(m, state->velocity, at + k * m->stride));
        }
    }
}

void kn_solve_implicit(const kn_model *model, kn_state *state, kn_scratch *s, const kn_input *input, kn_output *output)
{
    s->effort = effort_of(model, input);
    output->secant = state->secant_steps > 0;
    kn_linearization how = output->secant ? KN_LINEARIZATION_SECANT : linearization_of(model, s);
    // constrain the held nodes
    prescribe(model, state, s);
    double rz = 0, start = 0;
    // a material or a long step may need more than one linearisation; `unsolved`: share of the first residual at which
    // the law counts as solved
    const bool demand = kn_step_on_demand(model, s->effort.passes);
    int passes = kn_impact_lines(model, s->effort.passes);
    if (demand) s->effort.tolerance *= KN_LONG_SOLVED;
    const double unsolved = demand ? kn_step_law(model, s->contact.hold_count > 0) : s->effort.tolerance;
    bool impact = false;
    // begin to count the work; if the deadline leaves time for too few linearisations and a plate strikes fast, start
    // from a guess of the flow under the plate
    kn_deadline_begin(&s->deadline, model, &s->contact, input->deadline);
    const int64_t guess = kn_deadline_guess(&s->deadline, model, KN_IMPACT_PASSES, s->effort.iterations_max);
    if (guess > 0 && kn_impact_guess(model, state, &s->work, &s->contact)) s->deadline.spent += guess;
    for (int pass = 0; pass < passes; pass++) {
        if (!kn_deadline_line(&s->deadline, pass == 0)) {
            output->capped = true;
            break;
        }
        // in an impact, nodes that pull leave the plate before the law is linearised again
        if (impact) let_go(model, state, s);
        // linearise: dead load, contact, then the law of every edge at the guess
        if (pass > 0) model->kernels->begin(model, state, &s->work, true);
        add_external(model, s, input);
        rigid_begin(model, state, s);
        rz = model->kernels->edge(model, state, &s->work, how, pass > 0);
        rz += rigid_add(model, s);
        // the first residual tells whether this step is an impact, which needs further linearisations
        if (pass == 0) start = note_start(model, state, rz);
        if (pass == 0 && kn_impact(model, state, &s->contact, rz)) {
            impact = true;
            if (passes < KN_IMPACT_PASSES && !kn_step_is_long(model)) passes = KN_IMPACT_PASSES;
        }
        // stop when the guess meets the law itself, not only its linearisation
        if (pass > 0 && rz <= unsolved * unsolved * start) break;
        output->iterations = 0;
        if (input->deadline > 0) output->capped = false; // only the last linearisation may set `capped`
        // share the remaining time among the linearisations that follow, then solve this one
        kn_deadline_share(&s->deadline, passes - pass, s->effort.iterations_max);
        rz = solve_linear(model, state, s, rz, pass == 0, output);
        output->passes = pass + 1;
    }
    // The output's residual is relative to the largest residual of the last second. It is NaN if a number is not
    // finite. It is 1 if all residuals were 0 so far, for example if the very first contact appears during this step.
    double scale = state->residual_scale > 0 ? state->residual_scale : rz;
    output->residual = rz == 0 ? 0 : sqrt(rz / scale);
    read_forces(model, s);
    output->units = s->deadline.spent;
}
