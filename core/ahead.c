#include "core/ahead.h"
#include "core/shape.h"
#include "core/tool.h"
#include "core/vec.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TICKS 8 // number of ticks in which a sweep visits all nodes of the skin

// Nodes that span the skin at one node: (x1 - x0) x (x3 - x2) points outwards.
typedef struct tangents {
    int node[4];
    // bends[i]: along node[2 i] .. node[2 i + 1], the skin is a spline, which passes beside the node
    bool bends[2];
} tangents;

struct kn_ahead {
    const kn_model *model;
    const kn_patches *patches;
    int probe, count, at; // number of the probe; number of nodes of the skin; next node that the sweep visits
    double reach_m;
    int *skin;
    tangents *along;                   // tangents at each node of the skin
    double *distance_m;                // distance of every node from the tool; INFINITY: out of reach
    int place[KN_PATCHES_MAX], places; // places found by the last sweep, as indices in `skin`; their number
};

// --- the skin -------------------------------------------------------------------------------------------------------

static int inside(int i, int n) { return i < 0 ? 0 : i >= n ? n - 1 : i; }

static int node_of(const kn_face *f, int u, int v)
{
    return f->origin + inside(u, f->len[0]) * f->step[0] + inside(v, f->len[1]) * f->step[1];
}

// Describe the skin at a face's node. A spline does not pass through inner nodes.
static tangents along_face(const kn_model *m, const kn_face *f, int u, int v)
{
    bool bends = m->def.skin == KN_SKIN_SPLINE;
    return (tangents){{node_of(f, u - 1, v), node_of(f, u + 1, v), node_of(f, u, v - 1), node_of(f, u, v + 1)},
                      {bends && u > 0 && u < f->len[0] - 1, bends && v > 0 && v < f->len[1] - 1}};
}

// Add a node of a face to the skin, unless another face has already added the node.
static void add_node(kn_ahead *s, bool *listed, int node, tangents along)
{
    if (listed[node]) return;
    listed[node] = true;
    s->along[s->count] = along;
    s->skin[s->count++] = node;
}

static void list_skin(kn_ahead *s, bool *listed)
{
    const kn_model *m = s->model;
    for (int i = 0; i < m->face_count; i++) {
        const kn_face *f = &m->face[i];
        for (int v = 0; v < f->len[1]; v++)
            for (int u = 0; u < f->len[0]; u++) add_node(s, listed, node_of(f, u, v), along_face(m, f, u, v));
    }
    for (int i = 0; i < m->skin_count; i++)
        for (int k = 0; k < 3; k++)
            add_node(s, listed, m->skin[i][k],
                     (tangents){{m->skin[i][0], m->skin[i][1], m->skin[i][0], m->skin[i][2]}, {false, false}});
}

// --- create ---------------------------------------------------------------------------------------------------------

// A convex tool has one nearest place, for which kn_clearance is enough.
static bool convex(const kn_shape *shape) { return shape->part_count == 1 && shape->part[0].kind != KN_SOLID_FIELD; }

kn_ahead *kn_ahead_create(const kn_model *model, const kn_patches *patches, int p, double reach_m)
{
    size_t nodes = (size_t)model->node_count;
    if (model->def.probe[p].shape == KN_PROBE_PLATE || convex(&model->shape[p])) return NULL;
    kn_ahead *s = calloc(1, sizeof *s);
    bool *listed = calloc(nodes, sizeof *listed);
    if (s && listed) {
        *s = (kn_ahead){.model = model, .patches = patches, .probe = p, .reach_m = reach_m};
        s->skin = malloc(nodes * sizeof *s->skin);
        s->along = malloc(nodes * sizeof *s->along);
        s->distance_m = malloc(nodes * sizeof *s->distance_m);
    }
    bool made = s && listed && s->skin && s->along && s->distance_m;
    if (made) {
        list_skin(s, listed);
        kn_ahead_reset(s);
    } else {
        kn_ahead_destroy(s);
    }
    free(listed);
    return made ? s : NULL;
}

void kn_ahead_destroy(kn_ahead *s)
{
    if (!s) return;
    free(s->skin);
    free(s->along);
    free(s->distance_m);
    free(s);
}

void kn_ahead_reset(kn_ahead *s)
{
    s->at = s->places = 0;
    for (int i = 0; i < s->model->node_count; i++) s->distance_m[i] = INFINITY;
}

// --- distances ------------------------------------------------------------------------------------------------------

// Compute the distance of a point from the tool at its present pose. `way`: direction out of the tool at the point.
static double distance_of(const kn_ahead *s, const kn_state *state, const double turn[3][3], const double x[3],
                          double way[3])
{
    double arm[3], own[3], out[3];
    for (int k = 0; k < 3; k++) arm[k] = x[k] - state->probe[s->probe].position_m[k];
    for (int k = 0; k < 3; k++) own[k] = turn[0][k] * arm[0] + turn[1][k] * arm[1] + turn[2][k] * arm[2];
    double distance = kn_shape_distance(&s->model->shape[s->probe], own, out);
    for (int k = 0; k < 3; k++) way[k] = kn_dot(turn[k], out);
    return distance;
}

// Compute the skin's point at node i of the skin, and its normal. Along each direction, the spline's point is 3/4 of
// the node plus 1/8 of each neighbour.
static void skin_at(const kn_ahead *s, const kn_state *state, int i, double x[3], double normal[3])
{
    const tangents *t = &s->along[i];
    double at[3], by[4][3], along[2][3];
    kn_state_position(s->model, state, s->skin[i], at);
    for (int n = 0; n < 4; n++) kn_state_position(s->model, state, t->node[n], by[n]);
    for (int k = 0; k < 3; k++) {
        x[k] = at[k];
        for (int n = 0; n < 2; n++) {
            along[n][k] = by[2 * n + 1][k] - by[2 * n][k];
            if (t->bends[n]) x[k] += 0.125 * (by[2 * n][k] + by[2 * n + 1][k] - 2 * at[k]);
        }
    }
    kn_cross(along[0], along[1], normal);
    double size = sqrt(kn_dot(normal, normal));
    for (int k = 0; k < 3; k++) normal[k] /= size > 0 ? size : 1;
}

// --- a sweep --------------------------------------------------------------------------------------------------------

// Return true if no tool presses a node or any of its neighbours.
static bool is_free(const kn_ahead *s, int node)
{
    int count;
    const int *near = kn_patches_near(s->patches, node, &count);
    bool free = kn_patches_at(s->patches, s->probe, node) < 0;
    for (int i = 0; i < count; i++) free &= kn_patches_at(s->patches, s->probe, near[i]) < 0;
    return free;
}

// Return whether a node is nearer to the tool than its neighbours. Among nodes at the same distance, the one with the
// lowest id counts as nearest.
static bool stands_out(const kn_ahead *s, int node)
{
    double own = s->distance_m[node];
    int count;
    const int *near = kn_patches_near(s->patches, node, &count);
    bool nearest = own < s->reach_m;
    for (int i = 0; i < count && nearest; i++) {
        double theirs = s->distance_m[near[i]];
        nearest = theirs > own || (theirs == own && near[i] >= node);
    }
    return nearest;
}

// Choose the nearest local minima as the places of this sweep.
static void choose(kn_ahead *s)
{
    s->places = 0;
    for (int i = 0; i < s->count; i++) {
        if (!stands_out(s, s->skin[i]) || !is_free(s, s->skin[i])) continue;
        double own = s->distance_m[s->skin[i]];
        // insert the place by its distance; if the list is full, drop the farthest place
        int at = s->places < KN_PATCHES_MAX ? s->places++ : KN_PATCHES_MAX;
        for (; at > 0 && s->distance_m[s->skin[s->place[at - 1]]] > own; at--)
            if (at < KN_PATCHES_MAX) s->place[at] = s->place[at - 1];
        if (at < KN_PATCHES_MAX) s->place[at] = i;
    }
}

void kn_ahead_look(kn_ahead *s, const kn_state *state)
{
    const kn_shape *shape = &s->model->shape[s->probe];
    double turn[3][3], x[3], way[3], normal[3], far = shape->bound_m + s->reach_m + s->model->def.spacing_m;
    const double *at = state->probe[s->probe].position_m;
    kn_tool_matrix(state->tool[s->probe].orientation_wxyz, turn);
    // compute the distance of an eighth of the skin's nodes in this tick
    for (int n = s->count / TICKS + 1; n > 0 && s->at < s->count; n--, s->at++) {
        int node = s->skin[s->at];
        double d = 0;
        kn_state_position(s->model, state, node, x);
        for (int k = 0; k < 3; k++) d += (x[k] - at[k]) * (x[k] - at[k]);
        s->distance_m[node] = INFINITY;
        if (d > far * far) continue;
        skin_at(s, state, s->at, x, normal);
        s->distance_m[node] = distance_of(s, state, (const double(*)[3])turn, x, way);
    }
    // the sweep is complete: choose places and begin the next one
    if (s->at < s->count) return;
    choose(s);
    s->at = 0;
}

// --- places ---------------------------------------------------------------------------------------------------------

// Find the point of the skin nearest to the tool, starting at node i of the skin.
static void place_at(const kn_ahead *s, const kn_state *state, const double turn[3][3], int i, kn_place *place)
{
    double x[3], normal[3], way[3], fine = s->model->shape[s->probe].fine_m;
    place->node = s->skin[i];
    skin_at(s, state, i, x, normal);
    double distance = distance_of(s, state, turn, x, way), out = kn_dot(way, normal);
    // move along the skin by (d + r) of the gradient's tangential part, at most one spacing: see ahead.h
    double far = fmax(0, distance) + fine, most = s->model->def.spacing_m, size = 0;
    for (int k = 0; k < 3; k++) way[k] -= out * normal[k], size += way[k] * way[k];
    far = fmin(far, size > 0 ? most / sqrt(size) : 0);
    for (int k = 0; k < 3; k++) x[k] -= far * way[k];
    place->gap_m = distance_of(s, state, turn, x, way);
    for (int k = 0; k < 3; k++) {
        place->normal[k] = -way[k];
        place->arm_m[k] = x[k] - place->gap_m * way[k] - state->probe[s->probe].position_m[k];
    }
}

int kn_ahead_places(const kn_ahead *s, const kn_state *state, int most, kn_place place[])
{
    double turn[3][3];
    int count = 0;
    kn_tool_matrix(state->tool[s->probe].orientation_wxyz, turn);
    // leave out a place that the tool has touched since the sweep
    for (int i = 0; i < s->places && count < most; i++) {
        if (!is_free(s, s->skin[s->place[i]])) continue;
        place_at(s, state, (const double(*)[3])turn, s->place[i], &place[count]);
        count += place[count].gap_m < s->reach_m;
    }
    return count;
}
