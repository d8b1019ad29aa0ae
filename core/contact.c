#include "core/contact.h"
#include "core/kernel.h"

#include <math.h>
#include <string.h>

// Samples per node patch and axis: spaced <= r/8 keeps the ripple of a sliding sphere at 0.3 % per ms, h/4 at most.
static int samples_per_patch(double spacing_m, const kn_probe_def *probe)
{
    return probe->radius_m > 4 * spacing_m ? 2 : 4;
}

// Samples that a sphere can have under it: its whole lower half pressed into the skin, and a patch around; at most all.
static int samples_max(const kn_model *model)
{
    double count = 0, h = model->def.spacing_m, patches = 0;
    for (int f = 0; f < model->face_count; f++) patches += (double)model->face[f].len[0] * model->face[f].len[1];
    patches += model->skin_count;
    for (int p = 0; p < model->def.probe_count; p++) {
        const kn_probe_def *probe = &model->def.probe[p];
        double per = samples_per_patch(model->composite ? INFINITY : h, probe), reach = (probe->radius_m + h) / h * per;
        if (probe->shape == KN_PROBE_SPHERE) count += fmin(2 * 3.1416 * reach * reach, patches * per * per);
    }
    return (int)fmin(count, 1e8);
}

size_t kn_contact_bytes(const kn_model *model)
{
    return (size_t)model->top_count * sizeof(kn_hold) + (size_t)samples_max(model) * sizeof(kn_sample);
}

void kn_contact_init(const kn_model *model, kn_contact *contact, void *memory)
{
    *contact = (kn_contact){.hold_max = model->top_count, .sample_max = samples_max(model)};
    contact->sample = memory;
    contact->hold = (kn_hold *)(void *)(contact->sample + contact->sample_max);
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static int face_node(const kn_face *face, int u, int v) { return face->origin + u * face->step[0] + v * face->step[1]; }

// --- following ------------------------------------------------------------------------------------------------------

// A step longer than the time to catch up takes it there at once; dividing by less would go past the pose and farther
// past it with every step.
static void follow(kn_probe_state *probe, const kn_probe_input *in, double dt)
{
    if (!in->attached) {
        *probe = (kn_probe_state){0};
        return;
    }
    if (!probe->attached) {
        *probe = (kn_probe_state){.attached = 1};
        memcpy(probe->position_m, in->position_m, sizeof probe->position_m);
    }
    for (int k = 0; k < 3; k++)
        probe->velocity_m_s[k] =
            in->velocity_m_s[k] + (in->position_m[k] - probe->position_m[k]) / fmax(KN_FOLLOW_S, dt);
}

// --- plate ----------------------------------------------------------------------------------------------------------

// A node on the very edge of the plate is under it whatever the last digits say.
static bool under_plate(const kn_model *model, const kn_probe_def *def, const double plate[3], const double x[3])
{
    double slack = 0.1 * model->def.spacing_m;
    return fabs(x[0] - plate[0]) <= 0.5 * def->size_m[0] + slack &&
           fabs(x[1] - plate[1]) <= 0.5 * def->size_m[1] + slack;
}

// A node goes with one plate: the first that touched it.
static bool held_by_other(const kn_model *model, const kn_state *state, int p, int t)
{
    for (int q = 0; q < model->def.probe_count; q++)
        if (q != p && state->held[(size_t)q * (size_t)model->top_count + (size_t)t]) return true;
    return false;
}

// A node ahead of the plate that leaves it behind by itself: a plate that slows down would take back what it has just
// let go. Nor is a node in its way that is so by the rounding of its displacement alone, after it was held.
#define ROUNDING 0x1p-20
static bool gets_away(double above, double way, double displacement)
{
    return above + way <= ROUNDING * fabs(displacement);
}

static void find_holds(const kn_model *model, kn_state *state, int p, kn_contact *contact)
{
    const kn_probe_state *probe = &state->probe[p];
    double dt = model->def.solver.dt_s, plane = probe->position_m[2] + dt * probe->velocity_m_s[2];
    uint8_t *held = state->held + (size_t)p * (size_t)model->top_count;
    for (int t = 0; t < model->top_count; t++) {
        kn_hold hold = {.node = model->top[t], .top = t, .probe = p};
        memcpy(hold.velocity_m_s, probe->velocity_m_s, sizeof hold.velocity_m_s);
        if (!held[t]) {
            double x[3], v[3];
            kn_state_position(model, state, hold.node, x);
            if (x[2] <= plane || !under_plate(model, &model->def.probe[p], probe->position_m, x)) continue;
            kn_state_velocity(model, state, hold.node, v);
            if (gets_away(x[2] - plane, dt * v[2], x[2] - model->rest_m[hold.node][2])) continue;
            // deeper past the foot than this step takes the plate it came from the side, risen beside it; under a plate
            // that goes up, deeper than it can have come itself: caught it would be thrown down by a quarter of a cell
            double down = fmax(0, -probe->velocity_m_s[2]);
            double came = dt * fmax(0, v[2] - probe->velocity_m_s[2]), h = model->def.spacing_m;
            double deepest = probe->velocity_m_s[2] > 0 ? 2 * came + 1e-3 * h : 0.25 * h + dt * down;
            if (x[2] - plane > deepest || held_by_other(model, state, p, t)) continue;
            // first touch: the node only has to get out of the way, so it moves by what is left of the step
            hold.velocity_m_s[2] = (plane - x[2]) / dt;
            held[t] = 1;
        }
        if (contact->hold_count < contact->hold_max) contact->hold[contact->hold_count++] = hold;
    }
}

// --- sphere ---------------------------------------------------------------------------------------------------------

// Quadratic B-spline weights of the nodes at -1, 0, +1 for t in [-1/2, 1/2] around node i of n. Where a neighbour is
// missing the skin goes on straight (x_-1 = 2 x_0 - x_1), so it ends at the edge of the block.
static void spline(double t, int i, int n, double w[3])
{
    w[0] = 0.5 * (0.5 - t) * (0.5 - t);
    w[1] = 0.75 - t * t;
    w[2] = 0.5 * (0.5 + t) * (0.5 + t);
    if (i == 0) w[1] += 2 * w[0], w[2] -= w[0], w[0] = 0;
    if (i == n - 1) w[1] += 2 * w[2], w[0] -= w[2], w[2] = 0;
}

typedef struct patch { // the 3 x 3 nodes around one node of a face
    const kn_face *face;
    int u, v;
    int node[9];
    size_t offset[9];
    double x[9][3];
} patch;

static int clamp(int i, int n) { return i < 0 ? 0 : i >= n ? n - 1 : i; }

static void load_patch(const kn_model *model, const kn_state *state, patch *p)
{
    for (int dv = -1, a = 0; dv <= 1; dv++)
        for (int du = -1; du <= 1; du++, a++) {
            p->node[a] = face_node(p->face, clamp(p->u + du, p->face->len[0]), clamp(p->v + dv, p->face->len[1]));
            kn_state_position(model, state, p->node[a], p->x[a]);
            p->offset[a] = model->offset[p->node[a]];
        }
}

static void blend(const patch *p, const double wu[3], const double wv[3], double weight[9], double point[3])
{
    for (int k = 0; k < 3; k++) point[k] = 0;
    for (int a = 0; a < 9; a++) {
        weight[a] = wu[a % 3] * wv[a / 3];
        for (int k = 0; k < 3; k++) point[k] += weight[a] * p->x[a][k];
    }
}

// Outside the block, where half a patch at the rim hangs over.
static bool overhangs(double t, int i, int n) { return (t < 0 && i == 0) || (t > 0 && i == n - 1); }

// Point (tu, tv) of a patch; false where it overhangs.
static bool patch_point(const patch *p, double tu, double tv, double weight[9], double point[3])
{
    const int *len = p->face->len;
    if (overhangs(tu, p->u, len[0]) || overhangs(tv, p->v, len[1])) return false;
    double wu[3], wv[3];
    spline(tu, p->u, len[0], wu);
    spline(tv, p->v, len[1], wv);
    blend(p, wu, wv, weight, point);
    return true;
}

#define PER_PATCH_MAX 4 // samples along a side of a patch

// Weights of that many samples along one side; bit j of the answer: sample j is on the block.
static unsigned side_weights(int per, int i, int n, double w[PER_PATCH_MAX][3])
{
    unsigned on = 0;
    for (int j = 0; j < per; j++) {
        double t = (j + 0.5) / per - 0.5;
        if (!overhangs(t, i, n)) on |= 1u << j;
        spline(t, i, n, w[j]);
    }
    return on;
}

// Outward normal of the skin at a patch's node, not unit. A face of one node across goes straight along y.
static void patch_normal(const patch *p, double normal[3])
{
    double du[3], dv[3];
    for (int k = 0; k < 3; k++) {
        du[k] = p->face->len[0] == 1 ? (k == 1) : p->x[5][k] - p->x[3][k];
        dv[k] = p->face->len[1] == 1 ? (k == 1) : p->x[7][k] - p->x[1][k];
    }
    cross(du, dv, normal);
}

// From the centre of a sphere to a point; what presses a flat object is a disc, wherever along y it is held.
static void away_from(const kn_model *model, const double centre[3], const double point[3], double away[3])
{
    for (int k = 0; k < 3; k++) away[k] = point[k] - centre[k];
    if (model->grid.flat) away[1] = 0;
}

static void sample_patch(const kn_model *model, const kn_state *state, int probe, const patch *p, kn_contact *contact)
{
    const kn_probe_def *def = &model->def.probe[probe];
    const double *centre = state->probe[probe].position_m;
    double h = p->face->spacing_m, outwards[3];
    int per = samples_per_patch(h, def);
    double stiffness = (def->foundation_n_m3 > 0 ? def->foundation_n_m3 : KN_FOUNDATION_N_M3) * h * h / (per * per);
    int per_u = per, per_v = per; // one across a flat object, for all of its thickness
    if (model->grid.flat) {
        stiffness *= model->grid.depth_m / h * per;
        if (p->face->len[0] == 1) per_u = 1;
        else per_v = 1;
    }
    patch_normal(p, outwards);
    double wu[PER_PATCH_MAX][3], wv[PER_PATCH_MAX][3], reach = def->radius_m + 0.1 * h;
    unsigned on_u = side_weights(per_u, p->u, p->face->len[0], wu), on_v = side_weights(per_v, p->v, p->face->len[1], wv);
    for (int i = 0; i < per_u * per_v; i++) {
        double point[3], away[3], weight[9];
        if (!(on_u >> i % per_u & 1) || !(on_v >> i / per_u & 1)) continue;
        blend(p, wu[i % per_u], wv[i / per_u], weight, point);
        away_from(model, centre, point, away);
        double square = dot(away, away);
        // a candidate when it may touch within this step; the far side of a thin block faces away and never does
        if (square > reach * reach || square == 0 || dot(away, outwards) > 0) continue;
        if (contact->sample_count >= contact->sample_max) {
            contact->samples_lost++;
            continue;
        }
        double distance = sqrt(square);
        kn_sample *s = &contact->sample[contact->sample_count++];
        *s = (kn_sample){.probe = probe, .face = (int)(p->face - model->face), .stiffness_n_m = stiffness};
        s->depth_m = def->radius_m - distance;
        for (int k = 0; k < 3; k++) s->normal[k] = away[k] / distance;
        memcpy(s->weight, weight, sizeof weight);
        memcpy(s->node, p->node, sizeof s->node);
        memcpy(s->offset, p->offset, sizeof s->offset);
    }
}

// --- sphere on a net ------------------------------------------------------------------------------------------------

// Corners of a triangle of the skin, and its normal, not unit; its size is twice the area.
static void load_triangle(const kn_model *model, const kn_state *state, const int node[3], double x[3][3],
                          double normal[3])
{
    double u[3], v[3];
    for (int c = 0; c < 3; c++) kn_state_position(model, state, node[c], x[c]);
    for (int k = 0; k < 3; k++) u[k] = x[1][k] - x[0][k], v[k] = x[2][k] - x[0][k];
    cross(u, v, normal);
}

static double rest_area(const kn_model *model, const int node[3])
{
    double u[3], v[3], n[3];
    for (int k = 0; k < 3; k++) {
        u[k] = model->rest_m[node[1]][k] - model->rest_m[node[0]][k];
        v[k] = model->rest_m[node[2]][k] - model->rest_m[node[0]][k];
    }
    cross(u, v, n);
    return 0.5 * sqrt(dot(n, n));
}

// Barycentric weights of the centre of small triangle i of the per^2 that a triangle is cut into.
static void small_centre(int i, int per, double weight[3])
{
    int row = 0;
    while ((row + 1) * (row + 1) <= i) row++;
    int at = i - row * row, upward = at % 2 == 0; // a row holds 2 row + 1, in turn upright and upside down
    double third = upward ? 1.0 / 3 : 2.0 / 3;
    weight[1] = (at / 2 + third) / per;
    weight[2] = (per - 1 - row + (upward ? 1.0 / 3 : 2.0 / 3)) / per;
    weight[0] = 1 - weight[1] - weight[2];
}

static void sample_triangle(const kn_model *model, const kn_state *state, int probe, const int node[3],
                            kn_contact *contact)
{
    const kn_probe_def *def = &model->def.probe[probe];
    const double *centre = state->probe[probe].position_m;
    double x[3][3], outwards[3], h = model->def.spacing_m;
    int per = samples_per_patch(h, def);
    double pressure = def->foundation_n_m3 > 0 ? def->foundation_n_m3 : KN_FOUNDATION_N_M3;
    load_triangle(model, state, node, x, outwards);
    for (int i = 0; i < per * per; i++) {
        kn_sample s = {.probe = probe, .stiffness_n_m = pressure * rest_area(model, node) / (per * per)};
        double away[3];
        small_centre(i, per, s.weight);
        for (int k = 0; k < 3; k++)
            away[k] = s.weight[0] * x[0][k] + s.weight[1] * x[1][k] + s.weight[2] * x[2][k] - centre[k];
        double distance = sqrt(dot(away, away));
        s.depth_m = def->radius_m - distance;
        if (s.depth_m < -0.1 * h || distance == 0 || dot(away, outwards) > 0) continue;
        for (int k = 0; k < 3; k++) s.normal[k] = away[k] / distance;
        for (int a = 0; a < 9; a++) s.node[a] = node[a % 3], s.offset[a] = model->offset[node[a % 3]];
        if (contact->sample_count < contact->sample_max) contact->sample[contact->sample_count++] = s;
        else contact->samples_lost++;
    }
}

static void find_on_net(const kn_model *model, const kn_state *state, int probe, kn_contact *contact)
{
    for (int f = 0; f < model->skin_count; f++) {
        const int *node = model->skin[f];
        double x[3] = {0}, side = 0;
        for (int k = 0; k < 3; k++) { // longest side as it is now bounds how far the triangle reaches from a corner
            double a[3], b[3];
            kn_state_position(model, state, node[k], a);
            kn_state_position(model, state, node[(k + 1) % 3], b);
            for (int c = 0; c < 3; c++) b[c] -= a[c];
            side = fmax(side, dot(b, b));
            if (k == 0) memcpy(x, a, sizeof x);
        }
        double reach = model->def.probe[probe].radius_m + sqrt(side) + 0.1 * model->def.spacing_m;
        for (int k = 0; k < 3; k++) x[k] -= state->probe[probe].position_m[k];
        if (dot(x, x) <= reach * reach) sample_triangle(model, state, probe, node, contact);
    }
}

static double net_clearance(const kn_model *model, const kn_state *state, const kn_probe_def *def, const double at[3])
{
    double nearest = INFINITY, sign = 1;
    for (int f = 0; f < model->skin_count; f++) {
        double x[3][3], outwards[3], away[3];
        load_triangle(model, state, model->skin[f], x, outwards);
        for (int i = 0; i < 7; i++) { // corners, middles of the sides, centre
            for (int k = 0; k < 3; k++) {
                double point = i < 3   ? x[i][k]
                               : i < 6 ? 0.5 * (x[i - 3][k] + x[(i - 2) % 3][k])
                                       : (x[0][k] + x[1][k] + x[2][k]) / 3;
                away[k] = at[k] - point;
            }
            double distance = sqrt(dot(away, away));
            if (distance >= nearest) continue;
            nearest = distance;
            sign = dot(away, outwards) < 0 ? -1 : 1; // the centre is under the skin
        }
    }
    return sign * nearest - def->radius_m;
}

static void find_samples(const kn_model *model, const kn_state *state, int probe, kn_contact *contact)
{
    if (model->skin_count > 0) {
        find_on_net(model, state, probe, contact);
        return;
    }
    for (int f = 0; f < model->face_count; f++) {
        double reach = model->def.probe[probe].radius_m + 1.5 * model->face[f].spacing_m;
        for (int v = 0; v < model->face[f].len[1]; v++)
            for (int u = 0; u < model->face[f].len[0]; u++) {
                double x[3], away[3];
                kn_state_position(model, state, face_node(&model->face[f], u, v), x);
                away_from(model, state->probe[probe].position_m, x, away);
                if (dot(away, away) > reach * reach) continue;
                patch p = {.face = &model->face[f], .u = u, .v = v};
                load_patch(model, state, &p);
                sample_patch(model, state, probe, &p, contact);
            }
    }
}

double kn_sample_gap_rate(const kn_model *model, const kn_state *state, const kn_sample *s, const void *field)
{
    size_t stride = model->stride;
    double rate = -dot(s->normal, state->probe[s->probe].velocity_m_s);
    for (int a = 0; a < 9; a++)
        for (size_t k = 0; k < 3; k++)
            rate += s->weight[a] * s->normal[k] * kn_real_get(model, field, s->offset[a] + k * stride);
    return rate;
}

// --- the step's two ends --------------------------------------------------------------------------------------------

void kn_contact_find(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact)
{
    contact->hold_count = contact->sample_count = 0;
    for (int p = 0; p < model->def.probe_count; p++) {
        follow(&state->probe[p], &input->probe[p], model->def.solver.dt_s);
        if (!state->probe[p].attached) {
            memset(state->held + (size_t)p * (size_t)model->top_count, 0, (size_t)model->top_count);
            continue;
        }
        if (model->def.probe[p].shape == KN_PROBE_PLATE) find_holds(model, state, p, contact);
        else find_samples(model, state, p, contact);
    }
}

static void add_force(kn_probe_output *out, const double at[3], const double force[3])
{
    double arm[3], torque[3];
    for (int k = 0; k < 3; k++) arm[k] = at[k] - out->position_m[k];
    cross(arm, force, torque);
    for (int k = 0; k < 3; k++) out->force_n[k] += force[k], out->torque_n_m[k] += torque[k];
    out->contacts++;
}

static void end_hold(const kn_model *model, kn_state *state, const kn_hold *hold, kn_output *output)
{
    // work goes by the node's own motion: other than the plate's at first touch, and done on a node that pulls, too
    state->probe[hold->probe].work_j -= model->def.solver.dt_s * dot(hold->force_n, hold->velocity_m_s);
    if (hold->gone || !(hold->force_n[2] >= 0)) { // it pulls: let go
        state->held[(size_t)hold->probe * (size_t)model->top_count + (size_t)hold->top] = 0;
        return;
    }
    double x[3];
    kn_state_position(model, state, hold->node, x);
    add_force(&output->probe[hold->probe], x, hold->force_n);
}

static void end_sample(const kn_model *model, kn_state *state, const kn_sample *s, kn_output *output)
{
    if (!(s->force_n > 0)) return;
    state->probe[s->probe].work_j +=
        model->def.solver.dt_s * s->force_n * dot(s->normal, state->probe[s->probe].velocity_m_s);
    double at[3], force[3];
    for (int k = 0; k < 3; k++) {
        at[k] =
            state->probe[s->probe].position_m[k] + s->normal[k] * (model->def.probe[s->probe].radius_m - s->depth_m);
        force[k] = -s->force_n * s->normal[k];
    }
    add_force(&output->probe[s->probe], at, force);
}

void kn_contact_end(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact,
                    kn_output *output)
{
    double dt = model->def.solver.dt_s;
    for (int p = 0; p < model->def.probe_count; p++) {
        const double *at = state->probe[p].attached ? state->probe[p].position_m : input->probe[p].position_m;
        memcpy(output->probe[p].position_m, at, sizeof output->probe[p].position_m);
    }
    for (int i = 0; i < contact->hold_count; i++) end_hold(model, state, &contact->hold[i], output);
    for (int i = 0; i < contact->sample_count; i++) end_sample(model, state, &contact->sample[i], output);
    for (int p = 0; p < model->def.probe_count; p++) {
        kn_probe_state *probe = &state->probe[p];
        kn_probe_output *out = &output->probe[p];
        if (!probe->attached) continue;
        probe->contacts = out->contacts;
        for (int k = 0; k < 3; k++) out->position_m[k] = probe->position_m[k] += dt * probe->velocity_m_s[k];
        out->work_j = probe->work_j;
    }
}

// --- clearance ------------------------------------------------------------------------------------------------------

static double plate_clearance(const kn_model *model, const kn_state *state, const kn_probe_def *def, const double at[3])
{
    double clear = INFINITY, x[3];
    for (int t = 0; t < model->top_count; t++) {
        kn_state_position(model, state, model->top[t], x);
        if (under_plate(model, def, at, x)) clear = fmin(clear, at[2] - x[2]);
    }
    return clear;
}

static double sphere_clearance(const kn_model *model, const kn_state *state, const kn_probe_def *def,
                               const double at[3])
{
    double nearest = INFINITY, weight[9], point[3], away[3], outwards[3], sign = 1;
    for (int f = 0; f < model->face_count; f++)
        for (int v = 0; v < model->face[f].len[1]; v++)
            for (int u = 0; u < model->face[f].len[0]; u++) {
                patch p = {.face = &model->face[f], .u = u, .v = v};
                kn_state_position(model, state, face_node(p.face, u, v), point);
                away_from(model, point, at, away);
                if (sqrt(dot(away, away)) > nearest + 2 * p.face->spacing_m) continue;
                load_patch(model, state, &p);
                for (int i = 0; i < 9; i++) {
                    if (!patch_point(&p, 0.5 * (i % 3 - 1), 0.5 * (i / 3 - 1), weight, point)) continue;
                    away_from(model, point, at, away);
                    double distance = sqrt(dot(away, away));
                    if (distance >= nearest) continue;
                    nearest = distance;
                    patch_normal(&p, outwards);
                    sign = dot(away, outwards) < 0 ? -1 : 1; // the centre is under the skin
                }
            }
    return sign * nearest - def->radius_m;
}

double kn_clearance(const kn_model *model, const kn_state *state, int p, const double position_m[3])
{
    const kn_probe_def *def = &model->def.probe[p];
    if (def->shape == KN_PROBE_PLATE) return plate_clearance(model, state, def, position_m);
    return model->skin_count > 0 ? net_clearance(model, state, def, position_m)
                                 : sphere_clearance(model, state, def, position_m);
}
