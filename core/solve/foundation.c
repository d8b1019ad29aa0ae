#include "core/solve/solver.h"
#include "core/algebra/algebra.h"

#include <math.h>
#include <string.h>

// A patch of the skin: consecutive samples that share their nodes. The nodes' values in a field are fetched and added
// once for all samples of a patch.
typedef struct patch {
    kn_sample *sample;
    int count, nodes;
    double x[9][3];     // values of a field at the patch's nodes
    double add[9][3];   // values to add to another field at the patch's nodes
    double block[9][6]; // matrix blocks to add at the nodes: xx xy xz yy yz zz
} patch;

// Return whether two samples share all nodes. Comparing a few nodes is enough: samples of one face whose corner nodes
// are equal share all of them.
static bool same_nodes(const kn_sample *a, const kn_sample *b)
{
    return a->probe == b->probe && a->face == b->face && a->nodes == b->nodes && a->offset[0] == b->offset[0] &&
           a->offset[1] == b->offset[1] && a->offset[2] == b->offset[2] && a->offset[4] == b->offset[4] &&
           a->offset[8] == b->offset[8];
}

static void fetch(const kn_model *m, const void *field, patch *p)
{
    for (int a = 0; a < p->nodes; a++) {
        size_t o = p->sample->offset[a];
        for (size_t k = 0; k < 3; k++) p->x[a][k] = kn_real_get(m, field, o + k * m->stride);
    }
}

// Set `p` to the patch that starts at sample `from`. Fetch its nodes' values in `field` unless `field` is NULL, and
// clear p->add. Return false if there is no sample `from`.
static bool next_patch(const kn_model *m, const kn_contact *contact, const void *field, int from, patch *p)
{
    if (from >= contact->sample_count) return false;
    p->sample = &contact->sample[from];
    p->count = 1;
    p->nodes = p->sample->nodes;
    while (from + p->count < contact->sample_count && same_nodes(p->sample, p->sample + p->count)) p->count++;
    if (field) fetch(m, field, p);
    memset(p->add, 0, sizeof p->add);
    return true;
}

static void add_to(const kn_model *m, void *field, const patch *p)
{
    for (int a = 0; a < p->nodes; a++)
        for (size_t k = 0; k < 3; k++)
            if (p->add[a][k] != 0) kn_real_add(m, field, p->sample->offset[a] + k * m->stride, p->add[a][k]);
}

static void add_blocks(const kn_model *m, void *field, const patch *p)
{
    for (int a = 0; a < p->nodes; a++) {
        // the field has 6 components per node: compute the place of the first from the node's offset in a field of 3
        // components
        size_t o = p->sample->offset[a], first = o / (3 * m->stride) * 6 * m->stride + o % (3 * m->stride);
        for (size_t c = 0; c < 6; c++)
            if (p->block[a][c] != 0) kn_real_add(m, field, first + c * m->stride, p->block[a][c]);
    }
}

// --- one sample -----------------------------------------------------------------------------------------------------

// Interpolate the skin's velocity at one sample from the values fetched at its nodes.
static void rate_of(const kn_sample *s, const patch *p, double v[3])
{
    v[0] = v[1] = v[2] = 0;
    for (int a = 0; a < p->nodes; a++)
        for (int k = 0; k < 3; k++) v[k] += s->weight[a] * p->x[a][k];
}

static void tool_rate(const kn_contact *c, const kn_sample *s, double v[3])
{
    if (s->probe == KN_TABLE) v[0] = v[1] = v[2] = 0;
    else kn_six_velocity(c->tool[s->probe].velocity, s->arm_m, v);
}

static bool coupled(const kn_contact *c, const kn_sample *s)
{
    return s->probe != KN_TABLE && c->tool[s->probe].coupled;
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

static void push(const kn_sample *s, const double force[3], patch *p)
{
    for (int a = 0; a < p->nodes; a++)
        for (int k = 0; k < 3; k++) p->add[a][k] += s->weight[a] * force[k];
}

// Compute the upper half of dt K for a sample, with the stiffness K = slope n n' + side (1 - n n').
static void stiffness_of(double dt, const kn_sample *s, double k[6])
{
    const double *n = s->normal, side = dt * s->line.side_n_m, along = dt * (s->line.slope_n_m - s->line.side_n_m);
    for (int i = 0, c = 0; i < 3; i++)
        for (int j = i; j < 3; j++, c++) k[c] = along * n[i] * n[j] + (i == j ? side : 0);
}

// Add the stiffness of a sample to the diagonal blocks of the nodes that carry the sample.
static void stiffen(double dt, const kn_sample *s, patch *p)
{
    double k[6];
    stiffness_of(dt, s, k);
    for (int a = 0; a < p->nodes; a++)
        for (int c = 0; c < 6; c++) p->block[a][c] += s->weight[a] * s->weight[a] * k[c];
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
    patch p;
    for (int i = 0; next_patch(m, &scratch->contact, field, i, &p); i += p.count)
        for (kn_sample *s = p.sample; s < p.sample + p.count; s++) rate_of(s, &p, s->rate_m_s);
}

void kn_foundation_push(const kn_model *model, kn_scratch *scratch)
{
    patch p;
    kn_contact *c = &scratch->contact;
    const double dt = model->def.solver.dt_s;
    look(model, scratch, scratch->work.guess);
    // judge the samples with the tools' velocities of the last step; then find the velocities of coupled tools in this
    // step, and judge a second time
    for (int again = 0; again <= c->coupled; again++) {
        for (int i = 0; i < c->sample_count; i++) judge(dt, c, &c->sample[i]);
        balance(model, c, true);
    }
    // add forces to the residual and stiffness to the diagonal blocks, patch by patch
    for (int i = 0; next_patch(model, c, NULL, i, &p); i += p.count) {
        memset(p.block, 0, sizeof p.block);
        for (kn_sample *s = p.sample; s < p.sample + p.count; s++) {
            double force[3], pressing;
            if (!s->line.active) continue;
            force_of(dt, c, s, force, &pressing);
            push(s, force, &p);
            stiffen(dt, s, &p);
        }
        add_to(model, scratch->work.r, &p);
        add_blocks(model, scratch->work.p, &p);
    }
}

// Compute the response v of the coupled tools to skin velocities alone (rate_m_s, from the search direction d), without
// the drive of the coupling.
static void follow_tools(const kn_model *m, kn_contact *c, double v[KN_PROBES_MAX][6])
{
    memset(v, 0, sizeof(double[KN_PROBES_MAX][6]));
    for (int i = 0; i < c->sample_count; i++) {
        const kn_sample *s = &c->sample[i];
        double force[3];
        if (!s->line.active || !coupled(c, s)) continue;
        answer(m->def.solver.dt_s, s, s->rate_m_s, s->rate_m_s, force);
        kn_six_wrench(s->arm_m, force, 1, v[s->probe]);
    }
    // V = G^-1 sum J' dt K d
    for (int p = 0; p < m->def.probe_count; p++)
        if (c->tool[p].coupled) kn_six_solve((const double(*)[6])c->tool[p].factor, v[p]);
}

double kn_foundation_apply(const kn_model *model, kn_scratch *scratch)
{
    patch p;
    kn_contact *c = &scratch->contact;
    double sum = 0, v[KN_PROBES_MAX][6];
    // coupled tools first: all samples of a tool together determine the tool's velocity
    if (c->coupled) {
        look(model, scratch, scratch->work.d);
        follow_tools(model, c, v);
    }
    for (int i = 0; next_patch(model, c, c->coupled ? NULL : scratch->work.d, i, &p); i += p.count) {
        for (kn_sample *s = p.sample; s < p.sample + p.count; s++) {
            double apart[3], force[3];
            if (!s->line.active) continue;
            if (!c->coupled) rate_of(s, &p, s->rate_m_s);
            // apart: velocity of the skin relative to the tool
            memcpy(apart, s->rate_m_s, sizeof apart);
            if (coupled(c, s)) {
                double tool[3];
                kn_six_velocity(v[s->probe], s->arm_m, tool);
                for (int k = 0; k < 3; k++) apart[k] -= tool[k];
            }
            sum += answer(model->def.solver.dt_s, s, apart, s->rate_m_s, force);
            push(s, force, &p);
        }
        add_to(model, scratch->work.q, &p);
    }
    return sum;
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
    patch p;
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
    for (int i = 0; next_patch(model, c, NULL, i, &p); i += p.count) {
        for (kn_sample *s = p.sample; s < p.sample + p.count; s++) {
            double force[3], pressing;
            if (!s->line.active && !s->last.active) continue;
            force_of(dt, c, s, force, &pressing);
            for (int k = 0; k < 3; k++) force[k] -= s->force_n[k];
            push(s, force, &p);
        }
        add_to(model, scratch->work.r, &p);
    }
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
