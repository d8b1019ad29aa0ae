#include "core/solve/contact.h"
#include "core/algebra/algebra.h"
#include "core/solve/kernel.h"
#include "core/lattice/lattice.h"

#include <math.h>
#include <string.h>

// --- plate ----------------------------------------------------------------------------------------------------------

// Return whether a point is under the plate. The slack makes sure that a node at the plate's edge is under the plate,
// whatever the rounding of its position.
static bool under_plate(const kn_model *model, const kn_probe_def *def, const double plate[3], const double x[3])
{
    double slack = 0.1 * model->def.spacing_m;
    return fabs(x[0] - plate[0]) <= 0.5 * def->size_m[0] + slack &&
           fabs(x[1] - plate[1]) <= 0.5 * def->size_m[1] + slack;
}

// Return whether another plate holds the top node t. The first plate that touches a node holds it.
static bool held_by_other(const kn_model *model, const kn_state *state, int p, int t)
{
    for (int q = 0; q < model->def.probe_count; q++)
        if (q != p && state->held[(size_t)q * (size_t)model->top_count + (size_t)t]) return true;
    return false;
}

// Return true if a node that is not held moves away from the plate by itself. `above`: depth of the node above the
// plane of the plate; `way`: its own displacement in this step. If such a node were held, a plate that slows down would
// take back nodes that it has just released. A released node may overlap the plate by the rounding error of its
// displacement; ROUNDING is the limit of this overlap.
#define ROUNDING 0x1p-20
static bool gets_away(double above, double way, double displacement)
{
    return above + way <= ROUNDING * fabs(displacement);
}

// List the nodes that plate p holds in this step: those held already, and those that it meets now.
static void find_holds(const kn_model *model, kn_state *state, int p, kn_contact *contact)
{
    const kn_probe_state *probe = &state->probe[p];
    const kn_probe_def *def = &model->def.probe[p];
    // plane: height of the plate at the end of the step
    double dt = model->def.solver.dt_s, plane = probe->position_m[2] + dt * probe->velocity_m_s[2];
    uint8_t *held = state->held + (size_t)p * (size_t)model->top_count;
    for (int t = 0; t < model->top_count; t++) {
        kn_held_node hold = {.node = model->top[t], .top = t, .probe = p, .slides = def->surface == KN_PLATE_SLIDES};
        hold.lowest_n = -def->adhesion_pa * model->top_share[t] * model->top_area_m2;
        memcpy(hold.velocity_m_s, probe->velocity_m_s, sizeof hold.velocity_m_s);
        // a node that slides may leave the plate sideways
        if (held[t] && hold.slides) {
            double x[3];
            kn_state_position(model, state, hold.node, x);
            if (!under_plate(model, def, probe->position_m, x)) {
                held[t] = 0;
                continue;
            }
        }
        if (!held[t]) {
            // a new node must be under the plate and in its path, and must not move away by itself
            double x[3], v[3];
            kn_state_position(model, state, hold.node, x);
            if (x[2] <= plane || !under_plate(model, def, probe->position_m, x)) continue;
            kn_state_velocity(model, state, hold.node, v);
            if (gets_away(x[2] - plane, dt * v[2], x[2] - model->rest_m[hold.node][2])) continue;
            // If a node is deeper in the plate than it can have got in this step, it came in from the side: do not hold
            // it. Under a plate that goes up, a node can get into the plate only by its own motion. Without this limit,
            // the plate would push the node down by up to a quarter of a cell.
            double down = fmax(0, -probe->velocity_m_s[2]);
            double came = dt * fmax(0, v[2] - probe->velocity_m_s[2]), h = model->def.spacing_m;
            double deepest = probe->velocity_m_s[2] > 0 ? 2 * came + 1e-3 * h : 0.25 * h + dt * down;
            if (x[2] - plane > deepest || held_by_other(model, state, p, t)) continue;
            // at first touch, the plate moves the node only from the node's present height down to the plate's height
            // at the end of the step
            hold.velocity_m_s[2] = (plane - x[2]) / dt;
            held[t] = 1;
        }
        if (contact->hold_count < contact->hold_max) contact->hold[contact->hold_count++] = hold;
    }
}

// --- one tool against one point -------------------------------------------------------------------------------------

// Data of the search for samples under one tool.
typedef struct search {
    const kn_model *model;
    const kn_state *state;
    kn_contact *contact;
    const kn_probe_def *def;
    const kn_shape *shape;
    const kn_tool_step *tool;
    const double *at_m;      // position of the tool
    const double (*turn)[3]; // rotation of the tool; NULL: none
    double relief_m;
    double margin_m; // largest distance from the tool at which a sample can touch in this step
    double foundation_n_m3;
    int probe;
} search;

// Begin the search for samples under probe p at the tool's present pose.
static search begin(const kn_model *model, const kn_state *state, int p, kn_contact *contact)
{
    const kn_probe_def *def = &model->def.probe[p];
    search s = {.model = model, .state = state, .contact = contact, .def = def, .probe = p};
    s.shape = &model->shape[p];
    s.tool = &contact->tool[p];
    s.at_m = state->probe[p].position_m;
    s.turn = s.tool->turned ? (const double(*)[3])s.tool->turn : NULL;
    s.relief_m = state->tool[p].relief_m;
    s.foundation_n_m3 = kn_probe_foundation(def);
    s.margin_m = kn_contact_margin(model, def);
    // a coupled tool may approach at the speed that its coupling gives it in the air: add the path of one step to the
    // margin
    if (s.tool->coupled) {
        double speed = sqrt(kn_dot(s.tool->drive, s.tool->drive)) / s.tool->give[0];
        s.margin_m += fmin(model->def.solver.dt_s * speed, s.shape->fine_m);
    }
    return s;
}

// Compute the vector from the tool to a point. For a flat object, ignore the tool's y, because a ball acts as a disc.
static void away_from(const kn_model *model, const double centre[3], const double point[3], double away[3])
{
    for (int k = 0; k < 3; k++) away[k] = point[k] - centre[k];
    if (model->grid.flat) away[1] = 0;
}

// Return the signed distance of a point from the tool's surface. `arm`: vector from the tool's position to the point;
// `turn`: rotation of the tool, NULL: none. Store the direction in which the tool pushes at the point.
static double distance_of(const kn_shape *shape, const double (*turn)[3], const double arm[3], double normal[3])
{
    double own[3], way[3];
    if (!turn) return kn_shape_distance(shape, arm, normal);
    for (int k = 0; k < 3; k++) own[k] = turn[0][k] * arm[0] + turn[1][k] * arm[1] + turn[2][k] * arm[2];
    double distance = kn_shape_distance(shape, own, way);
    for (int k = 0; k < 3; k++) normal[k] = kn_dot(turn[k], way);
    return distance;
}

// Project the normal onto the x-z plane of a flat object. If the projection is 0, the normal points up.
static void stay_in_plane(double normal[3])
{
    double size = hypot(normal[0], normal[2]);
    normal[0] /= size > 0 ? size : 1;
    normal[1] = 0;
    normal[2] = size > 0 ? normal[2] / size : 1;
}

// Add a sample at a point of the skin, and fill in the members that depend on the tool. Its first sample begins the
// patch of `nodes` nodes. Return NULL if the point is too far from the tool, or if the skin there faces away from the
// tool. The second condition keeps a tool from touching the far side of a thin block.
static kn_sample *sample_at(const search *s, const double point[3], const double outwards[3], double area_m2,
                            kn_contact_patch **patch, int nodes, const int *node)
{
    double arm[3], normal[3], far = s->shape->bound_m + s->margin_m;
    away_from(s->model, s->at_m, point, arm);
    // most points that are too far are outside the ball around the shape, too
    if (kn_dot(arm, arm) > far * far) return NULL;
    double distance = distance_of(s->shape, s->turn, arm, normal) + s->relief_m;
    if (s->model->grid.flat) stay_in_plane(normal);
    if (distance > s->margin_m || kn_dot(normal, outwards) > 0) return NULL;
    if (!*patch) {
        *patch =
            kn_contact_patch_begin(s->model, s->contact, s->probe, nodes, node, KN_PATCH_SIDE_MAX * KN_PATCH_SIDE_MAX);
    }
    kn_sample *sample = kn_sample_begin(s->contact, *patch);
    if (!sample) return NULL;
    sample->friction = s->def->friction;
    sample->depth_m = -distance;
    sample->foundation_n_m = s->foundation_n_m3 * area_m2;
    sample->layer_m = s->tool->coupled ? KN_LAYER * s->shape->fine_m : INFINITY;
    memcpy(sample->normal, normal, sizeof sample->normal);
    memcpy(sample->arm_m, arm, sizeof sample->arm_m);
    memcpy(sample->point_m, point, sizeof sample->point_m);
    return sample;
}

// Return the key of a sample. Keys ascend in the order in which samples are found: by probe, then face, then patch of
// the face, then place within the patch.
static uint64_t key_of(int probe, int face, int patch, int place)
{
    return ((uint64_t)(probe + 1) << 56) + ((uint64_t)face << 48) + ((uint64_t)patch << 8) + (uint64_t)place;
}

// --- skin of a block ------------------------------------------------------------------------------------------------

// Compute the quadratic B-spline weights of the nodes i - 1, i and i + 1 of n at the place i + t, t in [-1/2, 1/2]. At
// the end of the row a neighbour is missing. There the row is continued as a straight line (x_-1 = 2 x_0 - x_1), so
// that the skin ends at the last node.
static void spline(double t, int i, int n, double w[3])
{
    w[0] = 0.5 * (0.5 - t) * (0.5 - t);
    w[1] = 0.75 - t * t;
    w[2] = 0.5 * (0.5 + t) * (0.5 + t);
    if (i == 0) w[1] += 2 * w[0], w[2] -= w[0], w[0] = 0;
    if (i == n - 1) w[1] += 2 * w[2], w[0] -= w[2], w[2] = 0;
}

typedef struct patch { // patch of skin that belongs to one node of a face, with the 3 x 3 nodes around this node
    const kn_face *face;
    int u, v;
    int node[9];
    double x[9][3];
} patch;

static int clamp(int i, int n) { return i < 0 ? 0 : i >= n ? n - 1 : i; }
static int face_node(const kn_face *face, int u, int v) { return face->origin + u * face->step[0] + v * face->step[1]; }

static void load_patch(const kn_model *model, const kn_state *state, patch *p)
{
    for (int dv = -1, a = 0; dv <= 1; dv++)
        for (int du = -1; du <= 1; du++, a++) {
            p->node[a] = face_node(p->face, clamp(p->u + du, p->face->len[0]), clamp(p->v + dv, p->face->len[1]));
            kn_state_position(model, state, p->node[a], p->x[a]);
        }
}

// Compute the weights of the nine nodes from the weights along u and v, and the point of the skin that they give.
static void blend(const patch *p, const double wu[3], const double wv[3], double weight[9], double point[3])
{
    for (int k = 0; k < 3; k++) point[k] = 0;
    for (int a = 0; a < 9; a++) {
        weight[a] = wu[a % 3] * wv[a / 3];
        for (int k = 0; k < 3; k++) point[k] += weight[a] * p->x[a][k];
    }
}

// Compute the weights of the bilinear skin along one side. This skin is straight from node to node.
static void straight(double t, double w[3]) { w[0] = fmax(-t, 0), w[1] = 1 - fabs(t), w[2] = fmax(t, 0); }

static void weights(const kn_model *model, double t, int i, int n, double w[3])
{
    if (model->def.skin == KN_SKIN_BILINEAR) straight(t, w);
    else spline(t, i, n, w);
}

// Return true if the place i + t of a row of n nodes lies outside the block. If node i is at the end of the row, one
// half of its patch lies outside.
static bool overhangs(double t, int i, int n) { return (t < 0 && i == 0) || (t > 0 && i == n - 1); }

// Compute the point (tu, tv) of a patch, each in [-1/2, 1/2]. Return false if this point lies outside the block.
static bool patch_point(const kn_model *model, const patch *p, double tu, double tv, double weight[9], double point[3])
{
    const int *len = p->face->len;
    if (overhangs(tu, p->u, len[0]) || overhangs(tv, p->v, len[1])) return false;
    double wu[3], wv[3];
    weights(model, tu, p->u, len[0], wu);
    weights(model, tv, p->v, len[1], wv);
    blend(p, wu, wv, weight, point);
    return true;
}

// Compute the weights of `per` samples along one side of a patch. Bit j of the result is set if sample j is on the
// block.
static unsigned side_weights(const kn_model *model, int per, int i, int n, double w[KN_PATCH_SIDE_MAX][3])
{
    unsigned on = 0;
    for (int j = 0; j < per; j++) {
        double t = (j + 0.5) / per - 0.5;
        if (!overhangs(t, i, n)) on |= 1u << j;
        spline(t, i, n, w[j]);
    }
    for (int j = 0; model->def.skin == KN_SKIN_BILINEAR && j < per; j++) straight((j + 0.5) / per - 0.5, w[j]);
    return on;
}

// Compute the outward normal of the skin at a patch's node, not normalised. A face that is one node wide belongs to a
// flat object and runs along y.
static void patch_normal(const patch *p, double normal[3])
{
    double du[3], dv[3];
    for (int k = 0; k < 3; k++) {
        du[k] = p->face->len[0] == 1 ? (k == 1) : p->x[5][k] - p->x[3][k];
        dv[k] = p->face->len[1] == 1 ? (k == 1) : p->x[7][k] - p->x[1][k];
    }
    kn_cross(du, dv, normal);
}

// Add the samples of one patch.
static void sample_patch(const search *s, const patch *p)
{
    const kn_model *model = s->model;
    double h = p->face->spacing_m, outwards[3];
    int per = kn_samples_per_patch(h, s->shape->fine_m), per_u = per, per_v = per;
    double area = h * h / (per * per);
    // on a flat object, one sample along y stands for the whole thickness
    if (model->grid.flat) {
        area *= model->grid.depth_m / h * per;
        if (p->face->len[0] == 1) per_u = 1;
        else per_v = 1;
    }
    patch_normal(p, outwards);
    // the weights along u do not depend on v: compute them once per side, not once per sample
    double wu[KN_PATCH_SIDE_MAX][3], wv[KN_PATCH_SIDE_MAX][3];
    unsigned on_u = side_weights(model, per_u, p->u, p->face->len[0], wu);
    unsigned on_v = side_weights(model, per_v, p->v, p->face->len[1], wv);
    kn_contact_patch *samples = NULL;
    // along: for each place along u, the skin's points at the three rows of nodes
    double along[KN_PATCH_SIDE_MAX][3][3];
    for (int j = 0; j < per_u; j++)
        for (int a = 0; a < 9; a++)
            for (int k = 0; k < 3; k++)
                along[j][a / 3][k] = (a % 3 > 0 ? along[j][a / 3][k] : 0) + wu[j][a % 3] * p->x[a][k];
    for (int i = 0; i < per_u * per_v; i++) {
        const double *u = wu[i % per_u], *v = wv[i / per_u];
        double point[3];
        if (!(on_u >> i % per_u & 1) || !(on_v >> i / per_u & 1)) continue;
        for (int k = 0; k < 3; k++) {
            const double(*row)[3] = (const double(*)[3])along[i % per_u];
            point[k] = v[0] * row[0][k] + v[1] * row[1][k] + v[2] * row[2][k];
        }
        kn_sample *sample = sample_at(s, point, outwards, area, &samples, 9, p->node);
        if (!sample) continue;
        sample->key = key_of(s->probe, (int)(p->face - model->face), p->v * p->face->len[0] + p->u, i);
        for (int a = 0; a < 9; a++) sample->weight[a] = u[a % 3] * v[a / 3];
        kn_sample_end(model, s->contact, sample);
    }
}

// Return an upper bound of the distance of a patch's samples from its node. A sample is a mean of nine nodes in which
// the others than the node itself have at most SPREAD of the weight: 1 - 0.609^2 at a place of 3/8.
#define SPREAD 0.63
static double reach_of(const patch *p)
{
    double most2 = 0;
    for (int a = 0; a < 9; a++) {
        const double d[3] = {p->x[a][0] - p->x[4][0], p->x[a][1] - p->x[4][1], p->x[a][2] - p->x[4][2]};
        most2 = fmax(most2, kn_dot(d, d));
    }
    return SPREAD * sqrt(most2);
}

// Add the samples of a block's faces. A patch out of the tool's reach is skipped: a first test uses the ball around the
// tool, a second test the tool's distance from the patch's node.
static void find_on_faces(const search *s)
{
    for (int f = 0; f < s->model->face_count; f++) {
        const kn_face *face = &s->model->face[f];
        double reach = 1.5 * face->spacing_m + s->margin_m;
        for (int v = 0; v < face->len[1]; v++)
            for (int u = 0; u < face->len[0]; u++) {
                double x[3], arm[3], normal[3], far = s->shape->bound_m + reach;
                kn_state_position(s->model, s->state, face_node(face, u, v), x);
                away_from(s->model, s->at_m, x, arm);
                if (kn_dot(arm, arm) > far * far) continue;
                const double distance = distance_of(s->shape, s->turn, arm, normal);
                if (distance > reach) continue;
                patch p = {.face = face, .u = u, .v = v};
                load_patch(s->model, s->state, &p);
                if (distance <= reach_of(&p) + s->margin_m) sample_patch(s, &p);
            }
    }
}

// --- skin of a net --------------------------------------------------------------------------------------------------

// Load the corners of a triangle of the skin, and compute its outward normal, whose length is twice the area.
static void load_triangle(const kn_model *model, const kn_state *state, const int node[3], double x[3][3],
                          double normal[3])
{
    double u[3], v[3];
    for (int c = 0; c < 3; c++) kn_state_position(model, state, node[c], x[c]);
    for (int k = 0; k < 3; k++) u[k] = x[1][k] - x[0][k], v[k] = x[2][k] - x[0][k];
    kn_cross(u, v, normal);
}

// Compute the barycentric weights of the centre of small triangle i. A triangle is cut into per^2 small triangles.
static void small_centre(int i, int per, double weight[3])
{
    int row = 0;
    while ((row + 1) * (row + 1) <= i) row++;
    // row r holds 2 r + 1 small triangles, alternately upright and upside down
    int at = i - row * row, upward = at % 2 == 0;
    double third = upward ? 1.0 / 3 : 2.0 / 3;
    weight[1] = (at / 2 + third) / per;
    weight[2] = (per - 1 - row + (upward ? 1.0 / 3 : 2.0 / 3)) / per;
    weight[0] = 1 - weight[1] - weight[2];
}

// Add the samples of one triangle of a net's skin.
static void sample_triangle(const search *s, int triangle)
{
    const kn_model *model = s->model;
    const int *node = model->skin[triangle];
    double x[3][3], outwards[3];
    int per = kn_samples_per_patch(model->def.spacing_m, s->shape->fine_m);
    double area = kn_skin_area(model, node) / (per * per);
    load_triangle(model, s->state, node, x, outwards);
    kn_contact_patch *samples = NULL;
    for (int i = 0; i < per * per; i++) {
        double weight[3], point[3];
        small_centre(i, per, weight);
        for (int k = 0; k < 3; k++) point[k] = weight[0] * x[0][k] + weight[1] * x[1][k] + weight[2] * x[2][k];
        kn_sample *sample = sample_at(s, point, outwards, area, &samples, 3, node);
        if (!sample) continue;
        sample->key = key_of(s->probe, 0, triangle, i);
        memcpy(sample->weight, weight, sizeof weight);
        kn_sample_end(model, s->contact, sample);
    }
}

// Add the samples of a net's skin. Triangles out of the tool's reach are skipped.
static void find_on_net(const search *s)
{
    const kn_model *model = s->model;
    for (int f = 0; f < model->skin_count; f++) {
        const int *node = model->skin[f];
        double x[3] = {0}, side = 0;
        // no point of a triangle is farther from a corner than the longest side
        for (int k = 0; k < 3; k++) {
            double a[3], b[3];
            kn_state_position(model, s->state, node[k], a);
            kn_state_position(model, s->state, node[(k + 1) % 3], b);
            for (int c = 0; c < 3; c++) b[c] -= a[c];
            side = fmax(side, kn_dot(b, b));
            if (k == 0) memcpy(x, a, sizeof x);
        }
        double reach = s->shape->bound_m + sqrt(side) + s->margin_m;
        for (int k = 0; k < 3; k++) x[k] -= s->at_m[k];
        if (kn_dot(x, x) <= reach * reach) sample_triangle(s, f);
    }
}

// List the samples of probe p near its tool (contact->tool[p]) at the present positions. The samples are in ascending
// order of their keys.
static void find_samples(const kn_model *model, const kn_state *state, int p, kn_contact *contact)
{
    search s = begin(model, state, p, contact);
    if (model->skin_count > 0) find_on_net(&s);
    else find_on_faces(&s);
}

// --- table ----------------------------------------------------------------------------------------------------------

// List the samples at which the table, the plane z = 0, may push the object.
static void find_table_samples(const kn_model *model, const kn_state *state, kn_contact *contact)
{
    for (int i = 0; i < model->base_count; i++) {
        double x[3];
        const int node = model->base[i];
        kn_state_position(model, state, node, x);
        // a node higher than a tenth of a spacing cannot touch in this step
        if (x[2] > 0.1 * model->def.spacing_m) continue;
        kn_sample *s = kn_sample_begin(contact, kn_contact_patch_begin(model, contact, KN_TABLE, 1, &node, 1));
        if (!s) continue;
        s->weight[0] = s->normal[2] = 1;
        s->depth_m = -x[2];
        s->friction = model->def.support_friction;
        memcpy(s->point_m, x, sizeof s->point_m);
        s->layer_m = INFINITY;
        s->foundation_n_m = KN_TABLE_N_M3 * model->base_area_m2[i];
        s->key = key_of(KN_TABLE, 0, i, 0);
        kn_sample_end(model, contact, s);
    }
}

// --- anchors of sticking samples ------------------------------------------------------------------------------------

// Restore the memory of a sample from its anchor of the last step. The stretch e turns with the tool, and its part
// along the normal is removed.
static void recall(const kn_model *model, const kn_contact *contact, const kn_anchor *anchor, kn_sample *s)
{
    double turned[3] = {0};
    s->bonds = anchor->flags & KN_ANCHOR_BONDS;
    // static friction, which is larger than sliding friction, holds a sample that did not slip in the last step
    if (!(anchor->flags & KN_ANCHOR_SLIPS) && s->friction > 0) s->friction *= KN_STICTION;
    if (s->probe != KN_TABLE) kn_cross(contact->tool[s->probe].velocity + 3, anchor->stretch_m, turned);
    for (int k = 0; k < 3; k++) s->stretch_m[k] = anchor->stretch_m[k] + model->def.solver.dt_s * turned[k];
    double out = kn_dot(s->stretch_m, s->normal);
    for (int k = 0; k < 3; k++) s->stretch_m[k] -= out * s->normal[k];
}

// Restore the memory of all samples. Anchors and samples are both in ascending order of their keys, so one pass over
// both is enough.
static void recall_all(const kn_model *model, const kn_state *state, kn_contact *contact)
{
    int at = 0;
    for (int i = 0; i < contact->sample_count; i++) {
        kn_sample *s = &contact->sample[i];
        while (at < state->anchor_count && state->anchor[at].key < s->key) at++;
        if (at < state->anchor_count && state->anchor[at].key == s->key) recall(model, contact, &state->anchor[at], s);
        else if (s->friction > 0) s->friction *= KN_STICTION;
        if (s->probe == KN_TABLE || !s->bonds) continue;
        const kn_probe_def *def = &model->def.probe[s->probe];
        // a sample that touched in the last step may pull up to the adhesion; a gripped sample may pull without limit
        s->lowest_m = -def->adhesion_pa / kn_probe_foundation(def);
        if (state->tool[s->probe].grip_n > 0) s->lowest_m = -INFINITY, s->friction = INFINITY;
    }
}

// Store the anchor of an active sample. Its stretch is computed from the tangential force, which does not exceed the
// friction cone.
static void remember(kn_state *state, const kn_sample *s)
{
    kn_anchor *a = &state->anchor[state->anchor_count++];
    *a = (kn_anchor){.key = s->key, .flags = KN_ANCHOR_BONDS};
    if (!(s->friction > 0)) return;
    double full = s->foundation_n_m;
    if (s->line.side_n_m < full) a->flags |= KN_ANCHOR_SLIPS;
    for (int k = 0; k < 3; k++) a->stretch_m[k] = -(s->force_n[k] - s->pressing_n * s->normal[k]) / full;
}

static void remember_all(kn_state *state, const kn_contact *contact)
{
    state->anchor_count = 0;
    if (!state->anchor) return;
    for (int i = 0; i < contact->sample_count; i++)
        if (contact->sample[i].line.active) remember(state, &contact->sample[i]);
}

// --- beginning and end of a step ------------------------------------------------------------------------------------

double kn_sample_gap_rate(const kn_contact *contact, const kn_sample *s)
{
    double v[3] = {0};
    if (s->probe != KN_TABLE) kn_six_velocity(contact->tool[s->probe].velocity, s->arm_m, v);
    return kn_dot(s->normal, s->rate_m_s) - kn_dot(s->normal, v);
}

// Shrink a tool that enters the model inside the object by its depth in the object, so that it does not push at first.
// The tool grows back slowly. `first`: first sample of the tool.
static void relieve(kn_state *state, int p, kn_contact *contact, int first)
{
    double deepest = 0;
    for (int i = first; i < contact->sample_count; i++) deepest = fmax(deepest, contact->sample[i].depth_m);
    for (int i = first; i < contact->sample_count; i++) contact->sample[i].depth_m -= deepest;
    state->tool[p].relief_m = deepest;
}

void kn_sample_push(kn_sample *s)
{
    s->pressing_n = fmax(0, s->foundation_n_m * s->depth_m);
    s->line.active = s->pressing_n > 0;
    for (int k = 0; k < 3; k++) s->force_n[k] = s->pressing_n * s->normal[k];
}

void kn_contact_find(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact)
{
    // first the table, then every tool, so that the keys of the samples ascend
    kn_contact_clear(contact);
    contact->coupled = false;
    find_table_samples(model, state, contact);
    for (int p = 0; p < model->def.probe_count; p++) {
        bool was = state->probe[p].attached;
        kn_tool_begin(model, state, p, &input->probe[p], &contact->tool[p]);
        if (!state->probe[p].attached) {
            // a plate that is not attached holds nothing
            memset(state->held + (size_t)p * (size_t)model->top_count, 0, (size_t)model->top_count);
            continue;
        }
        contact->coupled |= contact->tool[p].coupled;
        int first = contact->sample_count;
        if (model->def.probe[p].shape == KN_PROBE_PLATE) find_holds(model, state, p, contact);
        else find_samples(model, state, p, contact);
        if (!was && contact->tool[p].coupled) relieve(state, p, contact, first);
    }
    if (state->anchor) recall_all(model, state, contact);
}

// Add a force to the output of a probe. `arm`: vector from the tool's position to the point where the force acts.
static void add_force(kn_probe_output *out, const double arm[3], const double force[3])
{
    double torque[3];
    kn_cross(arm, force, torque);
    for (int k = 0; k < 3; k++) out->force_n[k] += force[k], out->torque_n_m[k] += torque[k];
    out->contacts++;
}

static void end_hold(const kn_model *model, kn_state *state, const kn_held_node *hold, kn_output *output)
{
    // the work is force times the node's own motion, which differs from the plate's motion at first touch; the work of
    // a node that pulls is negative
    state->probe[hold->probe].work_j -= model->def.solver.dt_s * kn_dot(hold->force_n, hold->velocity_m_s);
    // a held node that pulls harder than the adhesion is released
    if (hold->gone || !(hold->force_n[2] >= hold->lowest_n)) {
        state->held[(size_t)hold->probe * (size_t)model->top_count + (size_t)hold->top] = 0;
        return;
    }
    double arm[3];
    kn_state_position(model, state, hold->node, arm);
    for (int k = 0; k < 3; k++) arm[k] -= state->probe[hold->probe].position_m[k];
    add_force(&output->probe[hold->probe], arm, hold->force_n);
}

static void end_sample(const kn_model *model, kn_state *state, const kn_contact *contact, const kn_sample *s,
                       kn_output *output, double held_n[KN_PROBES_MAX][3])
{
    double force[3], v[3];
    if (s->probe == KN_TABLE || !s->line.active) return;
    kn_six_velocity(contact->tool[s->probe].velocity, s->arm_m, v);
    double *work = &state->probe[s->probe].work_j, dt = model->def.solver.dt_s;
    // add the work of the pressure, of the friction, and of a tool that grows back
    *work += dt * s->pressing_n * kn_dot(s->normal, v);
    if (s->friction > 0) *work += dt * (kn_dot(s->force_n, v) - s->pressing_n * kn_dot(s->normal, v));
    if (contact->tool[s->probe].growth_m_s > 0) *work += dt * s->pressing_n * contact->tool[s->probe].growth_m_s;
    for (int k = 0; k < 3; k++) force[k] = -s->force_n[k];
    add_force(&output->probe[s->probe], s->arm_m, force);
    // held_n: force that adhesion, friction and grip transmit, without the pressure
    for (int k = 0; k < 3; k++) held_n[s->probe][k] += s->force_n[k] - fmax(0, s->pressing_n) * s->normal[k];
}

static void end_tool(const kn_model *model, kn_state *state, int p, const kn_tool_step *tool, const double held_n[3],
                     kn_probe_output *out)
{
    kn_probe_state *probe = &state->probe[p];
    kn_tool_state *own = &state->tool[p];
    if (!probe->attached) return;
    // a grip whose force exceeds the limit is torn loose; it stays loose until the input's `grip` has been off and is
    // on again
    if (own->grip_n > 0 && kn_dot(held_n, held_n) > own->grip_n * own->grip_n) own->grip_n = -1;
    probe->contacts = out->contacts;
    kn_tool_advance(model, state, p, tool);
    memcpy(out->position_m, probe->position_m, sizeof out->position_m);
    if (kn_tool_turns(&model->def.probe[p]))
        memcpy(out->orientation_wxyz, own->orientation_wxyz, sizeof out->orientation_wxyz);
    out->work_j = probe->work_j;
}

void kn_contact_end(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact,
                    kn_output *output)
{
    double held_n[KN_PROBES_MAX][3] = {{0}};
    // a probe that is not attached gets the position of its pose as the output position
    for (int p = 0; p < model->def.probe_count; p++) {
        memcpy(output->probe[p].position_m, input->probe[p].position_m, sizeof output->probe[p].position_m);
        output->probe[p].orientation_wxyz[0] = 1;
    }
    for (int i = 0; i < contact->hold_count; i++) end_hold(model, state, &contact->hold[i], output);
    for (int i = 0; i < contact->sample_count; i++)
        end_sample(model, state, contact, &contact->sample[i], output, held_n);
    remember_all(state, contact);
    for (int p = 0; p < model->def.probe_count; p++)
        end_tool(model, state, p, &contact->tool[p], held_n[p], &output->probe[p]);
}

// --- clearance ------------------------------------------------------------------------------------------------------

// Data of the search for the point of the skin nearest to a tool.
typedef struct nearest {
    const kn_model *model;
    const kn_state *state;
    const kn_shape *shape;
    const double *at_m;
    double turn[3][3];
    double distance_m;
    bool under; // the tool is under the skin: the skin at the nearest point faces away from the tool
} nearest;

// Compare a point of the skin with the nearest point so far, and keep the nearer one.
static void consider(nearest *n, const double point[3], const double outwards[3])
{
    double arm[3], normal[3];
    away_from(n->model, n->at_m, point, arm);
    double distance = distance_of(n->shape, (const double(*)[3])n->turn, arm, normal);
    if (distance >= n->distance_m) return;
    n->distance_m = distance;
    n->under = kn_dot(normal, outwards) > 0;
}

static void consider_net(nearest *n)
{
    for (int f = 0; f < n->model->skin_count; f++) {
        double x[3][3], outwards[3], point[3];
        load_triangle(n->model, n->state, n->model->skin[f], x, outwards);
        // consider the corners, the middles of the sides and the centre of each triangle
        for (int i = 0; i < 7; i++) {
            for (int k = 0; k < 3; k++)
                point[k] = i < 3   ? x[i][k]
                           : i < 6 ? 0.5 * (x[i - 3][k] + x[(i - 2) % 3][k])
                                   : (x[0][k] + x[1][k] + x[2][k]) / 3;
            consider(n, point, outwards);
        }
    }
}

static void consider_faces(nearest *n)
{
    for (int f = 0; f < n->model->face_count; f++)
        for (int v = 0; v < n->model->face[f].len[1]; v++)
            for (int u = 0; u < n->model->face[f].len[0]; u++) {
                double weight[9], point[3], arm[3], outwards[3];
                patch p = {.face = &n->model->face[f], .u = u, .v = v};
                kn_state_position(n->model, n->state, face_node(p.face, u, v), point);
                away_from(n->model, n->at_m, point, arm);
                // a patch's points are within two spacings of its node
                double far = distance_of(n->shape, (const double(*)[3])n->turn, arm, outwards);
                if (far > n->distance_m + 2 * p.face->spacing_m) continue;
                load_patch(n->model, n->state, &p);
                patch_normal(&p, outwards);
                for (int i = 0; i < 9; i++)
                    if (patch_point(n->model, &p, 0.5 * (i % 3 - 1), 0.5 * (i / 3 - 1), weight, point))
                        consider(n, point, outwards);
            }
}

// Return the distance of the skin from probe p at a pose, for any shape but a plate; < 0 if the tool is under the skin.
// `turn`: rotation matrix of the tool. If a ball is under the skin, its depth is the distance of its centre from the
// skin plus its radius.
static double skin_clearance(const kn_model *model, const kn_state *state, int p, const double position_m[3],
                             const double turn[3][3])
{
    nearest n = {.model = model, .state = state, .shape = &model->shape[p], .at_m = position_m};
    n.distance_m = INFINITY;
    memcpy(n.turn, turn, sizeof n.turn);
    if (model->skin_count > 0) consider_net(&n);
    else consider_faces(&n);
    if (!n.under) return n.distance_m;
    return model->def.probe[p].shape == KN_PROBE_SPHERE ? -n.distance_m - 2 * model->def.probe[p].radius_m
                                                        : -fabs(n.distance_m);
}

double kn_clearance(const kn_model *model, const kn_state *state, int p, const double position_m[3],
                    const double orientation_wxyz[4])
{
    const kn_probe_def *def = &model->def.probe[p];
    double clear = INFINITY, x[3], turn[3][3];
    // for every shape but a plate, evaluate the distance of the shape at points of the skin
    if (def->shape != KN_PROBE_PLATE) {
        kn_tool_matrix(orientation_wxyz, turn);
        return skin_clearance(model, state, p, position_m, (const double(*)[3])turn);
    }
    // for a plate: the least height above the top nodes under the plate
    for (int t = 0; t < model->top_count; t++) {
        kn_state_position(model, state, model->top[t], x);
        if (under_plate(model, def, position_m, x)) clear = fmin(clear, position_m[2] - x[2]);
    }
    return clear;
}
