#include "core/local/patch.h"
#include "core/algebra/algebra.h"
#include "core/shape.h"
#include "core/solve/solver.h"
#include "core/solve/tool.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// --- patches --------------------------------------------------------------------------------------------------------

#define GROUPS_MAX 32 // largest number of groups per grouping; the nodes of further groups join the last group

typedef struct group { // a set of connected pressed nodes
    // force_n: force on the group's nodes; from_n[j]: part of it on nodes of old patch j
    double force_n, from_n[KN_PATCHES_MAX];
    int number;
} group;

struct kn_patches {
    const kn_model *model;
    int *first, *near;   // near[first[i] .. first[i + 1] - 1]: neighbours of node i
    double *force_n;     // force on each node in this grouping; 0: not pressed
    int *pressed, *line; // pressed: pressed nodes of this grouping; line: stack of nodes to visit
    int8_t *member;      // group of each node
    int8_t *number[KN_PROBES_MAX];
    // last[p]: nodes in the patches of probe p; last_count[p]: number of these nodes
    int *last[KN_PROBES_MAX], last_count[KN_PROBES_MAX];
    int count, probe, groups;
    group group[GROUPS_MAX];
};

// --- neighbours -----------------------------------------------------------------------------------------------------

// Add b to the neighbours of a. While `near` is NULL, only count the neighbours.
static void link(kn_patches *s, int a, int b)
{
    if (s->near) s->near[s->first[a]] = b;
    s->first[a]++;
}

// Link every node of a face with its up to eight neighbours.
static void link_faces(kn_patches *s)
{
    for (int f = 0; f < s->model->face_count; f++) {
        const kn_face *face = &s->model->face[f];
        for (int i = 0; i < 9 * face->len[0] * face->len[1]; i++) {
            int u = i / 9 % face->len[0], v = i / 9 / face->len[0], du = i % 3 - 1, dv = i / 3 % 3 - 1;
            if ((du == 0 && dv == 0) || u + du < 0 || u + du >= face->len[0] || v + dv < 0 || v + dv >= face->len[1])
                continue;
            int at = face->origin + u * face->step[0] + v * face->step[1];
            link(s, at, at + du * face->step[0] + dv * face->step[1]);
        }
    }
}

// Link all nodes of the skin with their neighbours: nodes of a block's faces, and corners of a net's triangles.
static void link_all(kn_patches *s)
{
    link_faces(s);
    for (int f = 0; f < s->model->skin_count; f++)
        for (int k = 0; k < 3; k++) {
            link(s, s->model->skin[f][k], s->model->skin[f][(k + 1) % 3]);
            link(s, s->model->skin[f][k], s->model->skin[f][(k + 2) % 3]);
        }
}

// List the neighbours of all nodes in one array. Count the neighbours of each node, sum the counts up, fill the array.
static bool list_neighbours(kn_patches *s)
{
    int nodes = s->model->node_count, sum = 0;
    link_all(s); // count
    for (int i = 0; i <= nodes; i++) {
        int own = i < nodes ? s->first[i] : 0;
        s->first[i] = sum;
        sum += own;
    }
    s->near = malloc((size_t)sum * sizeof *s->near + 1);
    if (!s->near || sum == 0) return false;
    link_all(s); // fill the array; afterwards first[i] is where the neighbours of node i + 1 begin
    // shift the entries of `first` by one, so that first[i] belongs to node i again
    for (int i = nodes; i > 0; i--) s->first[i] = s->first[i - 1];
    s->first[0] = 0;
    return true;
}

// --- create ---------------------------------------------------------------------------------------------------------

kn_patches *kn_patches_create(const kn_model *model)
{
    size_t nodes = (size_t)model->node_count;
    kn_patches *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    s->model = model;
    s->first = calloc(nodes + 1, sizeof *s->first);
    s->force_n = calloc(nodes, sizeof *s->force_n);
    s->pressed = calloc(nodes, sizeof *s->pressed);
    s->line = calloc(nodes, sizeof *s->line);
    s->member = calloc(nodes, sizeof *s->member);
    bool made = s->first && s->force_n && s->pressed && s->line && s->member;
    for (int p = 0; p < model->def.probe_count; p++) {
        s->number[p] = malloc(nodes + 1);
        s->last[p] = calloc(nodes, sizeof *s->last[p]);
        made &= s->number[p] && s->last[p];
        if (s->number[p]) memset(s->number[p], -1, nodes);
    }
    if (made && list_neighbours(s)) return s;
    kn_patches_destroy(s);
    return NULL;
}

void kn_patches_destroy(kn_patches *s)
{
    if (!s) return;
    free(s->first);
    free(s->near);
    free(s->force_n);
    free(s->pressed);
    free(s->line);
    free(s->member);
    for (int p = 0; p < KN_PROBES_MAX; p++) {
        free(s->number[p]);
        free(s->last[p]);
    }
    free(s);
}

void kn_patches_reset(kn_patches *s)
{
    for (int p = 0; p < s->model->def.probe_count; p++) {
        memset(s->number[p], -1, (size_t)s->model->node_count);
        s->last_count[p] = 0;
    }
}

// --- grouping the pressed nodes -------------------------------------------------------------------------------------

void kn_patches_begin(kn_patches *s, int p)
{
    s->probe = p;
    s->count = s->groups = 0;
}

void kn_patches_press(kn_patches *s, int node, double force_n)
{
    if (!(force_n > 0)) return;
    if (!(s->force_n[node] > 0)) {
        s->member[node] = -1;
        s->pressed[s->count++] = node;
    }
    s->force_n[node] += force_n;
}

// Add a node to a group. If the node belonged to an old patch j, also add its force to from_n[j].
static void join(kn_patches *s, int node, int g)
{
    int number = s->number[s->probe][node];
    s->member[node] = (int8_t)g;
    s->group[g].force_n += s->force_n[node];
    if (number >= 0) s->group[g].from_n[number] += s->force_n[node];
}

// Add a pressed node to a group, and all nodes that are connected with it by chains of pressed neighbours.
static void visit(kn_patches *s, int node, int g)
{
    int count = 1;
    s->line[0] = node;
    join(s, node, g);
    while (count > 0) {
        int at = s->line[--count];
        for (int i = s->first[at]; i < s->first[at + 1]; i++) {
            int next = s->near[i];
            if (!(s->force_n[next] > 0) || s->member[next] >= 0) continue;
            join(s, next, g);
            s->line[count++] = next;
        }
    }
}

// Return the number of the old patch whose nodes carry most of a group's force, among the numbers that are not in
// `taken`. Return -1 if there is none.
static int most_of(const group *g, unsigned taken)
{
    int most = -1;
    for (int j = 0; j < KN_PATCHES_MAX; j++)
        if (!(taken >> j & 1) && g->from_n[j] > (most < 0 ? 0 : g->from_n[most])) most = j;
    return most;
}

// Sort the groups by force, the strongest first. Use insertion sort, because qsort may allocate.
static void sort_by_force(const kn_patches *s, int order[GROUPS_MAX])
{
    for (int i = 0; i < s->groups; i++) {
        int at = i;
        for (; at > 0 && s->group[order[at - 1]].force_n < s->group[i].force_n; at--) order[at] = order[at - 1];
        order[at] = i;
    }
}

static int first_free(unsigned taken)
{
    int number = 0;
    while (taken >> number & 1) number++;
    return number;
}

// Give patch numbers to the groups, beginning with the strongest. A group gets the number of the old patch whose nodes
// carry most of the group's force. If there is no such patch, the group gets a free number. If there are more groups
// than numbers, the weakest groups share one number. Return the numbers in use as bits.
static unsigned give_numbers(kn_patches *s)
{
    int order[GROUPS_MAX], own = s->groups < KN_PATCHES_MAX ? s->groups : KN_PATCHES_MAX;
    unsigned taken = 0;
    sort_by_force(s, order);
    for (int i = 0; i < own; i++) {
        group *g = &s->group[order[i]];
        g->number = most_of(g, taken);
        if (g->number >= 0) taken |= 1u << g->number;
    }
    for (int i = 0; i < s->groups; i++) {
        group *g = &s->group[order[i]];
        if (i >= own) g->number = s->group[order[own - 1]].number;
        else if (g->number < 0) g->number = first_free(taken);
        taken |= 1u << g->number;
    }
    return taken;
}

// Compute share[i][j] of kn_patches_end: how much of the old patch j the new patch i has taken over.
static void share_out(const kn_patches *s, double share[KN_PATCHES_MAX][KN_PATCHES_MAX])
{
    double all_n[KN_PATCHES_MAX] = {0};
    memset(share, 0, KN_PATCHES_MAX * sizeof *share);
    for (int g = 0; g < s->groups; g++)
        for (int j = 0; j < KN_PATCHES_MAX; j++) {
            share[s->group[g].number][j] += s->group[g].from_n[j];
            all_n[j] += s->group[g].from_n[j];
        }
    for (int i = 0; i < KN_PATCHES_MAX; i++)
        for (int j = 0; j < KN_PATCHES_MAX; j++)
            if (all_n[j] > 0) share[i][j] /= all_n[j];
}

unsigned kn_patches_end(kn_patches *s, double share[KN_PATCHES_MAX][KN_PATCHES_MAX])
{
    int8_t *number = s->number[s->probe];
    // find the connected groups, number them, and store every node's number for the next grouping
    for (int i = 0; i < s->count; i++) {
        if (s->member[s->pressed[i]] >= 0) continue;
        bool room = s->groups < GROUPS_MAX;
        if (room) s->group[s->groups++] = (group){0};
        visit(s, s->pressed[i], s->groups - 1);
    }
    unsigned used = give_numbers(s);
    share_out(s, share);
    int *last = s->last[s->probe];
    // first clear the numbers of the last grouping
    for (int i = 0; i < s->last_count[s->probe]; i++) number[last[i]] = -1;
    for (int i = 0; i < s->count; i++) {
        int node = s->pressed[i];
        number[node] = (int8_t)s->group[s->member[node]].number;
        s->force_n[node] = 0;
        last[i] = node;
    }
    s->last_count[s->probe] = s->count;
    return used;
}

const int *kn_patches_near(const kn_patches *s, int node, int *count)
{
    *count = s->first[node + 1] - s->first[node];
    return &s->near[s->first[node]];
}

int kn_patches_at(const kn_patches *s, int p, int node) { return s->number[p][node]; }

// --- next places ----------------------------------------------------------------------------------------------------

#define TICKS 8 // number of ticks in which a sweep visits all nodes of the skin

// Four nodes that give the skin's tangents at one node: (x1 - x0) x (x3 - x2) points outwards, where xi is the position
// of node[i].
typedef struct tangents {
    int node[4];
    // bends[i]: from node[2 i] to node[2 i + 1] the skin is a spline, which does not pass through the node between them
    bool bends[2];
} tangents;

struct kn_ahead {
    const kn_model *model;
    const kn_patches *patches;
    // probe: index of the probe; count: number of nodes of the skin; at: next node that the sweep visits
    int probe, count, at;
    double reach_m;
    int *skin;
    tangents *along;    // [count] tangents at each node of the skin
    double *distance_m; // distance of every node from the tool; INFINITY: out of reach
    // place: places found by the last sweep, as indices in `skin`; places: number of these places
    int place[KN_PATCHES_MAX], places;
};

// --- the skin -------------------------------------------------------------------------------------------------------

static int inside(int i, int n) { return i < 0 ? 0 : i >= n ? n - 1 : i; }

static int node_of(const kn_face *f, int u, int v)
{
    return f->origin + inside(u, f->len[0]) * f->step[0] + inside(v, f->len[1]) * f->step[1];
}

// Return the tangents at a node of a face. Along a row, a spline skin passes through the two end nodes, but not through
// the nodes between them. So `bends` is true only at nodes between the ends.
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

// Return true if the shape is convex. A convex tool touches the skin at one nearest place, which kn_clearance finds.
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

// Return the distance of the point x from the tool at its present pose, m. `way`: gradient of the distance, a unit
// vector out of the tool.
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

// Compute the point of the skin that belongs to node i of the skin, and the outward normal there. Along each direction
// in which the skin is a spline, this point is 3/4 of the node's position plus 1/8 of each neighbour's.
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

// Return true if the tool presses neither a node nor any of its neighbours.
static bool is_free(const kn_ahead *s, int node)
{
    int count;
    const int *near = kn_patches_near(s->patches, node, &count);
    bool free = kn_patches_at(s->patches, s->probe, node) < 0;
    for (int i = 0; i < count; i++) free &= kn_patches_at(s->patches, s->probe, near[i]) < 0;
    return free;
}

// Return whether a node is nearer to the tool than all of its neighbours. Of two nodes at equal distance, the node with
// the lower id counts as nearer.
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

// Choose the places of this sweep: the local minima of the distance, the nearest first.
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

// Find the point of the skin nearest to the tool. The search starts at node i of the skin.
static void place_at(const kn_ahead *s, const kn_state *state, const double turn[3][3], int i, kn_place *place)
{
    double x[3], normal[3], way[3], fine = s->model->shape[s->probe].fine_m;
    place->node = s->skin[i];
    skin_at(s, state, i, x, normal);
    double distance = distance_of(s, state, turn, x, way), out = kn_dot(way, normal);
    // move along the skin by (d + r) times the tangential part of the gradient, at most one spacing: see patch.h
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

// --- impedance ------------------------------------------------------------------------------------------------------

#define SLOWER 30 // factor S by which the impedance reduces the inertia, see patch.h
#define COLD 60   // number of iterations of a probe's first solve
#define WARM 12   // number of iterations of every later solve, which starts from the last solution
// a solve ends when its residual relative to the load is below ENOUGH; the relative error of Y is the square of ENOUGH
#define ENOUGH 1e-4

struct kn_mobility {
    const kn_model *model;
    // state of the undeformed object, whose field `change` holds the pattern of forces; scratch for the matrix and the
    // solver's vectors
    kn_state *rest;
    kn_scratch *scratch;
    void *field[KN_PROBES_MAX]; // solution z of the last solve for each probe
    bool warm[KN_PROBES_MAX];
    int probe, left;
    double rz, beta, enough;
};

// Multiply the first `reals` numbers of a field by a factor.
static void scale(const kn_model *m, void *field, size_t reals, double by)
{
    for (size_t i = 0; field && i < reals; i++) kn_real_set(m, field, i, by * kn_real_get(m, field, i));
}

// Hold the nodes that lie on the table in the undeformed object. Other nodes may come to lie on the table later, but
// they stay free here.
static void hold_table(kn_mobility *m)
{
    const kn_model *model = m->model;
    for (int i = 0; i < model->base_count; i++) {
        if (model->rest_m[model->base[i]][2] > 0.1 * model->def.spacing_m) continue;
        size_t o = model->offset[model->base[i]];
        m->scratch->work.row_held[o / (3 * model->stride)] = 1;
        for (size_t k = 0; k < 3; k++) kn_real_set(model, m->scratch->work.free, o + k * model->stride, 0);
    }
}

// Assemble the matrix of an implicit step of the undeformed object, with S times the stiffness of all edges. The result
// is S times the matrix of patch.h, in which the inertia is divided by S.
static void assemble(kn_mobility *m)
{
    const kn_model *model = m->model;
    kn_work *w = &m->scratch->work;
    hold_table(m);
    memset(w->guess, 0, kn_state_field(model, 3));
    memset(w->r, 0, kn_state_field(model, 3));
    memset(w->p, 0, kn_state_field(model, 6));
    model->kernels->edge(model, m->rest, &m->scratch->work, KN_LINEARIZATION_TANGENT, false);
    // Multiply the stiffness by S. Divide it by the law's slope at rest, which is below 1 because the dampers flow. For
    // a block in f64, w->g holds one real per edge, which is proportional to the stiffness. Otherwise it holds a vector
    // per edge, whose length is the root of the stiffness.
    const double softer = SLOWER / model->law.slope_rest;
    scale(model, w->g, model->product_reals, kn_work_lean(model) ? softer : sqrt(softer));
    memset(m->rest->change, 0, kn_state_field(model, 3));
}

kn_mobility *kn_mobility_create(const kn_model *model)
{
    if (model->def.solver.kind != KN_SOLVER_IMPLICIT) return NULL;
    kn_mobility *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    m->model = model;
    m->rest = kn_state_create(model);
    m->scratch = kn_scratch_create(model);
    bool made = m->rest && m->scratch;
    for (int p = 0; p < model->def.probe_count; p++)
        made &= (m->field[p] = calloc(1, kn_state_field(model, 3))) != NULL;
    if (made) {
        assemble(m);
        return m;
    }
    kn_mobility_destroy(m);
    return NULL;
}

void kn_mobility_destroy(kn_mobility *m)
{
    if (!m) return;
    kn_state_destroy(m->rest);
    kn_scratch_destroy(m->scratch);
    for (int p = 0; p < KN_PROBES_MAX; p++) free(m->field[p]);
    free(m);
}

void kn_mobility_begin(kn_mobility *m, int p)
{
    m->probe = p;
    memset(m->rest->change, 0, kn_state_field(m->model, 3));
}

// Add a force to the pattern of forces. Held components get no load, because they do not move.
void kn_mobility_load(kn_mobility *m, size_t offset, const double force_n[3])
{
    for (size_t k = 0; k < 3; k++)
        if (kn_real_get(m->model, m->scratch->work.free, offset + k * m->model->stride) != 0)
            kn_real_add(m->model, m->rest->change, offset + k * m->model->stride, force_n[k]);
}

static double product(const kn_model *m, const void *a, const void *b)
{
    double sum = 0;
    for (size_t i = 0, n = kn_model_field(m, 3); i < n; i++) sum += kn_real_get(m, a, i) * kn_real_get(m, b, i);
    return sum;
}

// Start a solve from the solution z of the last solve for this probe: r = b - A z, which costs one matrix product. The
// residual r is then only the change of the pattern since the last solve.
void kn_mobility_start(kn_mobility *m)
{
    const kn_model *model = m->model;
    kn_work *w = &m->scratch->work;
    // first compute P b, the preconditioned load; b.P b sets the threshold at which the solve ends
    memcpy(w->r, m->rest->change, kn_state_field(model, 3));
    memset(w->guess, 0, kn_state_field(model, 3));
    memset(w->d, 0, kn_state_field(model, 3));
    memset(w->q, 0, kn_state_field(model, 3));
    m->enough = ENOUGH * ENOUGH * fabs(model->kernels->update(model, &m->scratch->work, 0)); // z = P b
    // then subtract the matrix product with the last solution, which becomes the first guess
    memcpy(w->z, m->field[m->probe], kn_state_field(model, 3));
    model->kernels->apply(model, m->rest, &m->scratch->work, 0);
    m->rz = model->kernels->update(model, &m->scratch->work, 1);
    m->beta = 0;
    m->left = m->warm[m->probe] ? WARM : COLD;
}

// End a solve: compute Y = b'z. If Y is not finite and positive, drop the solution, so that the next solve starts from
// zero.
static bool finish(kn_mobility *m, double *a_n_s_per_m)
{
    kn_work *w = &m->scratch->work;
    double y = SLOWER * product(m->model, m->rest->change, w->guess);
    bool good = isfinite(y) && y > 0;
    if (good) memcpy(m->field[m->probe], w->guess, kn_state_field(m->model, 3));
    else memset(m->field[m->probe], 0, kn_state_field(m->model, 3));
    m->warm[m->probe] = good;
    *a_n_s_per_m = good ? 1 / y : 0;
    return true;
}

bool kn_mobility_iterate(kn_mobility *m, double *a_n_s_per_m)
{
    // one iteration of conjugate gradients with the step's own kernels
    if (m->left-- <= 0 || !(m->rz > m->enough)) return finish(m, a_n_s_per_m);
    double dq = m->model->kernels->apply(m->model, m->rest, &m->scratch->work, m->beta);
    if (!(dq > 0)) return finish(m, a_n_s_per_m);
    double next = m->model->kernels->update(m->model, &m->scratch->work, m->rz / dq);
    m->beta = next / m->rz;
    m->rz = next;
    return false;
}

double kn_mobility_rate(const kn_mobility *m, int p, size_t offset, const double force_n[3])
{
    double rate = 0;
    for (size_t k = 0; k < 3; k++)
        rate += force_n[k] * kn_real_get(m->model, m->field[p], offset + k * m->model->stride);
    return SLOWER * rate;
}
