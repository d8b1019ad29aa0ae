#include "core/contact_fit.h"
#include "core/local/patch.h"
#include "core/solve/solver.h"
#include "core/shape.h"
#include "core/solve/tool.h"
#include "core/algebra/algebra.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ITERATIONS 2   // number of iterations of the mobility solve (patch.h) per step
#define MEMORY_S 0.020 // time constant of the least-squares fit of c2, the damping of the force-dependent damper
#define REACH 3.0      // largest distance at which a plane ahead of the tool is reported, in radii of the tool
#define PLATE_M 0.01   // radius used for a plate
#define PROBE_M 1e-4   // step of the difference quotient for the gradient of the distance
#define VALID_MS 100.0
#define LATE_S 0.030  // round trip of the slowest link that a local model is meant for
#define CLIENT_S 1e-3 // step of a client, for which A is reported

typedef struct pressed {      // one contact: the whole contact of a tool, or one patch of this contact
    double force_n, rate_m_s; // force_n: contact force t; rate_m_s: speed w at which the tool presses the skin inwards
    // normal: normal out of the object; arm_m: vector from the tool's position to the point where the force acts
    double normal[3], arm_m[3];
    double layer_n_m;  // stiffness of the contact's foundation along the normal; 0: rigid
    double a, k1, h_n; // a: damping A; k1: stiffness; h_n: force H of contact_model.h; 0: not known yet
    // tt, tw: fading sums of t^2 and of t w_c2, where w_c2 is the rate of the damper c2; c2: the quotient tt/tw
    double tt, tw, c2;
    double loaded; // share of the load of the running mobility solve that acts on this contact; 0: no load
} pressed;

typedef struct fitted { // one probe's contact
    // touching: the tool touches the object; near: the tool touches the object, or is within reach of it in a known
    // direction; ahead: the last call of look_ahead found the tool in air
    bool touching, near, ahead;
    pressed all, patch[KN_PATCHES_MAX];
    unsigned used; // bit i is set if patch[i] is in use
    int only;      // if exactly one patch is in use: index of this patch
    kn_place place[KN_PATCHES_MAX];
    int places;       // number of places where the tool will touch next, besides the present contact
    double side_n[3]; // tangential part of the force on the tool
    // tool_m: position of the tool; gap_m: distance of the tool from the object; gradient: gradient of this distance
    double tool_m[3], gap_m, gradient[3];
} fitted;

struct kn_contact_fit {
    const kn_model *model;
    kn_coupling device;
    kn_mobility *mobility;
    kn_patches *patches;
    // search for the next places that each tool touches; NULL if the tool has one convex part
    kn_ahead *ahead[KN_PROBES_MAX];
    fitted probe[KN_PROBES_MAX];
    int *skin; // ids of the skin's nodes that a tool can touch
    int skin_count;
    int round; // index of the probe for which a mobility solve (patch.h) is running; -1: none
};

// --- the object's outside -------------------------------------------------------------------------------------------

// List the nodes of the skin. Inner nodes are left out, because they have no neighbours on the skin.
static bool list_skin(kn_contact_fit *fit)
{
    fit->skin = malloc((size_t)fit->model->node_count * sizeof *fit->skin);
    for (int i = 0, near; fit->skin && i < fit->model->node_count; i++) {
        kn_patches_near(fit->patches, i, &near);
        if (near > 0) fit->skin[fit->skin_count++] = i;
    }
    return fit->skin_count > 0;
}

// Return the node of the skin nearest to a point. The search visits all nodes of the skin. It runs once per mobility
// solve, and only while the tool is in air.
static int nearest_node(const kn_contact_fit *fit, const kn_state *state, const double at[3])
{
    double best = INFINITY;
    int node = fit->skin[0];
    for (int i = 0; i < fit->skin_count; i++) {
        double x[3], d = 0;
        kn_state_position(fit->model, state, fit->skin[i], x);
        for (int k = 0; k < 3; k++) d += (x[k] - at[k]) * (x[k] - at[k]);
        if (d < best) best = d, node = fit->skin[i];
    }
    return node;
}

// --- create ---------------------------------------------------------------------------------------------------------

kn_contact_fit *kn_contact_fit_create(const kn_model *model, kn_coupling device)
{
    kn_contact_fit *fit = calloc(1, sizeof *fit);
    if (!fit) return NULL;
    fit->model = model;
    fit->device = device;
    fit->mobility = kn_mobility_create(model);
    fit->patches = kn_patches_create(model);
    for (int p = 0; p < model->def.probe_count && fit->patches; p++)
        fit->ahead[p] = kn_ahead_create(model, fit->patches, p, REACH * model->shape[p].fine_m);
    if (fit->mobility && fit->patches && list_skin(fit)) {
        kn_contact_fit_reset(fit);
        return fit;
    }
    kn_contact_fit_destroy(fit);
    return NULL;
}

void kn_contact_fit_destroy(kn_contact_fit *fit)
{
    if (!fit) return;
    kn_mobility_destroy(fit->mobility);
    for (int p = 0; p < KN_PROBES_MAX; p++) kn_ahead_destroy(fit->ahead[p]);
    kn_patches_destroy(fit->patches);
    free(fit->skin);
    free(fit);
}

void kn_contact_fit_reset(kn_contact_fit *fit)
{
    memset(fit->probe, 0, sizeof fit->probe);
    kn_patches_reset(fit->patches);
    for (int p = 0; p < KN_PROBES_MAX; p++)
        if (fit->ahead[p]) kn_ahead_reset(fit->ahead[p]);
    fit->round = -1;
}

// --- contact of the last step ---------------------------------------------------------------------------------------

// Return the velocity of the skin at a sample, along the direction in which the tool pushes.
static double skin_rate(const kn_model *m, const kn_state *state, const kn_sample *s)
{
    double v[3];
    kn_sample_velocity(m, s, state->velocity, v);
    return kn_dot(s->normal, v);
}

static bool several(const fitted *f) { return (f->used & (f->used - 1)) != 0; }

static int count_of(unsigned used)
{
    int count = 0;
    for (; used; used &= used - 1) count++;
    return count;
}

// Return the patch of a sample; `node`: the nodes that carry the sample. A node that is pressed for the first time
// belongs to no patch yet. If the middle node belongs to no patch, take the patch of another node. If none of the nodes
// belongs to a patch, take the first patch in use.
static int patch_of(const kn_contact_fit *fit, int p, const int node[], int nodes)
{
    int number = kn_patches_at(fit->patches, p, node[nodes / 2]); // the middle node of a spline's 3 x 3 nodes
    for (int a = 0; a < nodes && number < 0; a++) number = kn_patches_at(fit->patches, p, node[a]);
    for (int i = 0; number < 0; i++)
        if (fit->probe[p].used >> i & 1) number = i;
    return number;
}

typedef struct sums {
    double force_n[3], torque_n_m[3], power_w; // force, torque and power of the contact on the tool
    // pressing_n: sum of the pressing forces; place_n_m: sum of the products of each pressing force and its arm
    double pressing_n, place_n_m[3];
} sums;

static void add_force(sums *s, const double normal[3], double pressing_n, double rate_m_s)
{
    for (int k = 0; k < 3; k++) s->force_n[k] -= pressing_n * normal[k];
    s->power_w += pressing_n * rate_m_s;
}

static void add_torque(sums *s, const double normal[3], double pressing_n, const double arm_m[3])
{
    double torque[3];
    kn_cross(arm_m, normal, torque);
    for (int k = 0; k < 3; k++) {
        s->torque_n_m[k] -= pressing_n * torque[k];
        s->place_n_m[k] += pressing_n * arm_m[k];
    }
    s->pressing_n += pressing_n;
}

// Compute the resultant of a contact: its normal, the force t along the normal, the speed w at which the tool presses
// the skin inwards, and the point where the force acts. w is a mean weighted by force, so that t w is the power of all
// forces. The point is chosen so that t has the same torque as all forces together, except for the torque about the
// normal. For a smooth ball this point is the centre of the ball.
static void settle(const sums *s, pressed *c)
{
    double t = sqrt(kn_dot(s->force_n, s->force_n)), across[3];
    c->force_n = 0;
    if (!(t > 0)) return;
    for (int k = 0; k < 3; k++) c->normal[k] = s->force_n[k] / t;
    c->force_n = t;
    c->rate_m_s = s->power_w / t;
    c->layer_n_m = 0;
    kn_cross(c->normal, s->torque_n_m, across);
    // the torque does not determine the point's height along the normal: take the mean height of the samples
    double height = s->pressing_n > 0 ? kn_dot(s->place_n_m, c->normal) / s->pressing_n : 0;
    for (int k = 0; k < 3; k++) c->arm_m[k] = across[k] / t + height * c->normal[k];
}

static bool presses(const kn_sample *s, int p) { return s->probe == p && s->line.active && s->pressing_n > 0; }
static bool carries(const kn_held_node *h, int p) { return h->probe == p && !h->gone && h->force_n[2] > 0; }

static void settle_all(const sums *all, const sums part[KN_PATCHES_MAX], fitted *f)
{
    settle(all, &f->all);
    for (int i = 0; i < KN_PATCHES_MAX && several(f); i++)
        if (f->used >> i & 1) settle(&part[i], &f->patch[i]);
}

// Add the stiffness of a sample's foundation to the stiffness of the contact's foundation along the contact's normal.
static void add_layer(const kn_sample *s, pressed *c)
{
    double along = kn_dot(s->normal, c->normal);
    c->layer_n_m += s->line.slope_n_m * along * along;
}

// Compute the resultant of all samples of a tool, and the resultant of the samples of each patch.
static void look_at_samples(const kn_contact_fit *fit, const kn_state *state, const kn_contact *contact, int p,
                            fitted *f)
{
    const bool turns = kn_tool_turns(&fit->model->def.probe[p]);
    sums all = {0}, part[KN_PATCHES_MAX];
    if (several(f)) memset(part, 0, sizeof part);
    for (int i = 0; i < contact->sample_count; i++) {
        const kn_sample *s = &contact->sample[i];
        if (!presses(s, p)) continue;
        double rate = skin_rate(fit->model, state, s);
        add_force(&all, s->normal, s->pressing_n, rate);
        if (turns) add_torque(&all, s->normal, s->pressing_n, s->arm_m);
        if (!several(f)) continue;
        sums *own = &part[patch_of(fit, p, s->patch->node, s->patch->nodes)];
        add_force(own, s->normal, s->pressing_n, rate);
        if (turns) add_torque(own, s->normal, s->pressing_n, s->arm_m);
    }
    // add up the foundation in a second pass, because this needs the normal of the resultant; also add the samples that
    // are in contact but do not press
    settle_all(&all, part, f);
    for (int i = 0; i < contact->sample_count && f->all.force_n > 0; i++) {
        const kn_sample *s = &contact->sample[i];
        if (s->probe != p || !s->line.active) continue;
        add_layer(s, &f->all);
        if (several(f)) add_layer(s, &f->patch[patch_of(fit, p, s->patch->node, s->patch->nodes)]);
    }
}

// Compute the resultants of a plate's held nodes. All held nodes move at the plate's velocity.
static void look_at_holds(const kn_contact_fit *fit, const kn_state *state, const kn_contact *contact, int p,
                          const kn_output *output, fitted *f)
{
    static const double down[3] = {0, 0, -1};
    const double rate = -state->probe[p].velocity_m_s[2];
    double pressed_n = 0;
    sums part[KN_PATCHES_MAX];
    f->all.force_n = fmax(0, output->probe[p].force_n[2]);
    f->all.rate_m_s = rate;
    f->all.layer_n_m = 0;
    memcpy(f->all.normal, (double[]){0, 0, 1}, sizeof f->all.normal);
    memset(f->all.arm_m, 0, sizeof f->all.arm_m);
    // the arm is that of the pressing nodes: beside nodes that pull, torque divided by force may lie outside the plate
    for (int i = 0; i < contact->hold_count && f->all.force_n > 0; i++) {
        const kn_held_node *h = &contact->hold[i];
        double x[3];
        if (!carries(h, p)) continue;
        kn_state_position(fit->model, state, h->node, x);
        for (int k = 0; k < 2; k++) f->all.arm_m[k] += h->force_n[2] * (x[k] - state->probe[p].position_m[k]);
        pressed_n += h->force_n[2];
    }
    for (int k = 0; k < 2 && pressed_n > 0; k++) f->all.arm_m[k] /= pressed_n;
    if (!several(f)) return;
    memset(part, 0, sizeof part);
    for (int i = 0; i < contact->hold_count; i++) {
        const kn_held_node *h = &contact->hold[i];
        double arm[3];
        if (!carries(h, p)) continue;
        kn_state_position(fit->model, state, h->node, arm);
        for (int k = 0; k < 3; k++) arm[k] -= f->tool_m[k];
        sums *own = &part[patch_of(fit, p, &h->node, 1)];
        add_force(own, down, h->force_n[2], rate);
        add_torque(own, down, h->force_n[2], arm);
    }
    for (int i = 0; i < KN_PATCHES_MAX; i++)
        if (f->used >> i & 1) settle(&part[i], &f->patch[i]);
}

// Compute the resultants of a tool's contact in the last step.
static void look(const kn_contact_fit *fit, const kn_state *state, const kn_contact *contact, int p,
                 const kn_output *output, fitted *f)
{
    bool plate = fit->model->def.probe[p].shape == KN_PROBE_PLATE;
    f->all.force_n = 0;
    memcpy(f->tool_m, state->probe[p].position_m, sizeof f->tool_m);
    if (plate) look_at_holds(fit, state, contact, p, output, f);
    else look_at_samples(fit, state, contact, p, f);
    f->touching = f->all.force_n > 0;
    if (!f->touching) f->all.rate_m_s = 0, memset(f->all.arm_m, 0, sizeof f->all.arm_m);
    double along = kn_dot(f->all.normal, output->probe[p].force_n);
    for (int k = 0; k < 3; k++)
        f->side_n[k] = f->touching && !plate ? output->probe[p].force_n[k] - along * f->all.normal[k] : 0;
}

// Find the plane that the tool would meet. While the tool is near, only one component of the gradient of the distance
// is computed per step, because computing a distance takes long.
static void look_ahead(const kn_contact_fit *fit, const kn_state *state, int p, const kn_input *input, fitted *f)
{
    const kn_model *m = fit->model;
    bool plate = m->def.probe[p].shape == KN_PROBE_PLATE, was = f->near && f->ahead;
    const double *turn = input->probe[p].orientation_wxyz, radius = plate ? PLATE_M : m->shape[p].fine_m;
    f->ahead = !f->touching;
    f->near = f->touching;
    if (f->touching) return;
    f->gap_m = kn_clearance(m, state, p, f->tool_m, turn);
    f->near = f->gap_m < REACH * radius;
    for (int k = 0; k < 3 && f->near; k++) {
        double at[3] = {f->tool_m[0], f->tool_m[1], f->tool_m[2]};
        at[k] += PROBE_M;
        if (was && k != state->tick % 3) continue;
        f->gradient[k] = plate ? (k == 2) : (kn_clearance(m, state, p, at, turn) - f->gap_m) / PROBE_M;
    }
    double size = sqrt(kn_dot(f->gradient, f->gradient));
    // the gradient's size is 1, except where two sides of the object are equally near: there the direction is not known
    f->near &= size > 0.5 && isfinite(size);
    for (int k = 0; k < 3 && f->near; k++) f->all.normal[k] = f->gradient[k] / size;
}

// --- stiffness and damping of a contact ------------------------------------------------------------------------------

static double clip(double v, double least, double most) { return fmin(fmax(v, least), most); }

// Return the damping c2 that a contact with damping A = a has at a stress. The ratio c2/A is the same as in an edge.
static double c2_at(const kn_model *m, double a, double stress_pa)
{
    double c2 = kn_material_c2(&m->def.material, stress_pa);
    return isfinite(c2) ? a * c2 / m->law.a_pa_s : 1e5;
}

// Advance the back stress: dH/dt = k1 (t - H)/A, the law of the Voigt element.
static void follow_back_stress(const kn_model *m, pressed *c)
{
    c->k1 = c->a * m->def.material.k1_pa / m->law.a_pa_s;
    c->h_n += m->def.solver.dt_s * c->k1 * (c->force_n - c->h_n) / c->a;
}

// Fit the damping c2 by least squares over the recent past: contact force divided by the rate of the damper c2. This
// rate is w minus the rate of the Voigt element, (t - H)/A.
static void follow_flow(const kn_model *m, pressed *c)
{
    double fade = exp(-m->def.solver.dt_s / MEMORY_S), flow = c->rate_m_s - (c->force_n - c->h_n) / c->a;
    c->tt = fade * c->tt + c->force_n * c->force_n;
    c->tw = fade * c->tw + c->force_n * flow;
    // soft, stiff: c2 of this contact if the material's damper is at its softest or stiffest; they are the limits of c2
    double stiff = c2_at(m, c->a, 0), soft = c2_at(m, c->a, 1e12);
    c->c2 = c->tw > 0 && c->tt > 0 ? clip(c->tt / c->tw, fmin(soft, stiff), stiff) : stiff;
}

// --- patches --------------------------------------------------------------------------------------------------------

// Compute the stored values of a new patch from the old patches that it grew out of, weighted by shares of load.
// Springs and dampers of the old patches are side by side, so their values add up.
static void inherit(const fitted *f, const double share[KN_PATCHES_MAX], pressed *c)
{
    double weight = 0;
    *c = (pressed){0};
    for (int j = 0; j < KN_PATCHES_MAX; j++) {
        const pressed *was = &f->patch[j];
        if (!(share[j] > 0)) continue;
        c->h_n += share[j] * was->h_n;
        if (!(was->loaded > 0)) continue; // no mobility solve has computed the old patch's values yet
        c->a += share[j] * was->a;
        c->c2 += share[j] * was->c2;
        c->loaded += share[j] * was->loaded;
        weight += share[j] * sqrt(was->tt);
    }
    c->tt = weight * weight;
    c->tw = c->c2 > 0 ? c->tt / c->c2 : 0;
}

// Regroup the stored values when the patches change. If there is only one patch, f->all holds its values.
static void regroup(fitted *f, unsigned used, double share[KN_PATCHES_MAX][KN_PATCHES_MAX])
{
    bool were_several = several(f), same = used == f->used;
    for (int i = 0; i < KN_PATCHES_MAX && same; i++) same = !(used >> i & 1) || share[i][i] == 1;
    if (same) return;
    // from one patch to several: copy the values of the whole contact to the one patch first
    if (!were_several && f->used) f->patch[f->only] = f->all, f->patch[f->only].loaded = 1;
    fitted now = *f;
    now.used = used;
    for (int i = 0; i < KN_PATCHES_MAX; i++) {
        if (!(used >> i & 1)) continue;
        now.only = i;
        inherit(f, share[i], &now.patch[i]);
    }
    // from several patches to one: copy the values of the remaining patch to the whole contact
    const pressed *one = &now.patch[now.only];
    if (were_several && used && !several(&now) && one->a > 0)
        now.all.a = one->a, now.all.h_n = one->h_n, now.all.tt = one->tt, now.all.tw = one->tw, now.all.c2 = one->c2;
    *f = now;
}

// Group the pressed nodes into patches, and regroup the stored values.
static void group_patches(kn_contact_fit *fit, const kn_contact *contact, int p)
{
    double share[KN_PATCHES_MAX][KN_PATCHES_MAX];
    kn_patches_begin(fit->patches, p);
    for (int i = 0; i < contact->sample_count; i++) {
        const kn_sample *s = &contact->sample[i];
        if (!presses(s, p)) continue;
        // a sample of a spline presses its middle node, a sample of a triangle presses the three corners
        if (s->patch->nodes == 9) kn_patches_press(fit->patches, s->patch->node[4], s->pressing_n);
        else
            for (int a = 0; a < s->patch->nodes; a++)
                kn_patches_press(fit->patches, s->patch->node[a], s->pressing_n / s->patch->nodes);
    }
    for (int i = 0; i < contact->hold_count; i++)
        if (carries(&contact->hold[i], p))
            kn_patches_press(fit->patches, contact->hold[i].node, contact->hold[i].force_n[2]);
    unsigned used = kn_patches_end(fit->patches, share);
    regroup(&fit->probe[p], used, share);
}

// --- mobility -------------------------------------------------------------------------------------------------------

// Load the nodes that a level plate will meet first, each with share_n newtons downwards. These are the highest nodes
// under the plate, to within a tenth of a spacing. Return the number of these nodes. If share_n is 0, only count them.
static int load_plate(const kn_contact_fit *fit, const kn_state *state, int p, double share_n)
{
    const kn_model *m = fit->model;
    const fitted *f = &fit->probe[p];
    const double slack = 0.1 * m->def.spacing_m, *half = m->def.probe[p].size_m, push[3] = {0, 0, -share_n};
    int count = 0;
    for (int t = 0; t < m->top_count; t++) {
        double x[3];
        kn_state_position(m, state, m->top[t], x);
        if (fabs(x[0] - f->tool_m[0]) > 0.5 * half[0] + slack || fabs(x[1] - f->tool_m[1]) > 0.5 * half[1] + slack ||
            x[2] < f->tool_m[2] - f->gap_m - slack)
            continue;
        if (share_n > 0) kn_mobility_load(fit->mobility, m->offset[m->top[t]], push);
        count++;
    }
    return count;
}

// Function that each_force calls for every node's force in a contact. `force_n` is scaled: the forces of each patch, or
// of the whole contact, sum to 1 N.
typedef void kn_force_call(void *self, int patch, size_t offset, const double force_n[3]);

static void each_force(const kn_contact_fit *fit, const kn_contact *contact, int p, bool by_patch, kn_force_call *call,
                       void *self)
{
    const fitted *f = &fit->probe[p];
    double force[3], whole_n = f->all.force_n;
    for (int i = 0; i < contact->sample_count; i++) {
        const kn_sample *s = &contact->sample[i];
        if (!presses(s, p)) continue;
        int patch = by_patch ? patch_of(fit, p, s->patch->node, s->patch->nodes) : 0;
        if (by_patch) whole_n = f->patch[patch].force_n;
        for (int a = 0; a < s->patch->nodes; a++) {
            for (int k = 0; k < 3; k++) force[k] = s->weight[a] * s->pressing_n / whole_n * s->normal[k];
            call(self, patch, s->patch->offset[a], force);
        }
    }
    for (int i = 0; i < contact->hold_count; i++) {
        const kn_held_node *h = &contact->hold[i];
        if (h->probe != p || h->gone || (by_patch && !carries(h, p))) continue;
        int patch = by_patch ? patch_of(fit, p, &h->node, 1) : 0;
        if (by_patch) whole_n = f->patch[patch].force_n;
        memcpy(force, (double[]){0, 0, -h->force_n[2] / whole_n}, sizeof force);
        call(self, patch, fit->model->offset[h->node], force);
    }
}

static void load_force(void *self, int patch, size_t offset, const double force_n[3])
{
    (void)patch;
    kn_mobility_load(self, offset, force_n);
}

// Load the nodes with the pattern of forces for which the mobility solve computes velocities.
static void load_pattern(kn_contact_fit *fit, const kn_state *state, const kn_contact *contact, int p)
{
    const kn_model *m = fit->model;
    fitted *f = &fit->probe[p];
    double force[3];
    // a plate in the air: load the nodes that the plate will touch first
    if (!f->touching && m->def.probe[p].shape == KN_PROBE_PLATE) {
        int count = load_plate(fit, state, p, 0);
        if (count > 0) load_plate(fit, state, p, 1.0 / count);
        return;
    }
    // any other tool in the air: apply the load to the node nearest to the tool
    if (!f->touching) {
        int node = nearest_node(fit, state, f->tool_m);
        for (int k = 0; k < 3; k++) force[k] = -f->all.normal[k];
        kn_mobility_load(fit->mobility, m->offset[node], force);
        return;
    }
    each_force(fit, contact, p, false, load_force, fit->mobility);
    for (int i = 0; i < KN_PATCHES_MAX; i++) f->patch[i].loaded = f->patch[i].force_n / f->all.force_n;
}

// Speed at which each patch yields inwards under the whole pattern of forces, m/s per N of the pattern.
typedef struct rates {
    const kn_mobility *mobility;
    int probe;
    double of[KN_PATCHES_MAX];
} rates;

static void add_rate(void *self, int patch, size_t offset, const double force_n[3])
{
    rates *r = self;
    r->of[patch] += kn_mobility_rate(r->mobility, r->probe, offset, force_n);
}

// Compute the damping A_i of each patch. The whole pattern of forces sums to 1 N; patch i carries the share w_i of it
// and yields with the speed b_i'z, where b_i are the forces of patch i and z the node velocities. So A_i = w_i/(b_i'z).
static void share_mobility(kn_contact_fit *fit, const kn_contact *contact, int p)
{
    fitted *f = &fit->probe[p];
    rates r = {.mobility = fit->mobility, .probe = p};
    if (!several(f)) return;
    each_force(fit, contact, p, true, add_rate, &r);
    for (int i = 0; i < KN_PATCHES_MAX; i++) {
        pressed *c = &f->patch[i];
        if (!(f->used >> i & 1) || !(c->loaded > 0) || !(c->force_n > 0)) continue;
        c->a = clip(c->loaded / r.of[i], f->all.a / (2 * count_of(f->used)), f->all.a);
    }
}

// Begin a mobility solve (a round) for the next probe that touches the object or is near it. The probes take turns.
static void begin_round(kn_contact_fit *fit, const kn_state *state, const kn_contact *contact)
{
    int probes = fit->model->def.probe_count, last = fit->round < 0 ? 0 : fit->round;
    fit->round = -1;
    for (int i = 1; i <= probes; i++) {
        int p = (last + i) % probes;
        if (!fit->probe[p].near) continue;
        kn_mobility_begin(fit->mobility, p);
        load_pattern(fit, state, contact, p);
        kn_mobility_start(fit->mobility);
        fit->round = p;
        return;
    }
}

void kn_contact_fit_iterate(kn_contact_fit *fit, const kn_state *state, const kn_scratch *scratch)
{
    const kn_contact *contact = kn_scratch_contact(scratch, state);
    if (!contact) return; // the state was reset or has diverged
    // update the patches and the next places of contact, then continue the mobility solve
    for (int p = 0; p < fit->model->def.probe_count; p++)
        if (fit->probe[p].touching || fit->probe[p].used) group_patches(fit, contact, p);
    for (int p = 0; p < fit->model->def.probe_count; p++)
        if (fit->ahead[p] && fit->probe[p].near) kn_ahead_look(fit->ahead[p], state);
    for (int i = 0; i < ITERATIONS && fit->round >= 0; i++) {
        double a;
        if (!kn_mobility_iterate(fit->mobility, &a)) continue;
        // the mobility solve is complete: use the new damping A and begin the next solve
        if (a > 0) {
            fit->probe[fit->round].all.a = a;
            share_mobility(fit, contact, fit->round);
        }
        begin_round(fit, state, contact);
        return;
    }
    if (fit->round < 0) begin_round(fit, state, contact);
}

// --- every step -----------------------------------------------------------------------------------------------------

void kn_contact_fit_step(kn_contact_fit *fit, const kn_state *state, const kn_scratch *scratch, const kn_input *input,
                         const kn_output *output)
{
    const kn_contact *contact = kn_scratch_contact(scratch, state);
    for (int p = 0; p < fit->model->def.probe_count; p++) {
        fitted *f = &fit->probe[p];
        if (!contact || !state->probe[p].attached) {
            *f = (fitted){0};
            continue;
        }
        // update the contact in every step, however far the mobility solve has come
        look(fit, state, contact, p, output, f);
        look_ahead(fit, state, p, input, f);
        f->places = fit->ahead[p] && f->near ? kn_ahead_places(fit->ahead[p], state, KN_PATCHES_MAX, f->place) : 0;
        if (!(f->all.a > 0)) continue;
        follow_back_stress(fit->model, &f->all);
        follow_flow(fit->model, &f->all);
        // a new patch gets an equal share of the contact's A until a mobility solve has computed its own A
        int known = 0;
        for (int i = 0; i < KN_PATCHES_MAX; i++) known += (f->used >> i & 1) && f->patch[i].a > 0;
        for (int i = 0; i < KN_PATCHES_MAX && several(f); i++) {
            if (!(f->used >> i & 1)) continue;
            if (!(f->patch[i].a > 0)) f->patch[i].a = f->all.a / fmax(1, known);
            follow_back_stress(fit->model, &f->patch[i]);
            follow_flow(fit->model, &f->patch[i]);
        }
    }
}

// Return the stiffness of two springs in series; 0 stands for rigid.
static double series(double a, double b) { return a > 0 && b > 0 ? a * b / (a + b) : fmax(a, b); }

// Return the lower limit of the foundation stiffness that is reported to a client. At first touch only a few samples
// press, and their total stiffness is small. If that stiffness were reported, the client would render only a third of
// the force of the first touch. The limit estimates the stiffness some tens of ms after first touch. It is the
// stiffness of the coupling, or of the foundation over a circle whose radius is a third of the tool's half width,
// whichever is less.
static double first_layer(const kn_model *m, int p, double coupling_n_m)
{
    double third_m = m->shape[p].fine_m / 3;
    return fmin(coupling_n_m, kn_probe_foundation(&m->def.probe[p]) * 3.14 * third_m * third_m);
}

// Set the coupling of a unit, and return the stiffness of its foundation. A tool that follows its pose rigidly has no
// coupling.
static double set_coupling(const kn_contact_fit *fit, int p, double layer_n_m, kn_contact_unit *unit)
{
    const kn_probe_def *def = &fit->model->def.probe[p];
    bool rigid = !(def->coupling_n_m > 0);
    double coupling = rigid ? fit->device.stiffness_n_m : def->coupling_n_m;
    double layer = def->shape == KN_PROBE_PLATE ? 0 : fmax(layer_n_m, first_layer(fit->model, p, coupling));
    unit->k_vc_n_per_m = series(def->coupling_n_m, layer);
    double share = rigid ? 0 : unit->k_vc_n_per_m / def->coupling_n_m;
    unit->b_vc_n_s_per_m = share * share * def->coupling_n_s_m;
    return layer;
}

// Return the time for which a unit is valid, ms. The time is shorter if the client's force lags far behind. In the
// server, the force on a rigid tool follows a new velocity at once. In the client, the force follows only after the
// coupling has stretched. That takes the time B (1/k - 1/layer), where B is the damping of the flowing object, k the
// stiffness of the client's coupling, and `layer` that of the foundation.
static double valid_ms(const kn_contact_fit *fit, int p, const fitted *f, double layer)
{
    if (fit->model->def.probe[p].coupling_n_m > 0) return VALID_MS;
    double soft = 1 / fit->device.stiffness_n_m - (layer > 0 ? 1 / layer : 0);
    double late_s = soft * series(f->all.a, c2_at(fit->model, f->all.a, 1e12));
    return late_s > LATE_S ? VALID_MS * LATE_S / late_s : VALID_MS;
}

// Fill in the physical fields of a unit. `at_m`: position that the tool would have if the contact carried no force.
static void set_unit(const kn_model *m, const pressed *c, const double at_m[3], kn_contact_unit *unit)
{
    // convert A from the server's time step to the client's; the client uses proxy minus anchor as the arm of the force
    const kn_material *mat = &m->def.material;
    double height = kn_dot(c->arm_m, c->normal);
    unit->force_n = c->force_n;
    unit->proxy_velocity_m_s = -c->rate_m_s;
    unit->a_n_s_per_m = c->a * (mat->c1_pa_s + CLIENT_S * mat->k1_pa) / m->law.a_pa_s;
    unit->h_n = c->h_n;
    unit->c2_n_s_per_m = c->c2;
    unit->k1_n_per_m = c->k1;
    for (int k = 0; k < 3; k++) {
        unit->normal[k] = c->normal[k];
        unit->proxy_m[k] = at_m[k] + c->arm_m[k] - height * c->normal[k];
        unit->friction_anchor_m[k] = at_m[k] - height * c->normal[k];
    }
}

// Return the contact expected at a place that the tool does not touch yet. `a`: damping A of the present contacts.
static pressed expected(const kn_model *m, const kn_place *place, double a)
{
    pressed c = {.a = a, .k1 = a * m->def.material.k1_pa / m->law.a_pa_s, .c2 = c2_at(m, a, 0)};
    memcpy(c.normal, place->normal, sizeof c.normal);
    memcpy(c.arm_m, place->arm_m, sizeof c.arm_m);
    return c;
}

// Fill in one unit. The coupling of a single unit (`alone`) includes the foundation, so the foundation's compression is
// added to the reported position of the tool. Each of several units has a foundation of its own, so the compression is
// not added. The tangential stretch of the foundation is added in both cases.
static void tell(const kn_contact_fit *fit, int p, const pressed *c, double gap_m, bool alone, kn_contact_unit *unit)
{
    const fitted *f = &fit->probe[p];
    const kn_model *m = fit->model;
    double layer = set_coupling(fit, p, c->layer_n_m, unit), at_m[3];
    double give = layer > 0 ? 1 / layer : 0, stretch = alone ? give * c->force_n : 0;
    for (int k = 0; k < 3; k++)
        at_m[k] = f->tool_m[k] + (stretch - gap_m) * c->normal[k] + (f->touching ? give * f->side_n[k] : 0);
    unit->friction = m->def.probe[p].friction;
    unit->valid_ms = valid_ms(fit, p, f, layer);
    set_unit(m, c, at_m, unit);
}

void kn_contact_fit_units(const kn_contact_fit *fit, int p, int most, kn_contact_unit unit[])
{
    const fitted *f = &fit->probe[p];
    const pressed *told[KN_PATCHES_MAX];
    int patches = 0, count = 0;
    unit[0] = (kn_contact_unit){0};
    if (!f->near || !(f->all.a > 0)) return;
    // choose the patches that press, or the resultant if there is only one patch or more than `most`; then add the
    // places that the tool will touch next
    for (int i = 0; i < KN_PATCHES_MAX && several(f); i++)
        if ((f->used >> i & 1) && f->patch[i].force_n > 0) told[patches++] = &f->patch[i];
    if (patches < 2 || patches > most) told[0] = &f->all, patches = 1;
    int places = f->places < most - patches ? f->places : most - patches;
    // in air, leave out f->all, because it repeats the nearest place of f->place
    if (!f->touching && places > 0) patches = 0;
    const bool alone = patches + places == 1;
    for (; count < patches; count++) {
        unit[count] = (kn_contact_unit){.contact_index = count};
        tell(fit, p, told[count], f->touching ? 0 : f->gap_m, alone, &unit[count]);
    }
    for (int i = 0; i < places; i++, count++) {
        pressed c = expected(fit->model, &f->place[i], f->all.a / fmax(1, patches));
        unit[count] = (kn_contact_unit){.contact_index = count};
        tell(fit, p, &c, fmax(0, f->place[i].gap_m), alone, &unit[count]);
    }
    for (int i = 0; i < count; i++) unit[i].contact_count = count;
}
