#include "core/solve/solver.h"
#include "core/algebra/algebra.h"

#include <math.h>
#include <string.h>

// --- one sample -----------------------------------------------------------------------------------------------------

static void tool_rate(const kn_contact *c, const kn_sample *s, double v[3])
{
    if (s->probe == KN_TABLE) v[0] = v[1] = v[2] = 0;
    else kn_six_velocity(c->tool[s->probe].velocity, s->arm_m, v);
}

// Return the depth of a sample at the end of the step. With friction, also store the stretch that the sample would have
// at the end of the step if it stuck.
static double end_of(double dt, const kn_sample *s, const double tool[3], double stretch[3])
{
    // relative motion along the normal changes the depth, tangential relative motion changes the stretch
    double along = kn_dot(s->normal, s->rate_m_s), push = kn_dot(s->normal, tool);
    if (s->friction > 0)
        for (int k = 0; k < 3; k++)
            stretch[k] = s->stretch_m[k] + dt * (s->rate_m_s[k] - tool[k] - (along - push) * s->normal[k]);
    return s->depth_m - dt * (along - push);
}

#define LAYER_MOST 0.95 // ratio of depth to the layer's thickness above which the pressure is a straight line

// Judge one sample at its predicted place at the end of the step: decide whether it presses, and compute the tangent of
// its pressure and its tangential stiffness. The prediction uses the guessed velocities of skin and tool.
static void judge(double dt, const kn_contact *c, kn_sample *s)
{
    double tool[3], stretch[3] = {0}, k = s->foundation_n_m;
    tool_rate(c, s, tool);
    double depth = end_of(dt, s, tool, stretch), used = fmin(fmax(0, depth / s->layer_m), LAYER_MOST);
    s->line = (struct kn_sample_line){.active = depth > s->lowest_m, .slope_n_m = k};
    // a layer of finite thickness: use the tangent of k depth / (1 - depth / layer) at this depth
    if (used > 0) {
        s->line.slope_n_m = k / ((1 - used) * (1 - used));
        s->line.offset_n = -used * used * s->layer_m * s->line.slope_n_m;
    }
    if (!s->line.active || !(s->friction > 0)) return;
    // add the adhesion to the pressure before computing friction, so that contact held by adhesion does not slip off
    double pressed = s->line.slope_n_m * depth + s->line.offset_n - k * s->lowest_m;
    double size = sqrt(kn_dot(stretch, stretch));
    double cone = s->friction * fmax(0, pressed);
    // if the sticking force is inside Coulomb's cone, the sample sticks with the stiffness k; otherwise it slides, and
    // the secant stiffness puts the force on the cone
    s->line.side_n_m = k * size <= cone ? k : cone / size;
}

// Compute the force of a sample on the skin at the end of the step, from the present velocities of skin and tool.
static void force_of(double dt, const kn_contact *c, const kn_sample *s, double force[3], double *pressing)
{
    double tool[3], stretch[3];
    tool_rate(c, s, tool);
    *pressing = s->line.active ? s->line.slope_n_m * end_of(dt, s, tool, stretch) + s->line.offset_n : 0;
    for (int k = 0; k < 3; k++) force[k] = *pressing * s->normal[k];
    if (s->line.active && s->line.side_n_m > 0)
        for (int k = 0; k < 3; k++) force[k] -= s->line.side_n_m * stretch[k];
}

// Compute force = dt K v for the stiffness K of a sample and a velocity v. Return u . force.
static double answer(double dt, const kn_sample *s, const double v[3], const double u[3], double force[3])
{
    // first the part along the normal, then, with friction, the part that is equal in all directions
    double more = dt * (s->line.slope_n_m - s->line.side_n_m) * kn_dot(s->normal, v), sum = more * kn_dot(s->normal, u);
    for (int k = 0; k < 3; k++) force[k] = more * s->normal[k];
    if (!(s->line.side_n_m > 0)) return sum;
    for (int k = 0; k < 3; k++) force[k] += dt * s->line.side_n_m * v[k];
    return sum + dt * s->line.side_n_m * kn_dot(v, u);
}

// --- coupled tools --------------------------------------------------------------------------------------------------

// Add dt J'KJ of a sample to the lower half of the matrix `a`. J maps the motion (v, w) of a body to the velocity
// v + w x arm at the sample.
static void add_stiffness(double dt, const kn_sample *s, const double arm[3], double a[6][6])
{
    // column j is the force and torque of the sample if component j of the body's motion is 1 and all others are 0
    for (int j = 0; j < 6; j++) {
        double unit[6] = {0}, v[3], force[3], wrench[6] = {0};
        unit[j] = 1;
        kn_six_velocity(unit, arm, v);
        answer(dt, s, v, v, force);
        kn_six_wrench(arm, force, 1, wrench);
        for (int k = j; k < 6; k++) a[k][j] += wrench[k];
    }
}

// Assemble and factor the 6 x 6 matrix of a coupled tool: the terms of the coupling and the stiffness of all active
// samples of the tool.
static void factor_tool(double dt, kn_contact *c, int probe)
{
    kn_tool_step *tool = &c->tool[probe];
    memset(tool->factor, 0, sizeof tool->factor);
    for (int k = 0; k < 6; k++) tool->factor[k][k] = tool->give[k / 3];
    for (int i = 0; i < c->sample_count; i++) {
        const kn_sample *s = &c->sample[i];
        if (s->probe == probe && s->line.active) add_stiffness(dt, s, s->arm_m, tool->factor);
    }
    kn_six_factor(tool->factor);
}

// Set the velocity of a coupled tool so that the forces of coupling and contact balance, for given velocities of the
// skin.
static void balance_tool(double dt, kn_contact *c, int probe)
{
    kn_tool_step *tool = &c->tool[probe];
    double b[6];
    memcpy(b, tool->drive, sizeof b);
    memset(tool->velocity, 0, sizeof tool->velocity);
    // the samples' forces are those at zero velocity of the tool, because the matrix contains the tool's motion
    for (int i = 0; i < c->sample_count; i++) {
        const kn_sample *s = &c->sample[i];
        double force[3], pressing;
        if (s->probe != probe || !s->line.active) continue;
        force_of(dt, c, s, force, &pressing);
        kn_six_wrench(s->arm_m, force, -1, b);
    }
    kn_six_solve((const double(*)[6])tool->factor, b);
    memcpy(tool->velocity, b, sizeof b);
}

// Set the velocities of all coupled tools by balance_tool. `factor`: factor their matrices first.
static void balance(const kn_model *m, kn_contact *c, bool factor)
{
    for (int p = 0; p < m->def.probe_count && c->coupled; p++) {
        if (!c->tool[p].coupled) continue;
        if (factor) factor_tool(m->def.solver.dt_s, c, p);
        balance_tool(m->def.solver.dt_s, c, p);
    }
}

// --- functions that the solver calls --------------------------------------------------------------------------------

// Store the velocity of the skin at every sample (rate_m_s), interpolated from a field of node velocities.
static void look(const kn_model *m, kn_scratch *scratch, const void *field)
{
    kn_contact *c = &scratch->contact;
    m->kernels->contact_rates(m, c, field, NULL);
    for (const kn_contact_patch *p = c->patch; p < c->patch + c->patch_count; p++)
        for (size_t l = 0; l < (size_t)p->count; l++)
            for (size_t k = 0; k < 3; k++)
                c->sample[(size_t)p->first + l].rate_m_s[k] =
                    kn_real_get(m, p->lanes, (KN_CONTACT_RATE + k) * KN_LANES + l);
}

// Add to the residual the difference between the samples' present forces and force_n. Hand their stiffnesses to the
// kernels, and, if `blocks`, add these to the diagonal blocks.
static void hand_over(const kn_model *m, kn_scratch *scratch, bool blocks)
{
    kn_contact *c = &scratch->contact;
    const double dt = m->def.solver.dt_s;
    for (kn_contact_patch *p = c->patch; p < c->patch + c->patch_count; p++)
        for (size_t l = 0; l < (size_t)p->count; l++) {
            const kn_sample *s = &c->sample[(size_t)p->first + l];
            const struct kn_sample_line *line = &s->line;
            double force[3], pressing;
            force_of(dt, c, s, force, &pressing);
            for (size_t k = 0; k < 3; k++)
                kn_real_set(m, p->lanes, (KN_CONTACT_FORCE + k) * KN_LANES + l, force[k] - s->force_n[k]);
            kn_real_set(m, p->lanes, KN_CONTACT_ALONG * KN_LANES + l,
                        line->active ? dt * (line->slope_n_m - line->side_n_m) : 0);
            kn_real_set(m, p->lanes, KN_CONTACT_SIDE * KN_LANES + l, line->active ? dt * line->side_n_m : 0);
        }
    m->kernels->contact_add(m, &scratch->work, c, blocks);
}

void kn_foundation_push(const kn_model *model, kn_scratch *scratch)
{
    kn_contact *c = &scratch->contact;
    const double dt = model->def.solver.dt_s;
    if (c->sample_count == 0 && !c->coupled) return;
    look(model, scratch, scratch->work.guess);
    // judge the samples with the tools' velocities of the last step; then find the velocities of coupled tools in this
    // step, and judge a second time
    for (int again = 0; again <= c->coupled; again++) {
        for (int i = 0; i < c->sample_count; i++) judge(dt, c, &c->sample[i]);
        balance(model, c, true);
    }
    for (int i = 0; i < c->sample_count; i++) memset(c->sample[i].force_n, 0, sizeof c->sample[i].force_n);
    hand_over(model, scratch, true);
}

double kn_foundation_apply(const kn_model *model, kn_scratch *scratch)
{
    const kn_contact *c = &scratch->contact;
    double v[KN_PROBES_MAX][6] = {{0}};
    if (!c->coupled) return model->kernels->contact_product(model, &scratch->work, c, NULL);
    // all samples of a coupled tool together determine its velocity V = G^-1 sum J' dt K d
    model->kernels->contact_rates(model, c, scratch->work.d, v);
    for (int p = 0; p < model->def.probe_count; p++)
        if (c->tool[p].coupled) kn_six_solve((const double(*)[6])c->tool[p].factor, v[p]);
    return model->kernels->contact_product(model, &scratch->work, c, (const double(*)[6])v);
}

// Largest relative change of a sample's stiffness that needs no further solve. A larger change means that the solver
// did not predict a slip.
#define OFF_LINE 0.05

// Return true if two stiffnesses differ by more than OFF_LINE times the larger one.
static bool off(double a, double b) { return fabs(a - b) > OFF_LINE * fmax(a, b); }

// Judge a sample again, and return true if the judgement has changed. force_n keeps the force that the residual
// contains, and `last` keeps the old judgement.
static bool turns_over(double dt, const kn_contact *c, kn_sample *s)
{
    force_of(dt, c, s, s->force_n, &s->pressing_n);
    s->last = s->line;
    judge(dt, c, s);
    return s->line.active != s->last.active || off(s->line.side_n_m, s->last.side_n_m) ||
           off(s->line.slope_n_m, s->last.slope_n_m);
}

int kn_foundation_change(const kn_model *model, kn_scratch *scratch)
{
    kn_contact *c = &scratch->contact;
    const double dt = model->def.solver.dt_s;
    int changed = 0;
    // find the velocities of the coupled tools with their old matrices, then judge the samples at the present guess
    look(model, scratch, scratch->work.guess);
    balance(model, c, false);
    for (int i = 0; i < c->sample_count; i++) changed += turns_over(dt, c, &c->sample[i]);
    // if no judgement has changed, keep the linearisations from which the matrix was built
    if (changed == 0) {
        for (int i = 0; i < c->sample_count; i++) c->sample[i].line = c->sample[i].last;
        return 0;
    }
    // correct the residual by the difference between new and old forces
    balance(model, c, true);
    hand_over(model, scratch, false);
    return changed;
}

void kn_foundation_read(const kn_model *model, kn_scratch *scratch)
{
    kn_contact *c = &scratch->contact;
    look(model, scratch, scratch->work.guess);
    balance(model, c, false);
    for (int i = 0; i < c->sample_count; i++) {
        kn_sample *s = &c->sample[i];
        force_of(model->def.solver.dt_s, c, s, s->force_n, &s->pressing_n);
        // a sample without adhesion or grip cannot pull: remove the pull that the linearisation leaves
        if (s->pressing_n >= 0 || s->lowest_m < 0) continue;
        for (int k = 0; k < 3; k++) s->force_n[k] -= s->pressing_n * s->normal[k];
        s->pressing_n = 0;
    }
}

void kn_foundation_rigid(const kn_model *model, const kn_scratch *scratch, const double centre_m[3], double a[6][6])
{
    const kn_contact *c = &scratch->contact;
    for (int i = 0; i < c->sample_count; i++) {
        const kn_sample *s = &c->sample[i];
        double arm[3];
        if (!s->line.active) continue;
        for (int k = 0; k < 3; k++) arm[k] = s->point_m[k] - centre_m[k];
        add_stiffness(model->def.solver.dt_s, s, arm, a);
    }
}
