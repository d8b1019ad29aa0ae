#include "core/touch.h"
#include "core/solve/solver.h"
#include "core/shape.h"
#include "core/algebra/algebra.h"

#include <math.h>
#include <string.h>

#define CELLS KN_TOUCH_CELLS

// --- face -----------------------------------------------------------------------------------------------------------

// Return how far a tool reaches from its position in a direction of the tool frame, m.
static double reach(const kn_model *model, int p, const double way[3])
{
    const kn_probe_def *def = &model->def.probe[p];
    if (def->shape != KN_PROBE_PLATE) return kn_shape_support(&model->shape[p], way);
    return 0.5 * (def->size_m[0] * fabs(way[0]) + def->size_m[1] * fabs(way[1]));
}

void kn_touch_face_of(const kn_model *model, int p, const double normal[3], kn_touch_face *face)
{
    // rotate the tool's x and y into the plane of the face, by the formulas in touch.h
    static const double z[3] = {0, 0, 1};
    double up = 1 + normal[2], *axis[2] = {face->u, face->v};
    for (int i = 0; i < 2; i++) {
        double turn = up > 1e-6 ? normal[i] / up : 0, back[3];
        for (int k = 0; k < 3; k++) axis[i][k] = (k == i) - turn * (normal[k] + z[k]);
        // from z to n = -z there is no single shortest rotation: take u = x, v = -y
        if (up <= 1e-6 && i == 1) axis[i][1] = -1;
        for (int k = 0; k < 3; k++) back[k] = -axis[i][k];
        face->low_m[i] = -reach(model, p, back);
        face->size_m[i] = reach(model, p, axis[i]) - face->low_m[i];
    }
}

// --- pieces of the contact ------------------------------------------------------------------------------------------

typedef struct piece { // a piece of the contact: a sample or a held node; vectors in the scene's frame
    // arm_m: vector from the tool's position to the piece; normal: outward normal of the object at the piece
    double arm_m[3], normal[3];
    double force_n[3]; // force of the piece on the tool
    double pressing_n; // component of force_n along the normal
    double area_m2;
    const kn_sample *sample; // the sample; NULL if the piece is a held node
} piece;

// Compute the tangential velocity of the skin relative to the tool at a sample.
static void slip_of(const kn_model *m, const kn_contact *c, const kn_state *state, const kn_sample *s, double slip[3])
{
    double tool[3];
    kn_six_velocity(c->tool[s->probe].velocity, s->arm_m, tool);
    kn_sample_velocity(m, s, state->velocity, slip);
    for (int k = 0; k < 3; k++) slip[k] -= tool[k];
    double along = kn_dot(slip, s->normal);
    for (int k = 0; k < 3; k++) slip[k] -= along * s->normal[k];
}

static bool piece_of_sample(const kn_model *m, int p, const kn_sample *s, piece *out)
{
    double foundation = m->def.probe[p].foundation_n_m3;
    if (s->probe != p || !s->line.active) return false;
    memcpy(out->arm_m, s->arm_m, sizeof out->arm_m);
    for (int k = 0; k < 3; k++) out->normal[k] = -s->normal[k], out->force_n[k] = -s->force_n[k];
    out->pressing_n = s->pressing_n;
    // the sample's area A follows from its foundation stiffness k A
    out->area_m2 = s->foundation_n_m / (foundation > 0 ? foundation : KN_FOUNDATION_N_M3);
    out->sample = s;
    return true;
}

// A part of a node's cell lies under the plate. Return the width of this part along one axis, but at least a tenth of
// the cell, because a held node may lie just beside the plate.
static double under(double x, double size_m, double cell_m)
{
    double half = 0.5 * size_m;
    return fmax(fmin(x + 0.5 * cell_m, half) - fmax(x - 0.5 * cell_m, -half), 0.1 * cell_m);
}

static bool piece_of_hold(const kn_model *m, const kn_state *state, int p, const kn_held_node *hold, piece *out)
{
    const kn_probe_def *def = &m->def.probe[p];
    double h = m->def.spacing_m;
    if (hold->probe != p || hold->gone || !(hold->force_n[2] >= hold->lowest_n) || hold->force_n[2] == 0) return false;
    *out = (piece){.normal = {0, 0, 1}, .pressing_n = hold->force_n[2]};
    memcpy(out->force_n, hold->force_n, sizeof out->force_n);
    kn_state_position(m, state, hold->node, out->arm_m);
    for (int k = 0; k < 3; k++) out->arm_m[k] -= state->probe[p].position_m[k];
    out->area_m2 = under(out->arm_m[0], def->size_m[0], h) *
                   (m->grid.flat ? m->grid.depth_m : under(out->arm_m[1], def->size_m[1], h));
    return true;
}

// Get the next piece of the contact of probe p from number *at on, and advance *at. Return false if there is none.
static bool next_piece(const kn_model *m, const kn_contact *c, const kn_state *state, int p, int *at, piece *out)
{
    for (; *at < c->hold_count + c->sample_count; ++*at) {
        int i = *at - c->hold_count;
        if (i < 0 ? piece_of_hold(m, state, p, &c->hold[*at], out) : piece_of_sample(m, p, &c->sample[i], out))
            return ++*at, true;
    }
    return false;
}

// --- patch ----------------------------------------------------------------------------------------------------------

// Sum area, normal, centre and slip over the pieces, weighted by the absolute value of the normal force. With this
// weight, pieces that pull by adhesion do not reverse the normal, and the centre stays within the contact. Return the
// sum of the weights.
static double sum_up(const kn_model *m, const kn_contact *c, const kn_state *state, int p, kn_touch *t)
{
    double sum = 0;
    piece one;
    for (int at = 0; next_piece(m, c, state, p, &at, &one);) {
        double weight = fabs(one.pressing_n), slip[3] = {0};
        if (one.sample) slip_of(m, c, state, one.sample, slip);
        sum += weight;
        if (weight > 0) t->area_m2 += one.area_m2;
        t->peak_pressure_pa = fmax(t->peak_pressure_pa, one.pressing_n / one.area_m2);
        for (int k = 0; k < 3; k++) {
            t->normal[k] += weight * one.normal[k];
            t->centre_m[k] += weight * one.arm_m[k];
            t->slip_velocity_m_s[k] += weight * slip[k];
        }
    }
    return sum;
}

// Rotate a vector into the tool's frame and scale it.
static void into_tool(const double turn[3][3], double scale, double v[3])
{
    double own[3];
    for (int k = 0; k < 3; k++) own[k] = turn[0][k] * v[0] + turn[1][k] * v[1] + turn[2][k] * v[2];
    for (int k = 0; k < 3; k++) v[k] = scale * own[k];
}

typedef struct span { // a range first .. last of cells of the pressure map, along one axis
    int first, last;
    double share[CELLS];
} span;

// Spread a load evenly over an interval of length `width` with its middle at x, and compute the share of every cell. An
// interval that reaches beyond the face is cut to the face, and the shares still sum to 1.
static void spread(double x, double width, double low, double size, span *s)
{
    double cell = size / CELLS, at = (x - low) / cell, half = 0.5 * width / cell;
    double from = fmin(fmax(at - half, 0), CELLS - 2e-6), to = fmax(fmin(at + half, CELLS), from + 1e-6);
    s->first = (int)from;
    s->last = to > s->first + 1 ? (int)ceil(to) - 1 : s->first;
    for (int i = s->first; i <= s->last; i++)
        s->share[i] = ((to < i + 1 ? to : i + 1) - (from > i ? from : i)) / (to - from);
}

// Add the pressure of one piece to the map: its force along the mean normal, spread over the area of the piece.
static void map_piece(const kn_touch_face *face, const double turn[3][3], piece *one, kn_touch *t)
{
    span across, up;
    double width = sqrt(one->area_m2);
    into_tool(turn, 1, one->arm_m);
    into_tool(turn, 1, one->force_n);
    spread(kn_dot(one->arm_m, face->u), width, face->low_m[0], face->size_m[0], &across);
    spread(kn_dot(one->arm_m, face->v), width, face->low_m[1], face->size_m[1], &up);
    double pressure = kn_dot(one->force_n, t->normal) * CELLS * CELLS / (face->size_m[0] * face->size_m[1]);
    for (int i = up.first; i <= up.last; i++)
        for (int j = across.first; j <= across.last; j++)
            t->pressure_pa[i][j] += pressure * up.share[i] * across.share[j];
}

bool kn_touch_read(const kn_model *model, const kn_state *state, const kn_scratch *scratch, int p, kn_touch *touch)
{
    const kn_contact *contact = kn_scratch_contact(scratch, state);
    memset(touch, 0, sizeof *touch);
    if (!contact) return false;
    if (!state->probe[p].attached) return true;
    double sum = sum_up(model, contact, state, p, touch);
    if (!(sum > 0)) return true;
    const double(*turn)[3] = (const double(*)[3])contact->tool[p].turn;
    // divide the sums by the weights, and rotate them into the tool frame
    into_tool(turn, 1 / sum, touch->centre_m);
    into_tool(turn, 1 / sum, touch->slip_velocity_m_s);
    into_tool(turn, 1 / sum, touch->normal);
    // a mean normal of length 0 means that the object surrounds the tool: take z
    double size = sqrt(kn_dot(touch->normal, touch->normal));
    for (int k = 0; k < 3; k++) touch->normal[k] = size > 1e-6 ? touch->normal[k] / size : k == 2;
    // the tangential velocities on the flanks of a ball can have a mean component along the mean normal: remove it
    double along = kn_dot(touch->slip_velocity_m_s, touch->normal);
    for (int k = 0; k < 3; k++) touch->slip_velocity_m_s[k] -= along * touch->normal[k];

    // fill the pressure map in a second pass over the pieces, because it needs the mean normal
    kn_touch_face face;
    piece one;
    kn_touch_face_of(model, p, touch->normal, &face);
    for (int at = 0; next_piece(model, contact, state, p, &at, &one);) map_piece(&face, turn, &one, touch);
    return true;
}

// --- nodes ----------------------------------------------------------------------------------------------------------

bool kn_touch_nodes(const kn_model *m, const kn_state *state, const kn_scratch *scratch, double (*force_n)[3])
{
    const kn_contact *c = kn_scratch_contact(scratch, state);
    memset(force_n, 0, (size_t)m->node_count * sizeof *force_n);
    if (!c) return false;
    // add the forces of plates on held nodes, then the forces of tools on samples
    for (const kn_held_node *hold = c->hold; hold < c->hold + c->hold_count; hold++)
        for (int k = 0; k < 3 && !hold->gone && hold->force_n[2] >= hold->lowest_n; k++)
            force_n[hold->node][k] -= hold->force_n[k];
    for (const kn_sample *s = c->sample; s < c->sample + c->sample_count; s++)
        for (int a = 0; a < s->patch->nodes && s->probe != KN_TABLE && s->line.active; a++)
            for (int k = 0; k < 3; k++) force_n[s->patch->node[a]][k] += s->weight[a] * s->force_n[k];
    return true;
}
