#include "core/network.h"
#include <math.h>
#include <string.h>

enum { NODES = 2 * KN_ELEMENT_MAX, STAGES = KN_SDIRK_STAGES, NEWTON_MAX = 80 };

// ---- the parts

bool kn_part_thins(const kn_part *p) { return p->beta_per_pa > 0 || p->c_min_pa_s > 0; }

// Return the damping c of a damper at a stress of size `a`, and store the thinning -d ln c/da at this stress.
static double viscosity(const kn_part *p, double a, double *thinning)
{
    *thinning = 0;
    if (!kn_part_thins(p)) return p->modulus;
    bool ramp = p->c_min_pa_s > 0;
    double inside = fmin(fmax(a, p->p0_pa), p->p1_pa), fall = (p->modulus - p->c_min_pa_s) / (p->p1_pa - p->p0_pa);
    double c = ramp ? p->modulus - fall * (inside - p->p0_pa) : p->modulus * exp(-p->beta_per_pa * inside);
    if (a > p->p0_pa && a <= p->p1_pa) *thinning = ramp ? fall / c : p->beta_per_pa;
    return c;
}

// Return the flow rate g(s) of a damper under the stress s, and store the slope dg/ds.
static double flow(const kn_part *p, double s, double *slope)
{
    double thinning, c = viscosity(p, fabs(s), &thinning);
    *slope = (1 + thinning * fabs(s)) / c;
    return s / c;
}

double kn_part_modulus(const kn_network *net, int leaf, double stress_pa)
{
    double thinning;
    return viscosity(&net->part[leaf], fabs(stress_pa), &thinning);
}

static bool is_spring(const kn_element *e, int leaf)
{
    for (int i = 0; i < e->nodes; i++)
        if (e->node[i].kind == KN_ELEMENT_SPRING && e->node[i].leaf == leaf) return true;
    return false;
}

const char *kn_network_check(const kn_network *net, int *leaf)
{
    for (int i = 0; i < net->element.leaves; i++) {
        const kn_part *p = &net->part[i];
        *leaf = i;
        if (!(isfinite(p->modulus) && p->modulus > 0)) return "needs a finite modulus above 0";
        if (!(isfinite(p->beta_per_pa) && p->beta_per_pa >= 0)) return "needs a finite beta, not negative";
        if (!kn_part_thins(p)) continue;
        if (is_spring(&net->element, i)) return "is a spring: only a damper can depend on the stress";
        if (!(isfinite(p->p1_pa) && p->p0_pa >= 0 && p->p0_pa < p->p1_pa)) return "needs 0 <= p0 < p1, finite";
        if (p->beta_per_pa * p->p1_pa > 600) return "has a beta * p1 above 600, beyond the range of a double";
    }
    return NULL;
}

// ---- one stage: the tree as lines D = slope * s + offset

// The line D = slope * s + offset: strain D that a part, or a group of parts, takes up in one stage under the stress s.
typedef struct line {
    double slope, offset;
} line;

typedef struct stage {
    const kn_network *net;
    double h;
    double base[KN_ELEMENT_MAX];  // strain x of each part at the start of the stage
    double guess[KN_ELEMENT_MAX]; // stress of each part at which a force-dependent damper is linearised
    double stress[KN_ELEMENT_MAX];
    double taken[KN_ELEMENT_MAX]; // strain D that each part takes up in the stage
    int8_t at_stop[KN_ELEMENT_MAX];
    line at[NODES];
} stage;

// Linearise one part, equation (1) of network.h. A damper at a stop does not move.
static line leaf_line(const stage *g, const kn_element_node *n)
{
    const kn_part *p = &g->net->part[n->leaf];
    if (n->kind == KN_ELEMENT_SPRING) return (line){1 / p->modulus, -g->base[n->leaf]};
    if (g->at_stop[n->leaf]) return (line){0, 0};
    double slope, s = g->guess[n->leaf], rate = flow(p, s, &slope);
    return (line){g->h * slope, g->h * (rate - slope * s)};
}

// Compose the tree upwards: in series the lines add up, in parallel their inverses add up. In parallel, a rigid member
// makes the group rigid.
static line compose(stage *g, int node)
{
    const kn_element_node *n = &g->net->element.node[node];
    line sum = {0, 0}, rigid = {0, 0};
    bool held = false;
    for (int i = 0; i < n->count; i++) {
        line child = compose(g, n->child[i]);
        if (n->kind == KN_ELEMENT_SERIES) {
            sum.slope += child.slope;
            sum.offset += child.offset;
        } else if (child.slope == 0) {
            held = true;
            rigid = child;
        } else {
            sum.slope += 1 / child.slope;
            sum.offset += child.offset / child.slope;
        }
    }
    if (n->kind < KN_ELEMENT_SERIES) sum = leaf_line(g, n);
    else if (held) sum = rigid;
    else if (n->kind == KN_ELEMENT_PARALLEL) sum = (line){1 / sum.slope, sum.offset / sum.slope};
    return g->at[node] = sum;
}

// Compute the stresses and strains of all parts from the stress s on a node of the tree. In parallel, the stress of
// each member follows from the common strain.
static void hand_down(stage *g, int node, double s)
{
    const kn_element_node *n = &g->net->element.node[node];
    double taken = g->at[node].slope * s + g->at[node].offset, left = s;
    if (n->kind < KN_ELEMENT_SERIES) {
        g->stress[n->leaf] = s;
        g->taken[n->leaf] = taken;
    }
    int rigid = -1;
    for (int i = 0; i < n->count; i++) {
        line child = g->at[n->child[i]];
        double share = s;
        if (n->kind == KN_ELEMENT_PARALLEL) {
            if (child.slope == 0 && rigid < 0) {
                rigid = n->child[i]; // the rigid member carries the stress that the other members do not carry
                continue;
            }
            share = child.slope == 0 ? 0 : (taken - child.offset) / child.slope;
            left -= share;
        }
        hand_down(g, n->child[i], share);
    }
    if (rigid >= 0) hand_down(g, rigid, left);
}

static double strain_of(const kn_element *e, int node, const double *x)
{
    const kn_element_node *n = &e->node[node];
    if (n->kind < KN_ELEMENT_SERIES) return x[n->leaf];
    if (n->kind == KN_ELEMENT_PARALLEL) return strain_of(e, n->child[0], x);
    double sum = 0;
    for (int i = 0; i < n->count; i++) sum += strain_of(e, n->child[i], x);
    return sum;
}

// Return the next guess of Newton's method for the stress of a part. The flow g is convex up to p1 and has a concave
// kink at p1. If a step goes from below p1 to above p1, Newton's method would cycle, so the step ends at p1.
static double next_guess(const kn_part *p, double guess, double stress)
{
    if (fabs(guess) < p->p1_pa && fabs(stress) > p->p1_pa) return copysign(p->p1_pa, stress);
    return stress;
}

// Condition that the drive sets on the whole element in one stage. If `strain` is true, D = taken; otherwise stress =
// fixed - gives * D.
typedef struct demand {
    bool strain;
    double taken, fixed, gives;
} demand;

// Solve one stage: linearise the parts, meet the drive's condition, compute the stresses of the parts. Repeat until the
// guessed stresses agree with the computed ones. Return false if they never do.
static bool solve(stage *g, const demand *want, double *root_stress)
{
    const kn_element *e = &g->net->element;
    for (int i = 0; i < NEWTON_MAX; i++) {
        line all = compose(g, e->root);
        double s = want->strain ? (want->taken - all.offset) / all.slope
                                : (want->fixed - want->gives * all.offset) / (1 + want->gives * all.slope);
        if (want->strain && all.slope == 0) s = 0; // the element is rigid, and its prescribed strain does not change
        if (!isfinite(s)) return false;
        hand_down(g, e->root, s);
        double change = 0, size = 0;
        for (int k = 0; k < e->leaves; k++) {
            const kn_part *p = &g->net->part[k];
            size = fmax(size, fabs(g->stress[k]));
            if (!kn_part_thins(p) || g->at_stop[k]) continue;
            double next = next_guess(p, g->guess[k], g->stress[k]);
            change = fmax(change, fmax(fabs(next - g->guess[k]), fabs(next - g->stress[k])));
            g->guess[k] = next;
        }
        *root_stress = s;
        if (change <= 1e-12 * size || g->h == 0) return true; // with h = 0 the dampers are rigid: the stage is linear
    }
    return false;
}

// ---- stops

#define ARRIVED 1e-12 // strain from a stop at which a damper counts as at the stop

// Return the fraction of a step after which the first damper meets a stop, or after which the stress of a damper at a
// stop changes sign. Return 1 if neither happens within the step.
static double first_event(const kn_network *net, const kn_network_state *from, const kn_network_state *to)
{
    double first = 1;
    for (int i = 0; i < net->element.leaves; i++) {
        const kn_part *p = &net->part[i];
        double x0 = from->part_strain[i], x1 = to->part_strain[i], s0 = from->part_stress[i], s1 = to->part_stress[i];
        if (!p->stroke) continue;
        if (from->at_stop[i] == 0 && x1 > p->stop[1] + ARRIVED) first = fmin(first, (p->stop[1] - x0) / (x1 - x0));
        if (from->at_stop[i] == 0 && x1 < p->stop[0] - ARRIVED) first = fmin(first, (p->stop[0] - x0) / (x1 - x0));
        if (from->at_stop[i] * s1 < 0) first = fmin(first, from->at_stop[i] * s0 > 0 ? s0 / (s0 - s1) : 0);
    }
    return fmax(first, 0);
}

// Update the stops: a damper that reached a stop is at the stop from now on, and a damper whose stress has changed sign
// is free. Return true if any damper changed.
static bool settle(const kn_network *net, kn_network_state *state)
{
    bool changed = false;
    for (int i = 0; i < net->element.leaves; i++) {
        const kn_part *p = &net->part[i];
        double *x = &state->part_strain[i], s = state->part_stress[i];
        int8_t was = state->at_stop[i];
        if (!p->stroke) continue;
        if (was * s < 0) state->at_stop[i] = 0;
        if (s > 0 && *x >= p->stop[1] - ARRIVED) state->at_stop[i] = 1;
        if (s < 0 && *x <= p->stop[0] + ARRIVED) state->at_stop[i] = -1;
        if (state->at_stop[i]) *x = p->stop[state->at_stop[i] > 0];
        changed = changed || state->at_stop[i] != was;
    }
    return changed;
}

// ---- the bench

static double drive_strain(const kn_drive *d, double t)
{
    double since = t - d->start_s;
    return d->value + d->rate_per_s * since + d->amplitude * sin(d->omega * since);
}

static double drive_strain_rate(const kn_drive *d, double t)
{
    return d->rate_per_s + d->amplitude * d->omega * cos(d->omega * (t - d->start_s));
}

// Return the condition that the drive sets at time t. A strain is prescribed by its rate, so that the parts always obey
// an ordinary differential equation. If a strain were prescribed by its value, the rate of a dashpot that follows the
// strain at once would come from differences, and the order of the method would fall.
static demand demand_at(const stage *g, const kn_drive *d, double t)
{
    const kn_element *e = &g->net->element;
    double strain = strain_of(e, e->root, g->base);
    if (d->kind == KN_DRIVE_STRAIN)
        return (demand){.strain = true,
                        .taken = g->h > 0 ? g->h * drive_strain_rate(d, t) : drive_strain(d, t) - strain};
    if (d->kind == KN_DRIVE_LOAD) return (demand){.fixed = d->value * (1 - strain), .gives = d->value};
    return (demand){.fixed = d->value};
}

static stage stage_from(const kn_network *net, const kn_network_state *state, double h)
{
    stage g = {.net = net, .h = h};
    memcpy(g.base, state->part_strain, sizeof g.base);
    memcpy(g.guess, state->part_stress, sizeof g.guess);
    memcpy(g.at_stop, state->at_stop, sizeof g.at_stop);
    return g;
}

// Compute strain and stress between the ends from the strains of the parts. If a dashpot follows the drive's strain at
// once, the stress depends on the rate of the strain. The stress is therefore computed in a stage that is too short to
// change any strain.
static bool observe(const kn_network *net, kn_network_state *state, const kn_drive *drive)
{
    const double instant = 1e-15; // duration of the short stage [s]: far below the time constants of any material
    stage g = stage_from(net, state, instant);
    demand want = demand_at(&g, drive, state->time_s);
    state->strain = strain_of(&net->element, net->element.root, g.base);
    if (!solve(&g, &want, &state->stress_pa)) return false;
    for (int i = 0; i < net->element.leaves; i++)
        if (net->part[i].stroke) state->part_stress[i] = g.stress[i]; // a new drive may change the sign of this stress
    return true;
}

bool kn_network_jump(const kn_network *net, kn_network_state *state, const kn_drive *drive)
{
    stage g = stage_from(net, state, 0);
    demand want = demand_at(&g, drive, state->time_s);
    kn_network_state before = *state;
    double s;
    // a rigid element cannot follow a jump of strain
    bool rigid = compose(&g, net->element.root).slope == 0;
    if (rigid && want.strain && fabs(want.taken) > 1e-12) return false;
    if (!solve(&g, &want, &s)) return false;
    for (int i = 0; i < net->element.leaves; i++) state->part_strain[i] += g.taken[i];
    state->step_s = 0;
    // the jump may bring dampers to a stop, or free them
    if (observe(net, state, drive) && (!settle(net, state) || observe(net, state, drive))) return true;
    *state = before;
    return false;
}

// ---- time

// Return the largest local error of a step, relative to the largest strain. It is the error of the strain of a damper,
// or of the prescribed strain of the whole element. The strains of springs follow from the strains of dampers, so they
// have no error of their own.
static double error_of(const kn_network *net, const kn_network_state *state, kn_network_state *next,
                       const kn_drive *drive, double (*taken)[KN_ELEMENT_MAX])
{
    const kn_element *e = &net->element;
    double error = 0;
    for (int n = 0; n < e->nodes; n++) {
        int i = e->node[n].leaf;
        double difference = 0;
        if (e->node[n].kind >= KN_ELEMENT_SERIES) continue;
        next->largest = fmax(next->largest, fabs(next->part_strain[i]));
        if (e->node[n].kind == KN_ELEMENT_SPRING) continue;
        for (int j = 0; j < STAGES; j++) difference += kn_sdirk_error[j] / KN_SDIRK_GAMMA * taken[j][i];
        error = fmax(error, fabs(difference));
    }
    if (drive->kind == KN_DRIVE_STRAIN) {
        double made = strain_of(e, e->root, next->part_strain) - strain_of(e, e->root, state->part_strain);
        error = fmax(error, fabs(made - (drive_strain(drive, next->time_s) - drive_strain(drive, state->time_s))));
    }
    return error > 0 ? error / next->largest : 0;
}

// Take one step of length h into `next`. Return the local error relative to the largest strain, infinite if Newton's
// method fails.
static double step(const kn_network *net, const kn_network_state *state, const kn_drive *drive, double h,
                   kn_network_state *next)
{
    double taken[STAGES][KN_ELEMENT_MAX] = {0}; // D of each part in each stage: KN_SDIRK_GAMMA h times its rate
    stage g = stage_from(net, state, KN_SDIRK_GAMMA * h);
    for (int j = 0; j < STAGES; j++) {
        for (int i = 0; i < net->element.leaves; i++) {
            g.base[i] = state->part_strain[i];
            for (int m = 0; m < j; m++) g.base[i] += kn_sdirk_row[j][m] / KN_SDIRK_GAMMA * taken[m][i];
        }
        demand want = demand_at(&g, drive, state->time_s + kn_sdirk_time[j] * h);
        if (!solve(&g, &want, &next->stress_pa)) return INFINITY;
        memcpy(taken[j], g.taken, sizeof g.taken);
    }
    for (int i = 0; i < net->element.leaves; i++) next->part_strain[i] = g.base[i] + g.taken[i];
    memcpy(next->part_stress, g.stress, sizeof g.stress);
    next->time_s = state->time_s + h;
    return error_of(net, state, next, drive, taken);
}

bool kn_network_advance(const kn_network *net, kn_network_state *state, const kn_drive *drive, double until_s,
                        double tolerance)
{
    const double shortest = 1e-14 * fmax(until_s, 1e-3);
    if (state->step_s <= 0) state->step_s = 1e-6 * (until_s - state->time_s);
    while (until_s - state->time_s > shortest) {
        double h = fmin(state->step_s, until_s - state->time_s);
        kn_network_state next = *state;
        double error = step(net, state, drive, h, &next) / tolerance;
        // choose the next step length by the error; repeat the step if its error is too large
        double factor = fmin(fmax(0.9 * pow(error, -0.25), 0.1), 4);
        if (error > 1) {
            if (h <= shortest) return false;
            state->step_s = h * factor;
            state->rejected++;
            continue;
        }
        // a step that passes a stop is repeated so that it ends there
        double event = first_event(net, state, &next);
        if (event < 1 - 1e-6 && h > shortest) {
            state->step_s = fmax(h * event, shortest);
            continue;
        }
        settle(net, &next);
        // if until_s made this step shorter than state->step_s, the next step may again be state->step_s long
        next.step_s = fmax(h * factor, h < state->step_s ? state->step_s : 0);
        next.steps = state->steps + 1;
        next.rejected = state->rejected;
        *state = next;
    }
    state->time_s = until_s;
    return observe(net, state, drive);
}

// ---- conversion of the papers' material to an element, and back

static kn_network from_text(const char *text)
{
    kn_network net = {0};
    char error[64];
    kn_element_parse(&net.element, text, error, sizeof error); // cannot fail: the callers' texts are valid
    return net;
}

kn_network kn_network_of(const kn_material *mat)
{
    static const char *const text[2][4] = {{"", "s", "d", "s|d"}, {"", "s-d", "d-d", "(s|d)-d"}};
    double in, out;
    bool damper = !kn_material_stroke(mat, &in, &out);
    kn_network net = from_text(text[damper][(mat->k1_pa > 0) + 2 * (mat->c1_pa_s > 0)]);
    int at = 0;
    if (mat->k1_pa > 0) net.part[at++].modulus = mat->k1_pa;
    if (mat->c1_pa_s > 0) net.part[at++].modulus = mat->c1_pa_s;
    if (!damper) return net;
    if (mat->damper == KN_DAMPER_CONSTANT) net.part[at].modulus = mat->c2_pa_s;
    if (mat->damper == KN_DAMPER_EXPONENTIAL)
        net.part[at] = (kn_part){
            .modulus = mat->alpha_pa_s, .beta_per_pa = mat->beta_per_pa, .p0_pa = mat->p0_pa, .p1_pa = mat->p1_pa};
    if (mat->damper == KN_DAMPER_RAMP)
        net.part[at] = (kn_part){
            .modulus = mat->c_max_pa_s, .p0_pa = mat->p0_pa, .p1_pa = mat->p1_pa, .c_min_pa_s = mat->c_min_pa_s};
    net.part[at].stroke = mat->stroke[1] > 0;
    // compression is positive in a network and negative in a material: the stops change sign and swap places
    if (net.part[at].stroke) net.part[at].stop[0] = -out, net.part[at].stop[1] = -in;
    return net;
}

static void set_damper(kn_material *mat, const kn_part *p)
{
    mat->damper = p->beta_per_pa > 0 ? KN_DAMPER_EXPONENTIAL : p->c_min_pa_s > 0 ? KN_DAMPER_RAMP : KN_DAMPER_CONSTANT;
    mat->c2_pa_s = mat->alpha_pa_s = p->modulus;
    mat->beta_per_pa = p->beta_per_pa;
    mat->p0_pa = p->p0_pa;
    mat->p1_pa = p->p1_pa;
    mat->c_max_pa_s = p->modulus;
    mat->c_min_pa_s = p->c_min_pa_s;
}

// Set k1 of the material from a spring, or c1 from a linear damper. Return false if the node is another kind of part,
// or if the material already has this modulus.
static bool take_voigt(const kn_network *net, const kn_element_node *n, kn_material *mat)
{
    double *to = n->kind == KN_ELEMENT_SPRING ? &mat->k1_pa : &mat->c1_pa_s;
    if (n->kind >= KN_ELEMENT_SERIES || *to > 0 || kn_part_thins(&net->part[n->leaf])) return false;
    *to = net->part[n->leaf].modulus;
    return true;
}

// Set k1 and c1 of the material from a spring, a linear damper, or both in parallel. Return false if the node is
// anything else.
static bool take_part(const kn_network *net, int node, kn_material *mat)
{
    const kn_element_node *n = &net->element.node[node];
    if (n->kind != KN_ELEMENT_PARALLEL) return take_voigt(net, n, mat);
    for (int i = 0; i < n->count; i++)
        if (!take_voigt(net, &net->element.node[n->child[i]], mat)) return false;
    return true;
}

bool kn_network_material(const kn_network *net, kn_material *mat)
{
    const kn_element *e = &net->element;
    const kn_element_node *n = &e->node[e->root];
    *mat = (kn_material){.damper = KN_DAMPER_NONE};
    if (n->kind != KN_ELEMENT_SERIES) return take_part(net, e->root, mat);
    if (n->count != 2) return false;
    // one member must be the damper c2, the other a part of a Voigt element; if both orders are possible, c2 is the
    // last member
    for (int last = 1; last >= 0; last--) {
        const kn_element_node *d = &e->node[n->child[last]];
        *mat = (kn_material){.damper = KN_DAMPER_NONE};
        if (d->kind != KN_ELEMENT_DAMPER || !take_part(net, n->child[!last], mat)) continue;
        set_damper(mat, &net->part[d->leaf]);
        return true;
    }
    return false;
}
