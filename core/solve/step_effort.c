#include "core/solve/step_effort.h"
#include "core/lattice/lattice.h"

#include <math.h>
#include <string.h>

// --- impacts --------------------------------------------------------------------------------------------------------

// Return the difference of velocity between the ends of an edge of one spacing at which the edge begins to flow, m/s.
static double flow_velocity(const kn_model *m) { return m->law.s1_pa / m->law.a_pa_s * m->gamma * m->def.spacing_m; }

// Compare the motion of the nodes under plates with the limits. Return the larger of two ratios: change of velocity to
// the limit KN_IMPACT_RATE, and path in this step to the limit KN_IMPACT_WAY. Above 1 the step is an impact.
static double carried(const kn_model *m, const kn_state *state, const kn_contact *contact)
{
    double h = m->def.spacing_m, flow_m_s = flow_velocity(m), change = 0, way = 0;
    for (int i = 0; i < contact->hold_count; i++) {
        const kn_held_node *hold = &contact->hold[i];
        // left: ratio of the node's present height to its height at rest
        double x[3], high = m->rest_m[hold->node][2], left = 1;
        kn_state_position(m, state, hold->node, x);
        if (high > 0) left = fmin(1, fmax(0.02, x[2] / high));
        for (size_t k = hold->slides ? 2 : 0; k < 3; k++) {
            double now = kn_real_get(m, state->velocity, m->offset[hold->node] + k * m->stride);
            change = fmax(change, fabs(hold->velocity_m_s[k] - now));
            way = fmax(way, fabs(hold->velocity_m_s[k]) * m->def.solver.dt_s / (h * left));
        }
    }
    return fmax(change / flow_m_s / KN_IMPACT_RATE, way / KN_IMPACT_WAY);
}

// Return the ratio of the largest change of pressure in this step to the limit KN_IMPACT_PRESS, for tools other than
// plates. The change is estimated as if the skin kept the velocity of the guess. Above 1 the step is an impact.
static double pressed(const kn_model *m, const kn_contact *contact)
{
    double most = 0;
    for (int i = 0; i < contact->sample_count; i++) {
        const kn_sample *sample = &contact->sample[i];
        if (!sample->line.active || sample->probe == KN_TABLE) continue;
        // the rate of the pressure is the foundation's stiffness times the velocity of the skin relative to the tool
        most =
            fmax(most, kn_probe_foundation(&m->def.probe[sample->probe]) * fabs(kn_sample_gap_rate(contact, sample)));
    }
    return most * m->def.solver.dt_s / m->law.s1_pa / KN_IMPACT_PRESS;
}

// Return true if every step needs several linearisations, because the law yields suddenly.
static bool bends(const kn_model *model)
{
    const kn_material *mat = &model->law.mat;
    return model->law.s1_pa > 0 && kn_material_thinning(mat, mat->p1_pa) * mat->p1_pa > KN_IMPACT_BEND;
}

bool kn_step_is_long(const kn_model *model) { return model->law.s1_pa > 0 && model->def.solver.dt_s >= KN_LONG_S; }

bool kn_step_on_demand(const kn_model *model, int passes)
{
    return kn_step_is_long(model) && passes == 1 && !bends(model);
}

double kn_step_law(const kn_model *model, bool held)
{
    const double law = model->def.pressure == KN_PRESSURE_NONE ? KN_LONG_LAW : KN_LONG_LAW_GAS;
    return held ? fmin(law, KN_LONG_LAW_PLATE_S / model->def.solver.dt_s) : law;
}

int kn_impact_lines(const kn_model *model, int passes)
{
    if (kn_step_is_long(model) && passes == 1) return KN_LONG_LINES;
    return bends(model) && passes < 4 ? 4 : passes;
}

double kn_impact_power(const kn_model *model)
{
    const kn_law *law = &model->law;
    if (!(law->s1_pa > 0)) return INFINITY;
    // flow_n: force of an edge that begins to flow; flow_w: power of this force in the norm r.z, force^2 / damping
    double flow_n = law->s1_pa * model->gamma * model->def.spacing_m * model->kappa_m;
    double flow_w = flow_n * flow_n / (model->kappa_m * law->a_pa_s);
    return KN_IMPACT_POWER * model->node_count * flow_w;
}

bool kn_impact(const kn_model *model, const kn_state *state, const kn_contact *contact, double rz)
{
    if (!(model->law.s1_pa > 0)) return false;
    double power = kn_impact_power(model);
    // soon after an impact, a tenth of the power already counts as an impact
    double least = state->residual_scale > KN_IMPACT_RECENT * power ? KN_IMPACT_AFTER : 1;
    return rz > least * power || carried(model, state, contact) > 1 || pressed(model, contact) > 1;
}

typedef struct punch { // a plate that strikes the object from above; letters a, h as in step_effort.h
    double down_m_s, middle_m[2], half_m[2], top_m, a_m, h_m;
    float rest; // the field is 0 where the velocity is below `rest` times the plate's velocity
} punch;

// Describe the strike of one plate from the nodes that the plate holds. Return false if the plate does not strike fast.
static bool punch_of(const kn_model *m, const kn_state *state, const kn_contact *contact, int probe, punch *plate)
{
    // add up the changes of velocity and the heights of the held nodes, and find the bounds of their positions
    double low_m[2] = {INFINITY, INFINITY}, high_m[2] = {-INFINITY, -INFINITY}, change[3] = {0}, top_m = 0;
    int count = 0;
    for (int i = 0; i < contact->hold_count; i++) {
        const kn_held_node *hold = &contact->hold[i];
        const double *rest_m = m->rest_m[hold->node];
        if (hold->probe != probe) continue;
        for (size_t k = hold->slides ? 2 : 0; k < 3; k++)
            change[k] += hold->velocity_m_s[k] - kn_real_get(m, state->velocity, m->offset[hold->node] + k * m->stride);
        for (int k = 0; k < 2; k++) {
            low_m[k] = fmin(low_m[k], rest_m[k]);
            high_m[k] = fmax(high_m[k], rest_m[k]);
        }
        top_m += rest_m[2];
        count++;
    }
    if (count == 0 || !(top_m > 0)) return false;
    // a node stands for a square of one spacing, so the plate reaches half a spacing beyond its outer nodes
    for (int k = 0; k < 2; k++) {
        plate->middle_m[k] = 0.5 * (low_m[k] + high_m[k]);
        plate->half_m[k] = 0.5 * (high_m[k] - low_m[k] + m->def.spacing_m);
    }
    plate->a_m = sqrt(plate->half_m[0] * plate->half_m[1]);
    plate->top_m = top_m / count;
    plate->h_m = m->def.spacing_m;
    plate->down_m_s = -change[2] / count;
    // parts of the object whose strain rate is below KN_IMPACT_REST times the rate at which edges flow are taken to be
    // at rest
    plate->rest = (float)(KN_IMPACT_REST * flow_velocity(m) / m->def.spacing_m * plate->top_m / plate->down_m_s);
    return plate->down_m_s > KN_IMPACT_BLOW * flow_velocity(m) && plate->rest < 1 &&
           change[2] * change[2] > change[0] * change[0] + change[1] * change[1]; // the plate moves mostly downwards
}

// Evaluate the guessed velocity field at the rest position of one node, by the formulas and letters of step_effort.h.
static void punch_at(const punch *p, const double rest_m[3], float velocity_m_s[3])
{
    const float h = (float)p->h_m, a = (float)p->a_m, top = (float)p->top_m,
                d = fmaxf(0, (float)(p->top_m - rest_m[2]));
    const float x = (float)(rest_m[0] - p->middle_m[0]), y = (float)(rest_m[1] - p->middle_m[1]);
    // way: distance R from the plate's rectangle; d: depth below the plate
    const float beside_x = fmaxf(0, fabsf(x) - (float)p->half_m[0]),
                beside_y = fmaxf(0, fabsf(y) - (float)p->half_m[1]);
    const float beside2 = beside_x * beside_x + beside_y * beside_y, way = sqrtf(beside2 + d * d) + 1e-9f;
    // off: distance r' from the centre of the plate; h keeps r' above zero
    const float off2 = x * x + y * y + d * d + h * h, off = sqrtf(off2);
    // down: downward velocity relative to the plate's velocity, interpolated between surface and axis
    const float surface = a / (a + 1.2f * sqrtf(way * a) + 0.8f * way);
    const float axis = a * a / (a * a + 0.15f * way * a + 0.22f * way * way);
    // reduce the field towards the base and the sides, and set it to 0 in the slow part; under the plate the field
    // stays 1
    const float down = surface + (axis - surface) * d / way, share = down * (float)rest_m[2] / (top + sqrtf(beside2));
    const float v = (float)p->down_m_s * fmaxf(0, share - p->rest) / (down * (1 - p->rest));
    // out: outward velocity per metre of distance from the axis, divided by the downward velocity v [1/m]
    const float out = a / off * (0.42f * d / off2 - 0.21f / (off + d));
    velocity_m_s[0] = v * out * x;
    velocity_m_s[1] = v * out * y;
    velocity_m_s[2] = -v * down;
}

bool kn_impact_guess(const kn_model *model, const kn_state *state, kn_work *work, const kn_contact *contact)
{
    bool any = false;
    if (!(model->law.s1_pa > 0)) return false;
    for (int p = 0; p < model->def.probe_count; p++) {
        punch plate;
        if (!punch_of(model, state, contact, p, &plate)) continue;
        any = true;
        // add the field to every free component of the guess
        for (int node = 0; node < model->node_count; node++) {
            float v[3];
            punch_at(&plate, model->rest_m[node], v);
            for (size_t k = 0; k < 3; k++) {
                const size_t o = model->offset[node] + k * model->stride;
                if (kn_real_get(model, work->free, o) != 0) kn_real_add(model, work->guess, o, (double)v[k]);
            }
        }
    }
    if (any) memset(work->row_moved, 1, (size_t)model->row_count);
    return any;
}

// --- deadline -------------------------------------------------------------------------------------------------------

// Prices: estimated units of work for each part of a step. A price is per lane (LANE, NET, GAS, RIGID, COARSE), per
// cell of a net (CELL), per tied node (TIE), per sample (SAMPLE) or per held node (HOLD). LINE is one linearisation of
// the law, ITERATION one iteration. The prices are nanoseconds on a Sapphire Rapids in f32, fitted to the ticks of
// bench_strike. If a price is too small, steps with much of this part take longer than estimated. If a price is too
// large, the deadline caps such steps too early.
enum {
    STEP = 10000,
    LANE_LINE = 45,
    LANE_ITERATION = 5,
    NET_LINE = 42,
    NET_ITERATION = 9,
    GAS_LINE = 20,
    GAS_ITERATION = 2,
    CELL_LINE = 11,
    CELL_ITERATION = 5,
    TIE_LINE = 50,
    TIE_ITERATION = 15, // per tied node and per iteration
    RIGID_LINE = 30,
    RIGID_ITERATION = 12,
    COARSE_ITERATION = 1,
    COARSE_UNIT = 16,   // elements of the inverse coarse matrix that are multiplied in one unit of work
    NEWTON_LINE = 1700, // per lane and per linearisation, if Newton's method solves the law edge by edge
    LAW = 4,            // without Newton's method, evaluating the law takes 1/LAW of the time of a linearisation
    F64_TIMES = 2,
    SAMPLE_FIND = 100,
    SAMPLE_LINE = 80,
    SAMPLE_ITERATION = 10,
    SAMPLE_LOOK = 60, // per sample and per look at the contact; all SAMPLE prices are doubled if a tool is coupled
    HOLD_LINE = 20,
    NODE_GUESS = 18
};

// A linearisation is worth its time only if at least this number of iterations follows.
#define LINE_ITERATIONS 4

// Return the costs, without contact, of a linearisation and of an iteration. `held`: a plate holds nodes in this step,
// so the rigid motions are not used (solver_implicit.c).
static kn_deadline of_lattice(const kn_model *m, bool held)
{
    const int64_t lanes = (int64_t)kn_model_field(m, 1), cells = m->def.mesh ? m->cell_count : lanes;
    const bool mesh = m->def.mesh != NULL;
    kn_deadline d = {.line = lanes * (mesh ? NET_LINE : LANE_LINE),
                     .iteration = lanes * (mesh ? NET_ITERATION : LANE_ITERATION)};
    // gas adds the work of the cells, and f64 takes twice the time of f32
    if (m->def.pressure != KN_PRESSURE_NONE) {
        d.line += cells * (mesh ? CELL_LINE : GAS_LINE);
        d.iteration += cells * (mesh ? CELL_ITERATION : GAS_ITERATION);
    }
    if (m->coarse)
        d.iteration += lanes * COARSE_ITERATION + m->coarse->unknowns * (int64_t)m->coarse->padded / COARSE_UNIT;
    const bool f64 = m->def.solver.precision == KN_PRECISION_F64;
    if (f64) d.line *= F64_TIMES, d.iteration *= F64_TIMES;
    d.law = d.line / LAW;
    // a law without an accurate table is solved by Newton's method, edge by edge
    if (m->law.kind == KN_LAW_EXACT && !(f64 && kn_law_in_lanes(&m->law)))
        d.line += lanes * NEWTON_LINE, d.law += lanes * NEWTON_LINE;
    if (m->composite) d.line += kn_composite_tied(m) * TIE_LINE, d.iteration += kn_composite_tied(m) * TIE_ITERATION;
    if (kn_rigid_wanted(m) && !held) d.line += lanes * RIGID_LINE, d.iteration += lanes * RIGID_ITERATION;
    return d;
}

void kn_deadline_begin(kn_deadline *deadline, const kn_model *model, const kn_contact *contact, int64_t most)
{
    // if any tool is coupled, the price of every sample is doubled
    const int64_t samples = contact->sample_count * (int64_t)(1 + contact->coupled);
    kn_deadline d = of_lattice(model, contact->hold_count > 0);
    d.most = most;
    d.spent = STEP + samples * SAMPLE_FIND;
    // contact adds units to every linearisation and every iteration
    d.line += samples * SAMPLE_LINE + contact->hold_count * (int64_t)HOLD_LINE;
    d.iteration += samples * SAMPLE_ITERATION;
    // a look that changes a sample needs a new residual, which takes about as long as an iteration
    if (samples > 0) d.look = samples * SAMPLE_LOOK + d.iteration;
    *deadline = d;
}

bool kn_deadline_line(kn_deadline *d, bool first)
{
    const int64_t price = d->line + d->look;
    // the first linearisation is always taken
    if (!first && d->most > 0 && d->spent + price + KN_DEADLINE_LEAST * d->iteration > d->most) return false;
    d->spent += price;
    return true;
}

// The price of a guess is an upper bound: one visit of all nodes per probe, and one evaluation of the law. After a
// guess, the first linearisation evaluates the law a second time.
int64_t kn_deadline_guess(const kn_deadline *d, const kn_model *model, int lines, int iterations)
{
    // make no guess if the step has no deadline, or if all linearisations fit into it
    if (d->most == 0 || d->spent + lines * (d->line + d->look + iterations * d->iteration) <= d->most) return 0;
    const int64_t price = model->def.probe_count * model->node_count * (int64_t)NODE_GUESS + d->law;
    // make no guess if it would leave too little time for one linearisation
    return d->spent + price + d->line + d->look + KN_DEADLINE_LEAST * d->iteration > d->most ? 0 : price;
}

void kn_deadline_share(kn_deadline *d, int lines, int iterations)
{
    const int64_t room = d->most - d->spent, price = d->line + d->look, few = LINE_ITERATIONS * d->iteration;
    // longest: largest number of work units that one linearisation can take after it has begun, including a second look
    const int64_t longest = d->look + iterations * d->iteration;
    d->line_most = d->most;
    d->hurried = false;
    // do not hurry if there is no deadline, if this linearisation is the only one, or if there is time for all
    // linearisations
    if (d->most == 0 || lines == 1 || lines * longest + (lines - 1) * price <= room) return;
    // fitting: number of linearisations that fit with LINE_ITERATIONS iterations each
    int64_t fitting = 1 + (room - few) / (price + few);
    if (fitting > lines) fitting = lines;
    if (fitting < 2) return;
    // give each linearisation an equal share, although the first ones need more than the last ones
    d->line_most = d->spent + room / fitting;
    d->hurried = true;
}

bool kn_deadline_spend(kn_deadline *d, int64_t units)
{
    if (d->most > 0 && d->spent + units > d->line_most) return false;
    d->spent += units;
    return true;
}

bool kn_deadline_iterate(kn_deadline *d, int done)
{
    if (d->hurried || done >= KN_DEADLINE_LEAST) return kn_deadline_spend(d, d->iteration);
    d->spent += d->iteration;
    return true;
}

int64_t kn_deadline_least(const kn_model *model)
{
    const kn_deadline d = of_lattice(model, false);
    return STEP + d.line + KN_DEADLINE_LEAST * d.iteration;
}
