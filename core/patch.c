#include "core/patch.h"

#include <stdlib.h>
#include <string.h>

#define GROUPS_MAX 32 // largest number of groups per grouping; the nodes of further groups join the last group

typedef struct group {                      // a set of connected pressed nodes
    double force_n, from_n[KN_PATCHES_MAX]; // from_n[j]: part of the force on nodes of old patch j
    int number;
} group;

struct kn_patches {
    const kn_model *model;
    int *first, *near;   // neighbours of node i: near[first[i] .. first[i + 1] - 1]
    double *force_n;     // force on each node in this round; 0: not pressed
    int *pressed, *line; // pressed nodes of this grouping; stack of nodes to visit
    int8_t *member;      // group of each node
    int8_t *number[KN_PROBES_MAX];
    int *last[KN_PROBES_MAX], last_count[KN_PROBES_MAX]; // nodes of each probe that belong to a patch; their number
    int count, probe, groups;
    group group[GROUPS_MAX];
};

// --- neighbours -----------------------------------------------------------------------------------------------------

// Add b to the neighbours of a, or only count it while near is NULL.
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

// Link all nodes of the skin: faces, and corners of a net's triangles.
static void link_all(kn_patches *s)
{
    link_faces(s);
    for (int f = 0; f < s->model->skin_count; f++)
        for (int k = 0; k < 3; k++) {
            link(s, s->model->skin[f][k], s->model->skin[f][(k + 1) % 3]);
            link(s, s->model->skin[f][k], s->model->skin[f][(k + 2) % 3]);
        }
}

// List the neighbours of all nodes in one array: count, sum up, fill.
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
    link_all(s); // fill; moves every `first` to the next node's
    // move the entries of `first` back
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

// --- a round --------------------------------------------------------------------------------------------------------

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

// Add a node to a group. from_n records how much of the group's force is on nodes of each old patch.
static void join(kn_patches *s, int node, int g)
{
    int number = s->number[s->probe][node];
    s->member[node] = (int8_t)g;
    s->group[g].force_n += s->force_n[node];
    if (number >= 0) s->group[g].from_n[number] += s->force_n[node];
}

// Collect all nodes connected with a node over pressed neighbours.
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

// Return the old number, not yet taken, whose nodes carry most of a group's force; -1: none.
static int most_of(const group *g, unsigned taken)
{
    int most = -1;
    for (int j = 0; j < KN_PATCHES_MAX; j++)
        if (!(taken >> j & 1) && g->from_n[j] > (most < 0 ? 0 : g->from_n[most])) most = j;
    return most;
}

// Sort the groups by force. Insertion sort, since qsort may allocate.
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

// Give numbers to the groups, the strongest first. A group keeps the old number whose nodes carry most of its force,
// else it gets a free number. If there are more groups than numbers, the weakest groups share the last number.
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

// Compute how much of every old number's force each new number has taken over.
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
    // find the connected groups, number them, and store every node's number for the next round
    for (int i = 0; i < s->count; i++) {
        if (s->member[s->pressed[i]] >= 0) continue;
        bool room = s->groups < GROUPS_MAX;
        if (room) s->group[s->groups++] = (group){0};
        visit(s, s->pressed[i], s->groups - 1);
    }
    unsigned used = give_numbers(s);
    share_out(s, share);
    int *last = s->last[s->probe];
    // first clear the numbers of the last round
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
