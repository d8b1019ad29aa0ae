// The kernels of a net. The law is evaluated for sixteen edges at a time, but forces and products are added to the
// nodes one edge after the other. Edges are ordered by their lower node, so the sums of lower nodes stay in registers.
// The scalar parts are plain arithmetic in a fixed order, so all machines give the same bits.
#include "core/cell.h"
#include "core/solve/kernel_law.h"

typedef struct tables {
    law_tables law; // must be first: its arrays are then aligned to 64 bytes like the block
    int nodes, edges, batches;
    int (*ends)[2]; // [edges] lower node, upper node
    int *first;     // [nodes + 1] first edge with this lower node
    real *rest;     // [batches][3][16] rest vector [m]; the padding repeats that of the first edge
    real *scale;    // [batches][16] factor 1/(gamma L0) from length to strain [1/m]
    real *area;     // [batches][16] factor gamma kappa weight L0 from stress to force [m^2]; 0 in the padding
    real *root;     // [batches][16] factor sqrt(kappa weight A) from sqrt(ds/db) to sqrt(force per rate)
    real *here;     // [batches][16] 1 if there is an edge, 0 in the padding
    real *mass_dt;  // [nodes] mass over dt [kg/s]
    real *weight;   // [nodes] downward force [N]
    // Gas. cells: number of cells, 0 without gas; sides: number of sides from a cell's first corner; corner: corners of
    // each cell; side: rest vectors of the sides; inverse_volume: 1/V0; outside: P0; sixth: 1/6 for a tetrahedron, half
    // the thickness for a triangle.
    int cells, sides;
    bool flat;
    int (*corner)[4];
    real *side, *inverse_volume;
    real outside, sixth;
    double volume; // volume of the whole object at rest [m^3]
} tables;

static size_t padded(size_t bytes) { return (bytes + 63) / 64 * 64; }

static size_t tables_size(const kn_model *m)
{
    size_t nodes = (size_t)m->node_count;
    return padded(sizeof(tables)) + padded((nodes + 1) * sizeof(int)) + padded(m->edge_reals * 2 * sizeof(int)) +
           7 * padded(m->edge_reals * sizeof(real)) + 2 * padded(nodes * sizeof(real)) +
           padded((size_t)m->cell_count * 4 * sizeof(int)) + padded((size_t)m->cell_count * 9 * sizeof(real)) +
           padded((size_t)m->cell_count * sizeof(real));
}

// Take an array from the block behind the tables.
static void *take(char **next, size_t bytes)
{
    void *p = *next;
    *next += padded(bytes);
    return p;
}

// Fill the tables of the edges. The padding repeats the first edge with area 0, so that all lanes hold valid numbers.
static void fill_edges(const kn_model *m, tables *t)
{
    double a = m->law.a_pa_s;
    for (size_t e = 0; e < m->edge_reals; e++) {
        const kn_edge *edge = &m->edges[e < (size_t)m->edge_count ? e : 0];
        bool here = e < (size_t)m->edge_count;
        for (size_t k = 0; k < 3; k++)
            t->rest[e / KN_LANES * 3 * KN_LANES + k * KN_LANES + e % KN_LANES] =
                (real)(m->rest_m[edge->j][k] - m->rest_m[edge->i][k]);
        t->ends[e][0] = edge->i, t->ends[e][1] = edge->j;
        t->scale[e] = (real)(1 / (m->gamma * edge->rest_m));
        t->area[e] = (real)(here ? m->gamma * m->kappa_m * edge->weight * edge->rest_m : 0);
        t->root[e] = (real)(here ? sqrt(m->kappa_m * edge->weight * a) : 0);
        t->here[e] = here ? 1 : 0;
    }
}

// Fill the tables of the cells.
static void fill_cells(const kn_model *m, tables *t, char **next)
{
    t->cells = m->cell_count;
    t->sides = m->def.mesh->dimension;
    t->flat = t->sides == 2;
    t->outside = (real)kn_model_gas_pa(m);
    t->sixth = (real)(t->flat ? 0.5 * m->def.thickness_m : 1.0 / 6);
    t->corner = take(next, (size_t)t->cells * 4 * sizeof(int));
    t->side = take(next, (size_t)t->cells * 9 * sizeof(real));
    t->inverse_volume = take(next, (size_t)t->cells * sizeof(real));
    for (int c = 0; c < t->cells; c++) {
        for (int i = 0; i < 4; i++) t->corner[c][i] = m->cells[c].corner[i];
        for (int i = 0; i < t->sides; i++)
            for (int k = 0; k < 3; k++)
                t->side[9 * c + 3 * i + k] = (real)(m->rest_m[t->corner[c][i + 1]][k] - m->rest_m[t->corner[c][0]][k]);
        t->inverse_volume[c] = (real)(1 / m->cell_volume[c]);
        t->volume += m->cell_volume[c];
    }
}

static void tables_build(const kn_model *m, void *block)
{
    tables *t = block;
    size_t nodes = (size_t)m->node_count, edges = m->edge_reals * sizeof(real);
    char *next = (char *)block + padded(sizeof *t);
    law_tables_build(&t->law, m);
    t->nodes = m->node_count;
    t->edges = m->edge_count;
    t->batches = (int)(m->edge_reals / KN_LANES);
    t->ends = take(&next, m->edge_reals * sizeof *t->ends);
    t->first = take(&next, (nodes + 1) * sizeof(int));
    t->rest = take(&next, 3 * edges);
    t->scale = take(&next, edges);
    t->area = take(&next, edges);
    t->root = take(&next, edges);
    t->here = take(&next, edges);
    t->mass_dt = take(&next, nodes * sizeof(real));
    t->weight = take(&next, nodes * sizeof(real));
    fill_edges(m, t);
    fill_cells(m, t, &next);
    // find the first edge of each node; edges are in the order of their lower nodes
    for (int i = 0, e = 0; i <= m->node_count; i++) {
        while (e < m->edge_count && m->edges[e].i < i) e++;
        t->first[i] = e;
    }
    for (int i = 0; i < m->node_count; i++) {
        t->mass_dt[i] = (real)(m->node_mass_kg[i] * m->def.solver.mass_scale / m->def.solver.dt_s);
        t->weight[i] = (real)(m->node_mass_kg[i] * m->def.gravity_m_s2);
    }
}

// --- the edge pass --------------------------------------------------------------------------------------------------

// Compute the differences of a 3-component field between the far and the near ends of sixteen edges.
LANES_INLINE void gather(const int (*edge)[2], int count, const real *field, lanes out[3])
{
    _Alignas(64) real gap[3][KN_LANES] = {{0}};
    for (int l = 0; l < count; l++)
        for (int k = 0; k < 3; k++) gap[k][l] = field[3 * edge[l][1] + k] - field[3 * edge[l][0] + k];
    for (int k = 0; k < 3; k++) out[k] = lanes_load(gap[k]);
}

// Add g g' to the symmetric block p.
static void block_add(real p[6], const real g[3])
{
    for (int c = 0, m = 0; c < 3; c++)
        for (int k = c; k < 3; k++, m++) p[m] += g[c] * g[k];
}

// Add the forces of sixteen edges to the residual and their stiffness to the diagonal blocks of both ends. Store the
// vectors g for the matrix products.
static void scatter(const kn_work *work, const int (*edge)[2], int count, int at, const lanes n[3], lanes tension,
                    lanes root)
{
    _Alignas(64) real unit[3][KN_LANES], pull[KN_LANES], g_[KN_LANES];
    real *r = work->r, *p = work->p;
    for (int k = 0; k < 3; k++) lanes_store(unit[k], n[k]);
    lanes_store(pull, tension);
    lanes_store(g_, root);
    for (int l = 0; l < count; l++) {
        real *g = (real *)work->g + 3 * (at + l);
        for (int k = 0; k < 3; k++) {
            g[k] = g_[l] * unit[k][l];
            r[3 * edge[l][0] + k] += pull[l] * unit[k][l];
            r[3 * edge[l][1] + k] -= pull[l] * unit[k][l];
        }
        block_add(p + 6 * edge[l][0], g);
        block_add(p + 6 * edge[l][1], g);
    }
}

// Linearise sixteen edges, and add their forces and stiffness to their nodes.
LANES_INLINE void edge_batch(const kn_model *model, kn_state *state, const kn_work *work, const tables *t, int batch,
                             kn_law_kind kind, bool stroke, kn_linearization how, bool again)
{
    size_t at = (size_t)batch * KN_LANES;
    const int(*edge)[2] = (const int(*)[2])t->ends + at;
    int count = t->edges - (int)at < KN_LANES ? t->edges - (int)at : KN_LANES;
    bool afresh = again;
    // evaluate the law twice if the guess differs from the last velocity at any end of an edge
    for (int l = 0; l < count; l++) afresh = afresh || work->row_moved[edge[l][0]] || work->row_moved[edge[l][1]];

    // gather the geometry, evaluate the law, scatter the results
    bars x16;
    x16.scale = lanes_load(t->scale + at);
    for (int k = 0; k < 3; k++) x16.rest[k] = lanes_load(t->rest + 3 * at + (size_t)k * KN_LANES);
    gather(edge, count, state->displacement, x16.shift);
    gather(edge, count, state->velocity, x16.dv);
    bars_direct(&t->law, &x16);
    lanes wanted = x16.rate;
    if (afresh) {
        lanes dg[3];
        gather(edge, count, work->guess, dg);
        wanted = dot(x16.n, dg);
    }
    lanes stress, root;
    real *strain = kind == KN_LAW_VOIGT ? NULL : (real *)state->strain + at;
    bars_law(model, &t->law, &x16, kind, stroke, how, wanted, afresh, again, t->here + at, strain, &stress, &root);
    scatter(work, edge, count, (int)at, x16.n, lanes_mul(stress, lanes_load(t->area + at)),
            lanes_mul(root, lanes_load(t->root + at)));
}

static real multiply_block(const real p[6], const real r[3], real z[3])
{
    z[0] = p[0] * r[0] + p[1] * r[1] + p[2] * r[2];
    z[1] = p[1] * r[0] + p[3] * r[1] + p[4] * r[2];
    z[2] = p[2] * r[0] + p[4] * r[1] + p[5] * r[2];
    return z[0] * r[0] + z[1] * r[1] + z[2] * r[2];
}

// Invert the symmetric block m in place, by its cofactors.
static void invert_block(real m[6])
{
    real p[6] = {m[3] * m[5] - m[4] * m[4], m[2] * m[4] - m[1] * m[5], m[1] * m[4] - m[2] * m[3],
                 m[0] * m[5] - m[2] * m[2], m[1] * m[2] - m[0] * m[4], m[0] * m[3] - m[1] * m[1]};
    real inverse = 1 / (m[0] * p[0] + m[1] * p[1] + m[2] * p[2]);
    for (int k = 0; k < 6; k++) m[k] = p[k] * inverse;
}

// Finish a node after all of its edges have been added: add mass and weight, apply constraints, invert the block,
// compute z. Return r.z.
static double finish_node(const kn_state *state, const kn_work *work, const tables *t, int node, bool again)
{
    static const int diagonal[3] = {0, 3, 5}, pair[3][3] = {{1, 0, 1}, {2, 0, 2}, {4, 1, 2}};
    const real *v = (const real *)state->velocity + 3 * node, *guess = (const real *)work->guess + 3 * node;
    const real *loose = (const real *)work->free + 3 * node;
    real *r = (real *)work->r + 3 * node, *z = (real *)work->z + 3 * node, *p = (real *)work->p + 6 * node;
    for (int k = 0; k < 3; k++) p[diagonal[k]] += t->mass_dt[node];
    r[2] -= t->weight[node];
    // add the inertia force if the guessed velocity differs from the last velocity
    if (work->row_moved[node] || again)
        for (int k = 0; k < 3; k++) r[k] += t->mass_dt[node] * (v[k] - guess[k]);
    // clear the rows and columns of prescribed components, so that the inverse acts on free components only
    if (work->row_held[node])
        for (int k = 0; k < 3; k++) {
            p[pair[k][0]] *= loose[pair[k][1]] * loose[pair[k][2]];
            if (loose[k] < (real)0.5) p[diagonal[k]] = 1;
        }
    invert_block(p);
    if (work->row_held[node])
        for (int k = 0; k < 3; k++) p[diagonal[k]] *= loose[k];
    return (double)multiply_block(p, r, z);
}

LANES_INLINE double edge_pass(const kn_model *model, kn_state *state, const kn_work *work, kn_law_kind kind,
                              bool stroke, kn_linearization how, bool again)
{
    const tables *t = model->tables;
    double sum = 0;
    for (int b = 0; b < t->batches; b++) edge_batch(model, state, work, t, b, kind, stroke, how, again);
    for (int i = 0; i < t->nodes; i++) sum += finish_node(state, work, t, i, again);
    return sum;
}

// --- pressure in the elements ---------------------------------------------------------------------------------------

// The gas of a net, one element at a time; core/cell.h has the equations. The volume of an element is 1/6 of the triple
// product of its three sides at the first corner. A side is its rest vector plus its change, as for edges.

typedef struct element { // volume of one element in its present shape
    real slope[4][3];    // dV/dx of the element's corners [m^2]
    real j;              // J = V/V0, volume relative to the volume at rest
} element;

// Set the slope of a corner to factor (a x b), and subtract it from the slope of the first corner. `factor`: 1/6, or
// half the thickness of a flat element.
LANES_INLINE void add_slope(element *x, int corner, const real a[3], const real b[3], real factor)
{
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        x->slope[corner][k] = factor * (a[u] * b[v] - a[v] * b[u]);
        x->slope[0][k] -= x->slope[corner][k];
    }
}

// Compute J = V/V0 of one element and the derivatives dV/dx (slopes) with respect to its corners' positions.
LANES_INLINE element element_of(const tables *t, const real *displacement, int cell)
{
    // third side of a flat element; it points along -y, because the corners 0, 1, 2 turn from x to z
    static const real across[3] = {0, -1, 0};
    const int *corner = t->corner[cell];
    real side[3][3];
    element x = {.slope = {{0}}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            side[i][k] = t->flat && i == 2 ? across[k]
                                           : t->side[9 * cell + 3 * i + k] + displacement[3 * corner[i + 1] + k] -
                                                 displacement[3 * corner[0] + k];
    add_slope(&x, 1, side[1], side[2], t->sixth);
    add_slope(&x, 2, side[2], side[0], t->sixth);
    if (!t->flat) add_slope(&x, 3, side[0], side[1], t->sixth);
    real volume = 0;
    for (int k = 0; k < 3; k++) volume += side[0][k] * x.slope[1][k];
    x.j = volume * t->inverse_volume[cell];
    return x;
}

// Compute the relative overpressure (P - P0)/P0 at the end of the step, and the slope -d(P/P0)/dJ. `rate`: dJ/dt.
static void gas(const tables *t, real j, real rate, real *over, real *slope)
{
    real held = j > (real)KN_CELL_LEAST ? j : (real)KN_CELL_LEAST;
    *slope = 1 / (held * held);
    *over = (1 - held) / held + (held - j) * *slope - t->law.dt * rate * *slope;
}

// Add the gas forces at the end of the step to the residual of the corners of every cell. Add the slope of the pressure
// to the corners' diagonal blocks, and store the vectors g for the matrix products.
static void cells_add(const kn_work *work, const tables *t, const real *displacement)
{
    real *r = work->r, *p = work->p, *kept = work->cell;
    const real *guess = work->guess;
    for (int c = 0; c < t->cells; c++) {
        element x = element_of(t, displacement, c);
        real rate = 0, over, slope;
        for (int i = 0; i <= t->sides; i++)
            for (int k = 0; k < 3; k++) rate += x.slope[i][k] * guess[3 * t->corner[c][i] + k];
        gas(t, x.j, rate * t->inverse_volume[c], &over, &slope);
        real root = (real)sqrt((double)(t->law.dt * t->outside * slope * t->inverse_volume[c]));
        for (int i = 0; i <= t->sides; i++) {
            real *g = kept + 12 * c + 3 * i;
            for (int k = 0; k < 3; k++) {
                g[k] = root * x.slope[i][k];
                r[3 * t->corner[c][i] + k] += t->outside * over * x.slope[i][k];
            }
            block_add(p + 6 * t->corner[c][i], g);
        }
    }
}

// Do the work of cells_add with one pressure for the whole object. First sum the volumes, and sum dV/dx of every node
// in work->cell, an array [nodes][3].
static void object_add(const kn_work *work, const tables *t, const real *displacement)
{
    real *r = work->r, *p = work->p, *kept = work->cell;
    const real *guess = work->guess;
    double volume = 0, rate = 0;
    real over, slope;
    memset(kept, 0, 3 * (size_t)t->nodes * sizeof *kept);
    for (int c = 0; c < t->cells; c++) {
        element x = element_of(t, displacement, c);
        volume += (double)x.j / (double)t->inverse_volume[c];
        for (int i = 0; i <= t->sides; i++)
            for (int k = 0; k < 3; k++) kept[3 * t->corner[c][i] + k] += x.slope[i][k];
    }
    // rate: dV/dt at the guessed velocities
    for (int i = 0; i < 3 * t->nodes; i++) rate += (double)(kept[i] * guess[i]);
    gas(t, (real)(volume / t->volume), (real)(rate / t->volume), &over, &slope);
    real root = (real)sqrt((double)(t->law.dt * t->outside * slope) / t->volume);
    for (int i = 0; i < 3 * t->nodes; i++) {
        r[i] += t->outside * over * kept[i];
        kept[i] *= root;
    }
    for (int i = 0; i < t->nodes; i++) block_add(p + 6 * i, kept + 3 * i);
}

// Add g (g.d) of every cell to q, where g is the vector of a cell and d the search direction. Return the gas's part of
// d.q.
static double cells_product(const kn_work *work, const tables *t)
{
    const real *d = work->d, *kept = work->cell;
    real *q = work->q;
    double sum = 0;
    for (int c = 0; c < t->cells; c++) {
        const real *g = kept + 12 * c;
        real rate = 0;
        for (int i = 0; i <= t->sides; i++)
            for (int k = 0; k < 3; k++) rate += g[3 * i + k] * d[3 * t->corner[c][i] + k];
        for (int i = 0; i <= t->sides; i++)
            for (int k = 0; k < 3; k++) q[3 * t->corner[c][i] + k] += g[3 * i + k] * rate;
        sum += (double)rate * (double)rate;
    }
    return sum;
}

// Do the work of cells_product with one pressure for the whole object.
static double object_product(const kn_work *work, const tables *t)
{
    const real *d = work->d, *kept = work->cell;
    real *q = work->q;
    double rate = 0;
    for (int i = 0; i < 3 * t->nodes; i++) rate += (double)(kept[i] * d[i]);
    for (int i = 0; i < 3 * t->nodes; i++) q[i] += kept[i] * (real)rate;
    return rate * rate;
}

// --- the kernels ----------------------------------------------------------------------------------------------------

static double edge(const kn_model *model, kn_state *state, const kn_work *work, kn_linearization how, bool again)
{
    const tables *t = model->tables;
    if (model->def.pressure == KN_PRESSURE_CELLS) cells_add(work, t, state->displacement);
    if (model->def.pressure == KN_PRESSURE_OBJECT) object_add(work, t, state->displacement);
    // each law without stops has a loop of its own; laws with stops share one
    if (model->law.stroke) return edge_pass(model, state, work, t->law.kind, true, how, again);
    switch (t->law.kind) {
    case KN_LAW_VOIGT: return edge_pass(model, state, work, KN_LAW_VOIGT, false, how, again);
    case KN_LAW_LINEAR: return edge_pass(model, state, work, KN_LAW_LINEAR, false, how, again);
    case KN_LAW_TABLE: return edge_pass(model, state, work, KN_LAW_TABLE, false, how, again);
    default: return edge_pass(model, state, work, KN_LAW_EXACT, false, how, again);
    }
}

// --- conjugate gradients --------------------------------------------------------------------------------------------

// Set z to the last step's change of velocity at free components. Return r.z.
static double recall(const kn_model *model, const kn_state *state, const kn_work *work)
{
    const tables *t = model->tables;
    const real *change = state->change, *r = work->r, *free = work->free;
    real *z = work->z;
    double sum = 0;
    for (int i = 0; i < 3 * t->nodes; i++) {
        z[i] = change[i] * free[i];
        sum += (double)(r[i] * z[i]);
    }
    return sum;
}

static double apply(const kn_model *model, const kn_state *state, const kn_work *work, double beta)
{
    (void)state;
    const tables *t = model->tables;
    real *d = work->d, *q = work->q;
    const real *g = work->g, *z = work->z;
    for (int i = 0; i < 3 * t->nodes; i++) d[i] = z[i] + (real)beta * d[i];
    double sum = 0;
    // add the products of the edges, one lower node after the other; the sums of a lower node stay in registers, those
    // of upper nodes are in memory
    for (int i = 0; i < t->nodes; i++) {
        const real own[3] = {d[3 * i], d[3 * i + 1], d[3 * i + 2]};
        real mine[3] = {t->mass_dt[i] * own[0], t->mass_dt[i] * own[1], t->mass_dt[i] * own[2]};
        for (int e = t->first[i]; e < t->first[i + 1]; e++) {
            const real *n = g + 3 * e, *far = d + 3 * t->ends[e][1];
            real force = n[0] * (own[0] - far[0]) + n[1] * (own[1] - far[1]) + n[2] * (own[2] - far[2]);
            real *other = q + 3 * t->ends[e][1];
            for (int k = 0; k < 3; k++) {
                mine[k] += n[k] * force;
                other[k] -= n[k] * force;
            }
        }
        // all edges from lower nodes have been added, so the sum of this node is complete
        for (int k = 0; k < 3; k++) {
            q[3 * i + k] += mine[k];
            sum += (double)(own[k] * q[3 * i + k]);
        }
    }
    if (model->def.pressure == KN_PRESSURE_CELLS) sum += cells_product(work, t);
    if (model->def.pressure == KN_PRESSURE_OBJECT) sum += object_product(work, t);
    return sum;
}

static double update(const kn_model *model, const kn_work *work, double alpha)
{
    const tables *t = model->tables;
    const real a = (real)alpha, *d = work->d, *p = work->p;
    real *guess = work->guess, *r = work->r, *q = work->q, *z = work->z;
    double sum = 0;
    for (int i = 0; i < 3 * t->nodes; i++) {
        guess[i] += a * d[i];
        r[i] -= a * q[i];
        q[i] = 0; // clear q for the next product A d
    }
    for (int i = 0; i < t->nodes; i++) sum += (double)multiply_block(p + 6 * i, r + 3 * i, z + 3 * i);
    return sum;
}

static void integrate(const kn_model *model, kn_state *state, const kn_work *work)
{
    const tables *t = model->tables;
    const real *guess = work->guess;
    real *x = state->displacement, *v = state->velocity, *change = state->change;
    for (int i = 0; i < 3 * t->nodes; i++) {
        change[i] = guess[i] - v[i];
        v[i] = guess[i];
        x[i] += t->law.dt * guess[i];
    }
}

const kn_kernels KN_KERNELS(net) = {
    .name = KN_KERNELS_NAME,
    .tables_size = tables_size,
    .tables_build = tables_build,
    .edge = edge,
    .recall = recall,
    .apply = apply,
    .update = update,
    .integrate = integrate,
};
