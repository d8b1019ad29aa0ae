#include "core/contact_fit.h"
#include "core/mobility.h"
#include "core/scratch.h"
#include "core/shape.h"
#include "core/vec.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ITERATIONS 2   // of the mobility per step
#define MEMORY_S 0.020 // of c2's least squares
#define REACH 3.0      // radii ahead of which a plane is told
#define PLATE_M 0.01   // a plate's
#define PROBE_M 1e-4   // of the gradient of the distance
#define VALID_MS 100.0
#define LATE_S 0.030   // of a link that a local model is for
#define CLIENT_S 1e-3  // step that a client takes A for

typedef struct fitted { // one probe's
    bool touching, near, ahead;  // near: touching, or ahead of a plane
    double a, k1, h_n;           // of the contact; a 0: not known yet
    double force_n, rate_m_s;    // t, w
    double normal[3], side_n[3]; // out of the object; force on the tool across it
    double tool_m[3], gap_m, gradient[3]; // of the gap
    double layer_n_m;            // foundation along the normal; 0: rigid
    double tt, tw;               // sums of c2's least squares
    double c2;
} fitted;

struct kn_contact_fit {
    const kn_model *model;
    kn_coupling device;
    kn_mobility *mobility;
    fitted probe[KN_PROBES_MAX];
    int *skin; // nodes that a tool can meet
    int skin_count;
    int round; // probe of the round that is running, -1 none
};

// --- the object's outside -------------------------------------------------------------------------------------------

static void mark_skin(const kn_model *m, bool *mark)
{
    for (int f = 0; f < m->face_count; f++)
        for (int v = 0; v < m->face[f].len[1]; v++)
            for (int u = 0; u < m->face[f].len[0]; u++)
                mark[m->face[f].origin + u * m->face[f].step[0] + v * m->face[f].step[1]] = true;
    for (int i = 0; i < m->skin_count; i++)
        for (int k = 0; k < 3; k++) mark[m->skin[i][k]] = true;
}

static bool list_skin(kn_contact_fit *fit)
{
    const kn_model *m = fit->model;
    bool *mark = calloc((size_t)m->node_count, sizeof *mark);
    fit->skin = malloc((size_t)m->node_count * sizeof *fit->skin);
    if (mark && fit->skin) {
        mark_skin(m, mark);
        for (int i = 0; i < m->node_count; i++)
            if (mark[i]) fit->skin[fit->skin_count++] = i;
    }
    free(mark);
    return fit->skin_count > 0;
}

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
    if (fit->mobility && list_skin(fit)) {
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
    free(fit->skin);
    free(fit);
}

void kn_contact_fit_reset(kn_contact_fit *fit)
{
    memset(fit->probe, 0, sizeof fit->probe);
    fit->round = -1;
}

// --- what the step did ----------------------------------------------------------------------------------------------

static double skin_rate(const kn_model *m, const kn_state *state, const kn_sample *s)
{
    double rate = 0;
    for (int a = 0; a < s->nodes; a++)
        for (size_t k = 0; k < 3; k++)
            rate += s->weight[a] * s->normal[k] * kn_real_get(m, state->velocity, s->offset[a] + k * m->stride);
    return rate;
}

// Resultant normal, force along it, how fast the skin goes in (as the forces weigh it, so that t w is their power), and
// what the foundation gives way.
static void look_at_samples(const kn_model *m, const kn_state *state, int p, fitted *f)
{
    const kn_contact *contact = &kn_state_scratch(state)->contact;
    double sum[3] = {0}, power = 0, layer = 0;
    for (int i = 0; i < contact->sample_count; i++) {
        const kn_sample *s = &contact->sample[i];
        if (s->probe != p || !s->line.active || !(s->pressing_n > 0)) continue;
        for (int k = 0; k < 3; k++) sum[k] -= s->pressing_n * s->normal[k];
        power += s->pressing_n * skin_rate(m, state, s);
    }
    double t = sqrt(kn_dot(sum, sum));
    if (!(t > 0)) return;
    for (int k = 0; k < 3; k++) f->normal[k] = sum[k] / t;
    for (int i = 0; i < contact->sample_count; i++) {
        const kn_sample *s = &contact->sample[i];
        double along = kn_dot(s->normal, f->normal);
        if (s->probe == p && s->line.active) layer += s->line.slope_n_m * along * along;
    }
    f->force_n = t;
    f->rate_m_s = power / t;
    f->layer_n_m = layer;
}

static void look_at_holds(const kn_state *state, int p, const kn_output *output, fitted *f)
{
    f->force_n = fmax(0, output->probe[p].force_n[2]);
    f->rate_m_s = -state->probe[p].velocity_m_s[2];
    f->layer_n_m = 0;
    memcpy(f->normal, (double[]){0, 0, 1}, sizeof f->normal);
}

static void look(const kn_contact_fit *fit, const kn_state *state, int p, const kn_output *output, fitted *f)
{
    bool plate = fit->model->def.probe[p].shape == KN_PROBE_PLATE;
    f->force_n = 0;
    memcpy(f->tool_m, state->probe[p].position_m, sizeof f->tool_m);
    if (plate) look_at_holds(state, p, output, f);
    else look_at_samples(fit->model, state, p, f);
    f->touching = f->force_n > 0;
    if (!f->touching) f->rate_m_s = 0;
    double along = kn_dot(f->normal, output->probe[p].force_n);
    for (int k = 0; k < 3; k++)
        f->side_n[k] = f->touching && !plate ? output->probe[p].force_n[k] - along * f->normal[k] : 0;
}

// The plane that the tool would meet. Once near, one component of the gradient per step: distances are what costs here.
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
    f->near &= size > 0.5 && isfinite(size); // 1 but where the nearest points of two sides are as far
    for (int k = 0; k < 3 && f->near; k++) f->normal[k] = f->gradient[k] / size;
}

// --- the unit -------------------------------------------------------------------------------------------------------

static double clip(double v, double least, double most) { return fmin(fmax(v, least), most); }

// What a damper of the material that stiff would be at the contact.
static double c2_at(const kn_model *m, double a, double stress_pa)
{
    double c2 = kn_material_c2(&m->def.material, stress_pa);
    return isfinite(c2) ? a * c2 / m->law.a_pa_s : 1e5;
}

static void follow_back_stress(const kn_model *m, fitted *f)
{
    f->k1 = f->a * m->def.material.k1_pa / m->law.a_pa_s;
    f->h_n += m->def.solver.dt_s * f->k1 * (f->force_n - f->h_n) / f->a;
}

static void follow_flow(const kn_model *m, fitted *f)
{
    double fade = exp(-m->def.solver.dt_s / MEMORY_S), flow = f->rate_m_s - (f->force_n - f->h_n) / f->a;
    f->tt = fade * f->tt + f->force_n * f->force_n;
    f->tw = fade * f->tw + f->force_n * flow;
    double stiff = c2_at(m, f->a, 0), soft = c2_at(m, f->a, 1e12);
    f->c2 = f->tw > 0 && f->tt > 0 ? clip(f->tt / f->tw, fmin(soft, stiff), stiff) : stiff;
}

// --- mobility -------------------------------------------------------------------------------------------------------

// A level plate meets all nodes at once that are as high as the highest under it. Calls for each, or counts: share 0.
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

static void load_pattern(const kn_contact_fit *fit, const kn_state *state, int p)
{
    const kn_model *m = fit->model;
    const kn_contact *contact = &kn_state_scratch(state)->contact;
    const fitted *f = &fit->probe[p];
    double force[3];
    if (!f->touching && m->def.probe[p].shape == KN_PROBE_PLATE) {
        int count = load_plate(fit, state, p, 0);
        if (count > 0) load_plate(fit, state, p, 1.0 / count);
        return;
    }
    if (!f->touching) {
        int node = nearest_node(fit, state, f->tool_m);
        for (int k = 0; k < 3; k++) force[k] = -f->normal[k];
        kn_mobility_load(fit->mobility, m->offset[node], force);
        return;
    }
    for (int i = 0; i < contact->sample_count; i++) {
        const kn_sample *s = &contact->sample[i];
        if (s->probe != p || !s->line.active || !(s->pressing_n > 0)) continue;
        for (int a = 0; a < s->nodes; a++) {
            for (int k = 0; k < 3; k++) force[k] = s->weight[a] * s->pressing_n / f->force_n * s->normal[k];
            kn_mobility_load(fit->mobility, s->offset[a], force);
        }
    }
    for (int i = 0; i < contact->hold_count; i++) {
        const kn_hold *h = &contact->hold[i];
        if (h->probe != p || h->gone) continue;
        memcpy(force, (double[]){0, 0, -h->force_n[2] / f->force_n}, sizeof force);
        kn_mobility_load(fit->mobility, m->offset[h->node], force);
    }
}

// The next probe that is near, in turn.
static void begin_round(kn_contact_fit *fit, const kn_state *state)
{
    int probes = fit->model->def.probe_count, last = fit->round < 0 ? 0 : fit->round;
    fit->round = -1;
    for (int i = 1; i <= probes; i++) {
        int p = (last + i) % probes;
        if (!fit->probe[p].near) continue;
        kn_mobility_begin(fit->mobility, p);
        load_pattern(fit, state, p);
        kn_mobility_start(fit->mobility);
        fit->round = p;
        return;
    }
}

void kn_contact_fit_iterate(kn_contact_fit *fit, const kn_state *state)
{
    for (int i = 0; i < ITERATIONS && fit->round >= 0; i++) {
        double a;
        if (!kn_mobility_iterate(fit->mobility, &a)) continue;
        if (a > 0) fit->probe[fit->round].a = a;
        begin_round(fit, state);
        return;
    }
    if (fit->round < 0) begin_round(fit, state);
}

// --- every step -----------------------------------------------------------------------------------------------------

void kn_contact_fit_step(kn_contact_fit *fit, const kn_state *state, const kn_input *input, const kn_output *output)
{
    for (int p = 0; p < fit->model->def.probe_count; p++) {
        fitted *f = &fit->probe[p];
        if (!state->probe[p].attached) {
            *f = (fitted){0};
            continue;
        }
        look(fit, state, p, output, f);
        look_ahead(fit, state, p, input, f);
        if (!(f->a > 0)) continue;
        follow_back_stress(fit->model, f);
        follow_flow(fit->model, f);
    }
}

// Springs in series; 0 is rigid.
static double series(double a, double b) { return a > 0 && b > 0 ? a * b / (a + b) : fmax(a, b); }

// A foundation that nothing presses yet, or a few samples only, is told as what it comes to in some tens of ms: as
// stiff as the coupling, or as on a third of the tool's half width. Told as it is, a first touch would be rendered at a
// third of its force.
static double first_layer(const kn_model *m, int p, double coupling_n_m)
{
    double third_m = m->shape[p].fine_m / 3;
    return fmin(coupling_n_m, kn_probe_foundation(&m->def.probe[p]) * 3.14 * third_m * third_m);
}

// Coupling and foundation; a tool that follows its pose rigidly has no coupling.
static void set_coupling(const kn_contact_fit *fit, int p, const fitted *f, kn_contact_unit *unit, double *layer)
{
    const kn_probe_def *def = &fit->model->def.probe[p];
    bool rigid = !(def->coupling_n_m > 0);
    double coupling = rigid ? fit->device.stiffness_n_m : def->coupling_n_m;
    *layer = 0;
    if (def->shape != KN_PROBE_PLATE)
        *layer = fmax(f->touching ? f->layer_n_m : 0, first_layer(fit->model, p, coupling));
    unit->k_vc_n_per_m = series(def->coupling_n_m, *layer);
    double share = rigid ? 0 : unit->k_vc_n_per_m / def->coupling_n_m;
    unit->b_vc_n_s_per_m = share * share * def->coupling_n_s_m;
}

// A tool that follows its pose rigidly answers a new velocity at once, the client's behind its coupling when that is
// stretched: after B (1/k - 1/layer), B of the object as it flows. Until then the client would give back the force of a
// round trip ago against its motion of now.
static double valid_ms(const kn_contact_fit *fit, int p, const fitted *f, double layer)
{
    if (fit->model->def.probe[p].coupling_n_m > 0) return VALID_MS;
    double soft = 1 / fit->device.stiffness_n_m - (layer > 0 ? 1 / layer : 0);
    double late_s = soft * series(f->a, c2_at(fit->model, f->a, 1e12));
    return late_s > LATE_S ? VALID_MS * LATE_S / late_s : VALID_MS;
}

void kn_contact_fit_unit(const kn_contact_fit *fit, int p, kn_contact_unit *unit)
{
    const fitted *f = &fit->probe[p];
    const kn_model *m = fit->model;
    const kn_material *mat = &m->def.material;
    memset(unit, 0, sizeof *unit);
    if (!f->near || !(f->a > 0)) return;
    double layer;
    set_coupling(fit, p, f, unit, &layer);
    double give = layer > 0 ? 1 / layer : 0;
    unit->contact_count = 1;
    unit->force_n = f->force_n;
    unit->proxy_velocity_m_s = -f->rate_m_s;
    unit->a_n_s_per_m = f->a * (mat->c1_pa_s + CLIENT_S * mat->k1_pa) / m->law.a_pa_s;
    unit->h_n = f->h_n;
    unit->c2_n_s_per_m = f->c2;
    unit->k1_n_per_m = f->k1;
    unit->friction = m->def.probe[p].friction;
    unit->valid_ms = valid_ms(fit, p, f, layer);
    for (int k = 0; k < 3; k++) {
        double stretch = f->touching ? give * f->force_n : -f->gap_m;
        unit->normal[k] = f->normal[k];
        unit->proxy_m[k] = f->tool_m[k] + stretch * f->normal[k];
        unit->friction_anchor_m[k] = f->tool_m[k] + (f->touching ? give * f->side_n[k] : 0);
    }
}
