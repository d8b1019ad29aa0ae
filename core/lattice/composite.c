#include "core/lattice/lattice.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// --- parts -----------------------------------------------------------------------------------------------------------

static int clamp(int i, int low, int high) { return i < low ? low : i > high ? high : i; }

bool kn_composite_box(const kn_model_def *def, const double low_m[3], const double high_m[3], double margin_m,
                      int fine[2][3])
{
    bool whole = true;
    // round the box outwards to even cells; the box always reaches the top of the block
    for (int k = 0; k < 3; k++) {
        int cells = def->nodes[k] - 1;
        double origin = k == 2 ? 0 : -0.5 * cells * def->spacing_m, pair = 2 * def->spacing_m;
        double low = floor((low_m[k] - margin_m - origin) / pair + 1e-6),
               high = ceil((high_m[k] + margin_m - origin) / pair - 1e-6);
        fine[0][k] = 2 * clamp((int)fmax(fmin(low, cells), 0), 0, cells / 2);
        fine[1][k] = k == 2 ? cells : 2 * clamp((int)fmax(fmin(high, cells), 0), 0, cells / 2);
        whole = whole && fine[0][k] == 0 && fine[1][k] == cells;
    }
    return !whole;
}

bool kn_composite_is(const kn_model_def *def)
{
    for (int k = 0; k < 3; k++)
        if (def->fine[0][k] != 0 || def->fine[1][k] != 0) return true;
    return false;
}

const char *kn_composite_unfit(const kn_model_def *def)
{
    if (def->mesh || def->thickness_m > 0 || def->structure != KN_STRUCTURE_DIAGONALS)
        return "a fine box needs a solid block with diagonals";
    if (def->pressure != KN_PRESSURE_NONE) return "a fine box needs pressure: none";
    return def->solver.kind == KN_SOLVER_IMPLICIT ? NULL : "a fine box needs the implicit solver";
}

const char *kn_composite_check(const kn_model_def *def)
{
    const char *unfit = kn_composite_unfit(def);
    bool whole = true;
    if (!kn_composite_is(def)) return NULL;
    if (unfit) return unfit;
    for (int k = 0; k < 3; k++) {
        int cells = def->nodes[k] - 1, low = def->fine[0][k], high = def->fine[1][k];
        if (cells % 2 != 0) return "a fine box needs an even number of cells along every axis";
        if (low < 0 || high > cells || low >= high || low % 2 != 0 || high % 2 != 0)
            return "a fine box needs corners at even cells of the block, the first below the second";
        whole = whole && low == 0 && high == cells;
    }
    return whole ? "a fine box needs coarse cells around it" : NULL;
}

// Cut the block into parts. First cut off the parts below and above the fine box, then the parts beside the fine box
// along x and y. The fine box itself is the last part. `part`: two corners of each part, in fine cells. Return the
// number of parts.
static int cut(const kn_model_def *def, int part[KN_COMPOSITE_PARTS][2][3])
{
    static const int order[3] = {2, 0, 1};
    int left[2][3] = {{0}}, count = 0;
    for (int k = 0; k < 3; k++) left[1][k] = def->nodes[k] - 1;
    for (int i = 0; i < 3; i++)
        // cut off one part on each side of the box along axis k; along the other axes, the part is as wide as what is
        // left of the block
        for (int side = 0, k = order[i]; side < 2; side++) {
            if (left[side][k] == def->fine[side][k]) continue;
            memcpy(part[count], left, sizeof left);
            part[count++][!side][k] = def->fine[side][k];
            left[side][k] = def->fine[side][k];
        }
    memcpy(part[count++], left, sizeof left);
    return count;
}

int kn_composite_nodes(const kn_model_def *def)
{
    int part[KN_COMPOSITE_PARTS][2][3], parts = cut(def, part), sum = 0;
    for (int p = 0; p < parts; p++) {
        int nodes = 1, coarse = p + 1 < parts ? 2 : 1;
        for (int k = 0; k < 3; k++) nodes *= (part[p][1][k] - part[p][0][k]) / coarse + 1;
        sum += nodes;
    }
    return sum;
}

// Return the axis for the rows: the longest axis whose nodes fit into `vectors` vectors. The longest axis gives the
// fewest rows. Return -1 if no axis fits.
static int widest(const kn_grid *g, int vectors)
{
    int best = -1;
    for (int a = 0; a < 3; a++)
        if (g->n[a] <= vectors * KN_LANES && (best < 0 || g->n[a] > g->n[best])) best = a;
    return best;
}

// Choose the number of vectors per row with which all parts together take the fewest lanes, padding included. All parts
// get this number, because a field consists of rows of equal length.
static int choose_vectors(const kn_composite *c, int most)
{
    int best = 0;
    for (int vectors = 1, least = 0; vectors <= most; vectors++) {
        int sum = 0;
        bool fits = true;
        for (int p = 0; p < c->part_count && fits; p++) {
            const kn_grid *g = &c->part[p].grid;
            int axis = widest(g, vectors);
            fits = axis >= 0;
            if (fits) sum += g->nodes / g->n[axis] * vectors;
        }
        if (fits && (best == 0 || sum < least)) best = vectors, least = sum;
    }
    return best;
}

// Make every part a regular block with its own grid, law and tables.
static bool make_parts(kn_model *m, kn_composite *c)
{
    int box[KN_COMPOSITE_PARTS][2][3], most = 1;
    c->part_count = cut(&m->def, box);
    c->part = calloc((size_t)c->part_count, sizeof *c->part);
    if (!c->part) return false;
    for (int p = 0; p < c->part_count; p++) {
        kn_model *part = &c->part[p];
        int coarse = c->coarse[p] = p + 1 < c->part_count ? 2 : 1;
        part->def = m->def;
        part->def.probe_count = 0;
        part->def.spacing_m *= coarse;
        memset(part->def.fine, 0, sizeof part->def.fine);
        memcpy(c->corner[p], box[p][0], sizeof c->corner[p]);
        for (int k = 0; k < 3; k++) part->def.nodes[k] = (box[p][1][k] - box[p][0][k]) / coarse + 1;
        kn_grid_init(&part->grid, part->def.nodes, part->def.spacing_m, 0, m->def.diagonal_stiffness);
        part->grid.kappa_m *= m->def.force_factor;
        part->law = m->law;
        part->gamma = m->gamma;
        part->size_m = m->size_m;
        part->isa = m->isa;
        most = part->grid.vectors > most ? part->grid.vectors : most;
    }
    // lay out the rows of all parts one after the other, all of one length
    int vectors = choose_vectors(c, most);
    for (int p = 0; p < c->part_count; p++) {
        kn_grid *g = &c->part[p].grid;
        kn_grid_lay(g, widest(g, vectors), vectors);
        c->node_first[p + 1] = c->node_first[p] + g->nodes;
        c->row_first[p + 1] = c->row_first[p] + g->rows;
        if (m->coarse) {
            c->part[p].coarse = &c->part_coarse[p];
            c->part_coarse[p] = *m->coarse;
            for (int k = 0; k < 3; k++) c->part_coarse[p].first_m[k] -= c->corner[p][k] * m->def.spacing_m;
        }
        void *tables = kn_tables_create(&c->part[p], c->inside);
        if (!tables) return false;
        c->part[p].tables = tables;
    }
    return true;
}

// --- places, in fine cells -------------------------------------------------------------------------------------------

// Compute the place of a part's node in the whole block, in fine cells.
static void place_of(const kn_composite *c, int part, int node, int at[3])
{
    kn_grid_coords(&c->part[part].grid, node, at);
    for (int k = 0; k < 3; k++) at[k] = c->corner[part][k] + c->coarse[part] * at[k];
}

// Return the entry of kn_composite.place for a place on the coarse lattice, whose three coordinates are even.
static int *even_place(const kn_model *m, const int at[3])
{
    const int *n = m->def.nodes;
    return &m->composite->place[(at[2] / 2 * (n[1] / 2 + 1) + at[1] / 2) * (n[0] / 2 + 1) + at[0] / 2];
}

// Return whether a place is inside the box, and not on a face that the box shares with coarse cells.
static bool is_inside(const kn_model *m, const int at[3])
{
    for (int k = 0; k < 3; k++) {
        if (at[k] < m->def.fine[0][k] || at[k] > m->def.fine[1][k]) return false;
        if (at[k] == m->def.fine[0][k] && at[k] > 0) return false;
        if (at[k] == m->def.fine[1][k] && at[k] < m->def.nodes[k] - 1) return false;
    }
    return true;
}

// List the coarse nodes around a place that is not inside the box: 1, 2, 4 or, in the middle of a coarse cell, 8.
static int nodes_around(const kn_model *m, const int at[3], int node[8])
{
    int count = 0;
    for (int i = 0; i < 8; i++) {
        int corner[3];
        bool other = false; // this corner i repeats an earlier one
        for (int k = 0; k < 3; k++) {
            other = other || (at[k] % 2 == 0 && i >> k & 1);
            corner[k] = at[k] + (at[k] % 2 == 0 ? 0 : i >> k & 1 ? 1 : -1);
        }
        if (!other) node[count++] = *even_place(m, corner);
    }
    return count;
}

// --- ties ------------------------------------------------------------------------------------------------------------

// Tie a node to its masters, and move the node's share of the load on the top to the masters.
static void tie_node(kn_model *m, int node, const int *master, int count)
{
    kn_composite *c = m->composite;
    kn_tie *tie = &c->tie[c->ties];
    *tie = (kn_tie){.node = (unsigned)m->offset[node], .count = count};
    for (int i = 0; i < count; i++) {
        tie->master[i] = (unsigned)m->offset[master[i]];
        c->pull[c->pulls++] = (kn_pull){tie->master[i], tie->node, 1.0F / (float)count};
        m->top_share[master[i]] += m->top_share[node] / count;
    }
    c->ties++;
    m->support[node] = 7; // the solver treats a tied node as held, because the node follows its masters
    m->top_share[node] = 0;
}

static int by_master(const void *a, const void *b)
{
    const kn_pull *p = a, *q = b;
    return p->master != q->master ? (p->master > q->master) - (p->master < q->master)
                                  : (p->node > q->node) - (p->node < q->node);
}

// Tie all nodes that share a place with an earlier node or lie on the box's faces. During this function,
// m->top_share is indexed by node.
static void tie_all(kn_model *m)
{
    kn_composite *c = m->composite;
    for (int p = 0; p < c->part_count; p++)
        for (int i = 0; i < c->part[p].grid.nodes; i++) {
            int at[3], node = c->node_first[p] + i, master[8];
            place_of(c, p, i, at);
            bool coarse = c->coarse[p] == 2;
            // the first coarse node at a place stays free, and later coarse nodes there follow it; fine nodes on a
            // shared face follow the coarse nodes around them
            if (coarse && *even_place(m, at) < 0) *even_place(m, at) = node;
            else if (coarse) tie_node(m, node, even_place(m, at), 1);
            else if (!is_inside(m, at)) tie_node(m, node, master, nodes_around(m, at, master));
        }
    qsort(c->pull, (size_t)c->pulls, sizeof *c->pull, by_master);
    for (int p = 0, i = 0; p < c->part_count; p++) {
        const size_t end = (size_t)c->row_first[p + 1] * 3 * m->stride;
        while (i < c->pulls && c->pull[i].master < end) i++;
        c->pull_first[p + 1] = i;
    }
}

int kn_composite_master(const kn_model *m, int node)
{
    const kn_composite *c = m->composite;
    int p = 0, at[3];
    while (node >= c->node_first[p + 1]) p++;
    place_of(c, p, node - c->node_first[p], at);
    bool even = at[0] % 2 == 0 && at[1] % 2 == 0 && at[2] % 2 == 0;
    return even && !is_inside(m, at) ? *even_place(m, at) : node;
}

size_t kn_composite_bytes(const kn_model *model)
{
    const kn_composite *c = model->composite;
    size_t bytes = sizeof *c, places = 1;
    if (!c) return 0;
    for (int k = 0; k < 3; k++) places *= (size_t)model->def.nodes[k] / 2 + 1;
    for (int p = 0; p < c->part_count; p++) bytes += sizeof c->part[p] + c->inside->tables_size(&c->part[p]);
    return bytes + places * sizeof *c->place + (size_t)model->node_count * (sizeof *c->tie + 4 * sizeof *c->pull);
}

int kn_composite_edges(const kn_model *model)
{
    int count = 0;
    for (int p = 0; p < model->composite->part_count; p++)
        count += kn_grid_edges(&model->composite->part[p].grid, NULL);
    return count;
}

int kn_composite_tied(const kn_model *model) { return model->composite ? model->composite->ties : 0; }

// --- faces -----------------------------------------------------------------------------------------------------------

// Add the faces of all parts on side s of the block: 0 top, 1 +x, 2 -x, 3 +y, 4 -y, 5 base. u x v points outwards.
static void add_faces(kn_model *m, int s)
{
    static const int axis[6] = {2, 0, 0, 1, 1, 2}, along[6][2] = {{0, 1}, {1, 2}, {2, 1}, {2, 0}, {0, 2}, {1, 0}};
    kn_composite *c = m->composite;
    for (int p = c->part_count - 1; p >= 0; p--) { // the fine box is the last part: take it first
        const int *n = c->part[p].grid.n, step[3] = {1, n[0], n[0] * n[1]}, k = axis[s];
        bool far = s == 0 || s == 1 || s == 3;
        int at = c->corner[p][k] + (far ? c->coarse[p] * (n[k] - 1) : 0);
        // skip a part that does not reach this side of the block
        if (at != (far ? m->def.nodes[k] - 1 : 0)) continue;
        m->face[m->outside_count++] = (kn_face){
            .origin = c->node_first[p] + (far ? (n[k] - 1) * step[k] : 0),
            .step = {step[along[s][0]], step[along[s][1]]},
            .len = {n[along[s][0]], n[along[s][1]]},
            .spacing_m = c->part[p].grid.spacing_m,
        };
    }
}

// List the faces, the base last. A probe can touch the base only if the object is free or lies on the table.
static void build_faces(kn_model *m)
{
    for (int s = 0; s < 5; s++) add_faces(m, s);
    m->face_count = m->outside_count;
    add_faces(m, 5);
    if (m->def.support >= KN_SUPPORT_NONE) m->face_count = m->outside_count;
}

// --- kernels: those of the parts, and the exchange between tied nodes and their masters -----------------------------

// Return the offset in a field of n components of what is at offset3 in a field of 3.
static inline size_t offset_of(size_t offset3, size_t n, size_t stride)
{
    return offset3 + (n == 3 ? 0 : offset3 / (3 * stride) * 3 * stride);
}

// Exchange between tied nodes and their masters. This macro holds the source for both precisions.
//
// spread: set a field at each tied node to the mean of its masters' values.
// gather: add the forces on tied nodes to their masters in equal shares.
// gather_blocks: add share^2 times the diagonal block of each tied node to the blocks of its masters. The blocks
// between two neighbours that are tied to one master are left out. The sum is therefore up to an eighth too stiff,
// which is good enough for a preconditioner.
// clear: clear the forces on tied nodes.
#define TIES(real)                                                                                                     \
    static void spread_##real(const kn_composite *c, size_t stride, real *v)                                           \
    {                                                                                                                  \
        for (const kn_tie *t = c->tie; t < c->tie + c->ties; t++)                                                      \
            for (size_t i = 0, k = 0; i < 3; i++, k += stride) {                                                       \
                const real *a = v + k + t->master[0], *b = v + k + t->master[1], *d = v + k + t->master[2],            \
                           *e = v + k + t->master[3];                                                                  \
                v[t->node + k] = t->count == 1   ? *a                                                                  \
                                 : t->count == 2 ? (real)0.5 * (*a + *b)                                               \
                                                 : (real)0.25 * (*a + *b + *d + *e);                                   \
            }                                                                                                          \
    }                                                                                                                  \
    static inline void pull_##real(const kn_pull *p, const kn_pull *end, size_t n, size_t stride, const real *from,    \
                                   real *field)                                                                        \
    {                                                                                                                  \
        while (p < end) {                                                                                              \
            const unsigned master = p->master;                                                                         \
            real *to = field + offset_of(master, n, stride), sum[6];                                                   \
            for (size_t k = 0; k < n; k++) sum[k] = to[k * stride];                                                    \
            for (; p < end && p->master == master; p++) {                                                              \
                const real *at = from + offset_of(p->node, n, stride),                                                 \
                           share = (real)(n == 3 ? p->share : p->share * p->share);                                    \
                for (size_t k = 0; k < n; k++) sum[k] += share * at[k * stride];                                       \
            }                                                                                                          \
            for (size_t k = 0; k < n; k++) to[k * stride] = sum[k];                                                    \
        }                                                                                                              \
    }                                                                                                                  \
    static void gather_##real(const kn_composite *c, size_t stride, void *field, int first, int end)                   \
    {                                                                                                                  \
        pull_##real(c->pull + c->pull_first[first], c->pull + c->pull_first[end], 3, stride, field, field);            \
    }                                                                                                                  \
    static void gather_blocks_##real(const kn_composite *c, size_t stride, const void *from, void *to, int part)       \
    {                                                                                                                  \
        pull_##real(c->pull + c->pull_first[part], c->pull + c->pull_first[part + 1], 6, stride, from, to);            \
    }                                                                                                                  \
    static void clear_##real(const kn_composite *c, size_t stride, real *v)                                            \
    {                                                                                                                  \
        for (const kn_tie *t = c->tie; t < c->tie + c->ties; t++)                                                      \
            for (size_t k = 0; k < 3; k++) v[t->node + k * stride] = 0;                                                \
    }
TIES(float)
TIES(double)

// Set a field at all tied nodes to the mean of their masters' values, in the model's precision.
static void spread(const kn_model *m, void *field)
{
    if (kn_model_single(m)) spread_float(m->composite, m->stride, field);
    else spread_double(m->composite, m->stride, field);
}

// Add the forces on tied nodes to those of their masters that are in the parts first..end-1.
static void gather(const kn_model *m, void *field, int first, int end)
{
    if (kn_model_single(m)) gather_float(m->composite, m->stride, field, first, end);
    else gather_double(m->composite, m->stride, field, first, end);
}

static void clear(const kn_model *m, void *field)
{
    if (kn_model_single(m)) clear_float(m->composite, m->stride, field);
    else clear_double(m->composite, m->stride, field);
}

// Move the forces on all tied nodes to their masters.
static void gather_all(const kn_model *m, void *field)
{
    gather(m, field, 0, m->composite->part_count);
    clear(m, field);
}

static void gather_blocks(const kn_model *m, const kn_work *w, int part)
{
    if (kn_model_single(m)) gather_blocks_float(m->composite, m->stride, w->whole, w->p, part);
    else gather_blocks_double(m->composite, m->stride, w->whole, w->p, part);
}

// Return the address of a part's first row in a field.
static void *rows_from(const kn_model *m, void *field, int components, int row)
{
    size_t reals = (size_t)row * (size_t)components * m->stride;
    return field ? (char *)field + reals * kn_model_real(m) : NULL;
}

// Return a state whose fields lead to the rows of one part.
static kn_state state_of(const kn_model *m, const kn_state *state, int part)
{
    const int row = m->composite->row_first[part];
    kn_state view;
#define KN_FIELD(name, components) view.name = rows_from(m, state->name, components, row);
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    return view;
}

// Return solver vectors that lead to the rows of one part.
static kn_work work_of(const kn_model *m, const kn_work *w, int part)
{
    const int row = m->composite->row_first[part];
    return (kn_work){
        .guess = rows_from(m, w->guess, 3, row),
        .r = rows_from(m, w->r, 3, row),
        .q = rows_from(m, w->q, 3, row),
        .d = rows_from(m, w->d, 3, row),
        .z = rows_from(m, w->z, 3, row),
        .p = rows_from(m, w->p, 6, row),
        .whole = rows_from(m, w->whole, 6, row),
        .g = rows_from(m, w->g, kn_work_edge(m) * KN_FORWARD, row),
        .free = rows_from(m, w->free, 3, row),
        .coarse = w->coarse,
        .team = w->team ? kn_work_team(&m->composite->part[part], w->team, w->team->least / 2) : NULL,
        .sums = w->sums,
        .cut = w->cut,
        .row_held = w->row_held + row,
        .row_moved = w->row_moved + row,
    };
}

static void begin(const kn_model *m, const kn_state *state, const kn_work *w, bool again)
{
    for (int p = 0; p < m->composite->part_count; p++) {
        const kn_state part = state_of(m, state, p);
        const kn_work work = work_of(m, w, p);
        m->composite->inside->begin(&m->composite->part[p], &part, &work, again);
    }
}

// Set the guessed velocity of every tied node to the mean of its masters' velocities. If the row of a master is marked
// as moved (its prescribed velocity has changed), mark the rows of its tied nodes, too.
static void follow(const kn_model *m, const kn_work *w)
{
    const unsigned row = 3 * (unsigned)m->stride;
    const kn_tie *tie = m->composite->tie, *end = tie + kn_composite_tied(m);
    int any = 0;
    for (int i = 0; i < m->row_count; i++) any |= w->row_moved[i];
    for (; any && tie < end; tie++)
        for (int i = 0; i < tie->count; i++) w->row_moved[tie->node / row] |= w->row_moved[tie->master[i] / row];
    spread(m, w->guess);
}

// Run the edge pass part by part, from the last part to the first. The tied nodes of a master are in later parts. Their
// sums are added to it before its row is finished.
static double edge(const kn_model *m, kn_state *state, const kn_work *w, kn_linearization how, bool again)
{
    const kn_composite *c = m->composite;
    double rz = 0;
    follow(m, w);
    for (int p = c->part_count - 1; p >= 0; p--) {
        kn_state part = state_of(m, state, p);
        const kn_work work = work_of(m, w, p);
        gather(m, w->r, p, p + 1);
        gather_blocks(m, w, p);
        rz += c->inside->edge(&c->part[p], &part, &work, how, again);
    }
    clear(m, w->r);
    return rz;
}

// Run the kernel `recall` of kernel.h part by part.
static double recall(const kn_model *m, const kn_state *state, const kn_work *w)
{
    const kn_composite *c = m->composite;
    double rz = 0;
    for (int p = 0; p < c->part_count; p++) {
        kn_state part = state_of(m, state, p);
        const kn_work work = work_of(m, w, p);
        rz += c->inside->recall(&c->part[p], &part, &work);
    }
    return rz;
}

static double apply(const kn_model *m, const kn_state *state, const kn_work *w, double beta)
{
    const kn_composite *c = m->composite;
    double dq = 0;
    // copy the search direction of the masters to their tied nodes; `update` adds the products q of tied nodes to their
    // masters
    spread(m, w->z);
    for (int p = 0; p < c->part_count; p++) {
        kn_state part = state_of(m, state, p);
        const kn_work work = work_of(m, w, p);
        dq += c->inside->apply(&c->part[p], &part, &work, beta);
    }
    return dq;
}

static double update(const kn_model *m, const kn_work *w, double alpha)
{
    const kn_composite *c = m->composite;
    double rz = 0;
    // add the products of tied nodes to their masters
    gather_all(m, w->q);
    if (alpha == 0) gather_all(m, w->r); // alpha 0: contact has changed the residual r at tied nodes, too
    for (int p = 0; p < c->part_count; p++) {
        const kn_work work = work_of(m, w, p);
        rz += c->inside->update(&c->part[p], &work, alpha);
    }
    return rz;
}

static void restriction(const kn_model *m, const kn_work *w)
{
    const kn_composite *c = m->composite;
    for (int p = 0; p < c->part_count; p++) {
        const kn_work work = work_of(m, w, p);
        c->inside->restriction(&c->part[p], &work);
    }
}

// Tied nodes are not free, so they get 0 here; `apply` copies their masters' values.
static void prolongation(const kn_model *m, const kn_work *w)
{
    const kn_composite *c = m->composite;
    for (int p = 0; p < c->part_count; p++) {
        const kn_work work = work_of(m, w, p);
        c->inside->prolongation(&c->part[p], &work);
    }
}

static void integrate(const kn_model *m, kn_state *state, const kn_work *w)
{
    const kn_composite *c = m->composite;
    for (int p = 0; p < c->part_count; p++) {
        kn_state part = state_of(m, state, p);
        const kn_work work = work_of(m, w, p);
        c->inside->integrate(&c->part[p], &part, &work);
    }
    // tied nodes have moved like their masters except for rounding: copy the masters' values again, so that rounding
    // does not accumulate
    spread(m, state->displacement);
    spread(m, state->velocity);
    spread(m, state->change);
}

// Set the kernels of the whole model. This is the last step of building a composite.
static void composite_kernels(kn_model *m)
{
    kn_composite *c = m->composite;
    c->kernels = (kn_kernels){.name = c->inside->name,
                              .begin = begin,
                              .edge = edge,
                              .recall = recall,
                              .apply = apply,
                              .update = update,
                              .restriction = restriction,
                              .coarse_solve = c->inside->coarse_solve,
                              .prolongation = prolongation,
                              .contact_rates = c->inside->contact_rates,
                              .contact_add = c->inside->contact_add,
                              .contact_product = c->inside->contact_product,
                              .integrate = integrate};
    m->kernels = &c->kernels;
}

// --- nodes -----------------------------------------------------------------------------------------------------------

// Fill in the nodes of all parts: offset, rest position, mass, support, and share of a load on the top.
static void place_nodes(kn_model *m)
{
    kn_composite *c = m->composite;
    const int *n = m->def.nodes;
    double h = m->def.spacing_m;
    for (int p = 0; p < c->part_count; p++) {
        const kn_grid *g = &c->part[p].grid;
        double whole = m->def.density_kg_m3 * g->spacing_m * g->spacing_m * g->spacing_m;
        for (int i = 0; i < g->nodes; i++) {
            int at[3], node = c->node_first[p] + i;
            place_of(c, p, i, at);
            m->offset[node] = (size_t)c->row_first[p] * 3 * m->stride + kn_grid_offset(g, i);
            for (int k = 0; k < 3; k++) m->rest_m[node][k] = (at[k] - (k < 2 ? 0.5 * (n[k] - 1) : 0)) * h;
            m->node_mass_kg[node] = whole * kn_grid_share(g, i);
            if (at[2] == 0) m->support[node] = kn_support_mask(m->def.support);
            if (at[2] == n[2] - 1) m->top_share[node] = kn_grid_share(g, i) * c->coarse[p] * c->coarse[p];
        }
    }
}

const char *kn_composite_build(kn_model *m)
{
    kn_composite *c = m->composite = calloc(1, sizeof *c);
    size_t places = 1;
    double share = 0; // sum of the top nodes' shares in a load
    for (int k = 0; k < 3; k++) places *= (size_t)m->def.nodes[k] / 2 + 1;
    if (!c) return KN_NO_MEMORY;
    c->inside = m->kernels;
    m->kappa_m = m->grid.kappa_m;
    m->gamma = m->grid.gamma;
    m->size_m = fmax(fmax(m->grid.n[0], m->grid.n[1]), m->grid.n[2]) * m->def.spacing_m;
    c->place = malloc(places * sizeof *c->place);
    // make the parts, then the arrays of the whole model, then nodes and ties
    if (!c->place || !make_parts(m, c)) return KN_NO_MEMORY;
    memset(c->place, 0xff, places * sizeof *c->place); // all entries become -1: no node yet
    int nodes = c->node_first[c->part_count];
    c->tie = calloc((size_t)nodes, sizeof *c->tie);
    c->pull = calloc((size_t)nodes, 4 * sizeof *c->pull);
    if (!c->tie || !c->pull || !kn_model_nodes(m, nodes, nodes)) return KN_NO_MEMORY;
    m->row_count = c->row_first[c->part_count];
    m->stride = kn_grid_stride(&c->part[0].grid);
    m->edge_reals = (size_t)m->row_count * KN_FORWARD * m->stride;
    m->product_reals = (size_t)kn_work_edge(m) * m->edge_reals;
    build_faces(m);
    place_nodes(m);
    tie_all(m);
    for (int node = 0; node < nodes; node++) share += m->top_share[node];
    kn_top_list(m, share);
    composite_kernels(m);
    return NULL;
}

void kn_composite_destroy(kn_composite *c)
{
    if (!c) return;
    for (int p = 0; c->part && p < c->part_count; p++) free(c->part[p].tables);
    free(c->part);
    free(c->tie);
    free(c->pull);
    free(c->place);
    free(c);
}

void kn_composite_displacement(const kn_model *m, const kn_state *state, const int at[3], double u_m[3])
{
    const kn_composite *c = m->composite;
    int node[8], count = 1;
    if (!c) {
        node[0] = kn_grid_node(&m->grid, at[0], at[1], at[2]);
    } else if (is_inside(m, at)) {
        const int p = c->part_count - 1, *o = c->corner[p];
        node[0] = c->node_first[p] + kn_grid_node(&c->part[p].grid, at[0] - o[0], at[1] - o[1], at[2] - o[2]);
    } else {
        count = nodes_around(m, at, node);
    }
    for (int k = 0; k < 3; k++) u_m[k] = 0;
    for (int i = 0; i < count; i++) {
        double x[3];
        kn_state_position(m, state, node[i], x);
        for (int k = 0; k < 3; k++) u_m[k] += (x[k] - m->rest_m[node[i]][k]) / count;
    }
}
