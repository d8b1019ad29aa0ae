// The kernels of a net. The law is evaluated for sixteen edges at a time. Then every node gathers what its edges have
// left for it, sixteen nodes at a time, so nothing is scattered: the nodes of a row have about as many edges each
// (core/lattice/net.c orders them), and the row takes as many turns as its first node has edges (the format SELL-16).
//
//     records   [x y z 0] of a node or an edge, so that one load brings all that another one needs of it
//     turn      sixteen half edges, one per node of a row: the record of the node at the other end, the record of the
//               edge, and the sign of its pull; a node with fewer edges than turns has its own record there, and g = 0
//
// Both ends of an edge compute the same product in the same order, so they differ in sign alone.
#include "core/cell.h"
#include "core/solve/coarse.h"
#include "core/solve/kernel_nodes.h"

enum { RECORD = 4 };

typedef struct tables {
    law_tables law; // must be first: its arrays are then aligned to 64 bytes like the block
    int rows, batches;
    int (*ends)[2][KN_LANES]; // [batches] offsets of the records of both ends; the padding repeats the first edge
    real *rest;               // [batches][3][16] rest vector [m]; the padding repeats that of the first edge
    real *scale;              // [batches][16] factor 1/(gamma L0) from length to strain [1/m]
    real *area;               // [batches][16] factor gamma kappa weight L0 from stress to force [m^2]; 0 in the padding
    real *root;               // [batches][16] factor sqrt(kappa weight A) from sqrt(ds/db) to sqrt(force per rate)
    real *here;               // [batches][16] 1 if there is an edge, 0 in the padding
    int *first;               // [rows + 1] first turn of each row
    int (*other)[KN_LANES];   // [turns] offset of the record of the node at the other end
    int (*edge)[KN_LANES];    // [turns] offset of the record of the edge
    real *sign;               // [turns][16] 1 at the lower end of the edge, -1 at the upper end, 0 without an edge
    real *mass_dt;            // [rows][16] mass over dt [kg/s]; 1 in the padding, so that no block is singular
    real *weight;             // [rows][16] downward force [N]
    // Coarse level. coarse_cell: lowest coarse node of the cell that contains the nodes of a row; coarse_step: from a
    // coarse node to the next one along x, y, z, 0 along an axis with one; coarse_place: places in the cell, 0 to 1
    // along x, y, z, then 1 if there is a node.
    int *coarse_cell, coarse_step[3];
    int coarse_cells, *coarse_first; // number of coarse cells with nodes; [coarse_cells + 1] first row of each
    real *coarse_place;              // [rows][4][16]
    // Gas. cells: number of cells, 0 without gas; sides: number of sides from a cell's first corner; corner
    // [batches of 16][4][16]: offsets of the corners' records; side [batches][3][x y z][16]: rest vectors of the sides;
    // inverse_volume: 1/V0; outside: P0; sixth: 1/6 for a tetrahedron, half the thickness for a triangle. The padding
    // repeats the first cell.
    int cells, sides;
    int (*corner)[4][KN_LANES];
    real *side, *inverse_volume;
    real outside, sixth;
    double volume; // volume of the whole object at rest [m^3]
} tables;

static size_t padded(size_t bytes) { return (bytes + 63) / 64 * 64; }

static size_t tables_size(const kn_model *m)
{
    const size_t rows = (size_t)m->row_count, cells = kn_work_cells(m), turns = m->product_reals / (3 * KN_LANES);
    const size_t batch = KN_LANES * sizeof(real), batches = m->edge_reals / KN_LANES;
    return padded(sizeof(tables)) + batches * (2 * KN_LANES * sizeof(int) + 7 * batch) +
           padded((rows + 1) * sizeof(int)) + turns * (2 * KN_LANES * sizeof(int) + batch) + 6 * rows * batch +
           2 * padded((rows + 1) * sizeof(int)) + padded(cells * 4 * sizeof(int)) + padded(cells * 9 * sizeof(real)) +
           padded(cells * sizeof(real));
}

// Take an array from the block behind the tables.
static void *take(char **next, size_t bytes)
{
    void *p = *next;
    *next += padded(bytes);
    return p;
}

// Return the place of a node in the order of memory.
static int lane_of(const kn_model *m, int node)
{
    const int o = (int)m->offset[node], row = 3 * KN_LANES;
    return o / row * KN_LANES + o % row;
}

// Fill the tables of the edges. The padding repeats the first edge with area 0, so that all lanes hold valid numbers.
static void fill_edges(const kn_model *m, tables *t, char **next)
{
    const double a = m->law.a_pa_s;
    const size_t edges = m->edge_reals * sizeof(real);

    t->batches = (int)(m->edge_reals / KN_LANES);
    t->ends = take(next, (size_t)t->batches * sizeof *t->ends);
    t->rest = take(next, 3 * edges);
    t->scale = take(next, edges);
    t->area = take(next, edges);
    t->root = take(next, edges);
    t->here = take(next, edges);
    for (size_t i = 0; i < m->edge_reals; i++) {
        const kn_edge *edge = &m->edges[i < (size_t)m->edge_count ? i : 0];
        const bool here = i < (size_t)m->edge_count;
        const size_t e = here ? (size_t)edge->slot : i, batch = e / KN_LANES, l = e % KN_LANES;
        for (size_t k = 0; k < 3; k++)
            t->rest[batch * 3 * KN_LANES + k * KN_LANES + l] = (real)(m->rest_m[edge->j][k] - m->rest_m[edge->i][k]);
        t->ends[batch][0][l] = RECORD * lane_of(m, edge->i);
        t->ends[batch][1][l] = RECORD * lane_of(m, edge->j);
        t->scale[e] = (real)(1 / (m->gamma * edge->rest_m));
        t->area[e] = (real)(here ? m->gamma * m->kappa_m * edge->weight * edge->rest_m : 0);
        t->root[e] = (real)(here ? sqrt(m->kappa_m * edge->weight * a) : 0);
        t->here[e] = here ? 1 : 0;
    }
}

// Fill the turns of every row.
static void fill_turns(const kn_model *m, tables *t, char **next)
{
    const size_t turns = m->product_reals / (3 * KN_LANES);

    t->first = take(next, ((size_t)t->rows + 1) * sizeof(int));
    t->other = take(next, turns * sizeof *t->other);
    t->edge = take(next, turns * sizeof *t->edge);
    t->sign = take(next, turns * KN_LANES * sizeof(real));
    for (int row = 0, turn = 0; row <= t->rows; row++) {
        t->first[row] = turn;
        for (int end = row < t->rows ? turn + m->row_turns[row] : turn; turn < end; turn++)
            for (int l = 0; l < KN_LANES; l++) {
                t->other[turn][l] = RECORD * (row * KN_LANES + l);
                t->edge[turn][l] = RECORD * (int)m->edge_reals; // the record behind those of the edges is 0
            }
    }
    // give every edge the next turn of both of its ends
    for (int e = 0; e < m->edge_count; e++)
        for (int end = 0; end < 2; end++) {
            const int lane = lane_of(m, end ? m->edges[e].j : m->edges[e].i), l = lane % KN_LANES;
            int turn = t->first[lane / KN_LANES];
            while (t->sign[turn * KN_LANES + l] != 0) turn++;
            t->other[turn][l] = RECORD * lane_of(m, end ? m->edges[e].i : m->edges[e].j);
            t->edge[turn][l] = RECORD * m->edges[e].slot;
            t->sign[turn * KN_LANES + l] = end ? -1 : 1;
        }
}

static void fill_nodes(const kn_model *m, tables *t, char **next)
{
    const size_t lanes_all = (size_t)t->rows * KN_LANES;
    t->mass_dt = take(next, lanes_all * sizeof(real));
    t->weight = take(next, lanes_all * sizeof(real));
    for (size_t i = 0; i < lanes_all; i++) t->mass_dt[i] = 1;
    for (int i = 0; i < m->node_count; i++) {
        const int lane = lane_of(m, i);
        t->mass_dt[lane] = (real)(m->node_mass_kg[i] * m->def.solver.mass_scale / m->def.solver.dt_s);
        t->weight[lane] = (real)(m->node_mass_kg[i] * m->def.gravity_m_s2);
    }
}

static void fill_coarse(const kn_model *m, tables *t, char **next)
{
    const kn_coarse *c = m->coarse;
    if (!c) return;
    t->coarse_cell = take(next, (size_t)t->rows * sizeof(int));
    t->coarse_first = take(next, ((size_t)t->rows + 1) * sizeof(int));
    t->coarse_place = take(next, 4 * (size_t)t->rows * KN_LANES * sizeof(real));
    for (int k = 0, step = 1; k < 3; step *= c->nodes[k++]) t->coarse_step[k] = c->nodes[k] > 1 ? step : 0;
    for (int i = 0; i < m->node_count; i++) {
        const int lane = lane_of(m, i), row = lane / KN_LANES;
        int cell[3];
        double place[3];
        kn_coarse_cell(c, m->rest_m[i], cell, place);
        t->coarse_cell[row] = (cell[2] * c->nodes[1] + cell[1]) * c->nodes[0] + cell[0];
        for (int k = 0; k < 4; k++)
            t->coarse_place[(4 * row + k) * KN_LANES + lane % KN_LANES] = k < 3 ? (real)place[k] : 1;
    }
    for (int row = 0; row < t->rows; row++)
        if (row == 0 || t->coarse_cell[row] != t->coarse_cell[row - 1]) t->coarse_first[t->coarse_cells++] = row;
    t->coarse_first[t->coarse_cells] = t->rows;
}

// Fill the tables of the cells.
static void fill_cells(const kn_model *m, tables *t, char **next)
{
    const int padded_cells = (int)kn_work_cells(m);
    t->cells = m->cell_count;
    t->sides = m->def.mesh->dimension;
    t->outside = (real)kn_model_gas_pa(m);
    t->sixth = (real)(t->sides == 2 ? 0.5 * m->def.thickness_m : 1.0 / 6);
    t->corner = take(next, (size_t)padded_cells * 4 * sizeof(int));
    t->side = take(next, (size_t)padded_cells * 9 * sizeof(real));
    t->inverse_volume = take(next, (size_t)padded_cells * sizeof(real));
    for (int i = 0; i < padded_cells; i++) {
        const int c = i < t->cells ? i : 0, batch = i / KN_LANES, l = i % KN_LANES, *corner = m->cells[c].corner;
        for (int k = 0; k <= t->sides; k++) t->corner[batch][k][l] = RECORD * lane_of(m, corner[k]);
        for (int k = 0; k < 3 * t->sides; k++)
            t->side[(9 * batch + k) * KN_LANES + l] =
                (real)(m->rest_m[corner[k / 3 + 1]][k % 3] - m->rest_m[corner[0]][k % 3]);
        t->inverse_volume[i] = (real)(1 / m->cell_volume[c]);
        if (i < t->cells) t->volume += m->cell_volume[c];
    }
}

static void tables_build(const kn_model *m, void *block)
{
    tables *t = block;
    char *next = (char *)block + padded(sizeof *t);
    law_tables_build(&t->law, m);
    t->rows = m->row_count;
    fill_edges(m, t, &next);
    fill_turns(m, t, &next);
    fill_nodes(m, t, &next);
    fill_coarse(m, t, &next);
    fill_cells(m, t, &next);
}

// --- the edge pass --------------------------------------------------------------------------------------------------

// Records of a step, part of the scratch: displacement, velocity and guess of the nodes; pull and g of the edges; sums
// of the cells at the nodes, 0 between two uses. The search direction takes the place of the displacement.
typedef struct records {
    real *node[3], *edge[2], *sum[3];
} records;

LANES_INLINE records records_of(const tables *t, const kn_work *work)
{
    const size_t nodes = (size_t)t->rows * KN_LANES * RECORD, edges = ((size_t)t->batches * KN_LANES + 1) * RECORD;
    real *node = work->records, *edge = node + 3 * nodes, *sum = edge + 2 * edges;
    return (records){{node, node + nodes, node + 2 * nodes}, {edge, edge + edges}, {sum, sum + nodes, sum + 2 * nodes}};
}

LANES_INLINE void load_nodes(const real *field, int row, lanes out[3])
{
    for (int k = 0; k < 3; k++) out[k] = lanes_load(field + at(1, row, 3, k, 0));
}

// Write the records of all nodes.
static void write_loop(void *loop, int part)
{
    const job *j = loop;
    const tables *t = j->model->tables;
    const records to = records_of(t, j->work);
    const real *field[3] = {j->state->displacement, j->state->velocity, j->work->guess};
    const range rows = rows_of(j, part);
    for (int row = rows.first; row < rows.end; row++)
        for (int f = 0; f < (j->moved || t->cells > 0 ? 3 : 2); f++) {
            lanes v[3];
            load_nodes(field[f], row, v);
            lanes_put(to.node[f] + (size_t)row * KN_LANES * RECORD, v);
        }
}

// Compute the differences of a field between the upper and the lower ends of sixteen edges.
LANES_INLINE void difference(const real *node, const int ends[2][KN_LANES], lanes out[3])
{
    lanes low[3], high[3];
    lanes_fetch(node, ends[0], low);
    lanes_fetch(node, ends[1], high);
    for (int k = 0; k < 3; k++) out[k] = lanes_sub(high[k], low[k]);
}

// Return whether the guess differs from the last velocity in a row with an end of sixteen edges.
static bool batch_moved(const tables *t, const kn_work *work, int batch)
{
    bool moved = false;
    for (int l = 0; l < 2 * KN_LANES; l++)
        moved = moved || work->row_moved[t->ends[batch][l / KN_LANES][l % KN_LANES] / (RECORD * KN_LANES)];
    return moved;
}

// Linearise sixteen edges, and leave their pull and their vector g for the nodes.
LANES_INLINE void edge_batch(const kn_model *model, const kn_state *state, const tables *t, const records *x, int batch,
                             kn_law_kind kind, bool stroke, kn_linearization how, bool afresh, bool again)
{
    const size_t at16 = (size_t)batch * KN_LANES;
    bars x16;
    x16.scale = lanes_load(t->scale + at16);
    for (int k = 0; k < 3; k++) x16.rest[k] = lanes_load(t->rest + 3 * at16 + (size_t)k * KN_LANES);
    difference(x->node[0], (const int(*)[KN_LANES])t->ends[batch], x16.shift);
    difference(x->node[1], (const int(*)[KN_LANES])t->ends[batch], x16.dv);
    bars_direct(&t->law, &x16);
    lanes wanted = x16.rate;
    if (afresh) {
        lanes dg[3];
        difference(x->node[2], (const int(*)[KN_LANES])t->ends[batch], dg);
        wanted = dot(x16.n, dg);
    }
    lanes stress, root, pull[3], g[3];
    real *strain = kind == KN_LAW_VOIGT ? NULL : (real *)state->strain + at16;
    bars_law(model, &t->law, &x16, kind, stroke, how, wanted, afresh, again, t->here + at16, strain, &stress, &root);
    stress = lanes_mul(stress, lanes_load(t->area + at16));
    root = lanes_mul(root, lanes_load(t->root + at16));
    for (int k = 0; k < 3; k++) {
        pull[k] = lanes_mul(stress, x16.n[k]);
        g[k] = lanes_mul(root, x16.n[k]);
    }
    lanes_put(x->edge[0] + RECORD * at16, pull);
    lanes_put(x->edge[1] + RECORD * at16, g);
}

// Add what the edges have left for the nodes of one row, and store the vectors g in the order of the turns.
LANES_INLINE void gather_edges(const tables *t, const fields *f, const records *x, int row)
{
    lanes pull[3], block[6];
    for (int k = 0; k < 3; k++) pull[k] = lanes_load(f->r + at(1, row, 3, k, 0));
    for (int k = 0; k < 6; k++) block[k] = lanes_load(f->p + at(1, row, 6, k, 0));
    for (int turn = t->first[row]; turn < t->first[row + 1]; turn++) {
        const lanes sign = lanes_load(t->sign + (size_t)turn * KN_LANES);
        lanes each[3], g[3];
        lanes_fetch(x->edge[0], t->edge[turn], each);
        lanes_fetch(x->edge[1], t->edge[turn], g);
        for (int k = 0; k < 3; k++) {
            pull[k] = lanes_fma(sign, each[k], pull[k]);
            lanes_store(f->g + at(1, turn, 3, k, 0), g[k]);
        }
        for (int c = 0, m = 0; c < 3; c++)
            for (int k = c; k < 3; k++, m++) block[m] = lanes_fma(g[c], g[k], block[m]);
    }
    for (int k = 0; k < 3; k++) lanes_store(f->r + at(1, row, 3, k, 0), pull[k]);
    for (int k = 0; k < 6; k++) lanes_store(f->p + at(1, row, 6, k, 0), block[k]);
}

static void finish_loop(void *loop, int part)
{
    const job *j = loop;
    const kn_work *work = j->work;
    const tables *t = j->model->tables;
    const records x = records_of(t, work);
    const fields f = fields_of(j->state, work, 1);
    const range rows = rows_of(j, part);
    for (int row = rows.first, together = rows_together(j->model); row < rows.end;) {
        const int group = row / together, end = row + together < rows.end ? row + together : rows.end;
        lanes sum = lanes_set(0);
        for (; row < end; row++) {
            const size_t o = (size_t)row * KN_LANES;
            gather_edges(t, &f, &x, row);
            sum = lanes_add(
                sum, finish_nodes(&f, work, row, 0, lanes_load(t->mass_dt + o), lanes_load(t->weight + o), j->again));
        }
        work->sums[group] = lanes_sum(sum);
    }
}

// --- pressure in the elements ---------------------------------------------------------------------------------------

// The gas of a net; core/cell.h has the equations. The volume of an element is 1/6 of the triple product of its three
// sides at the first corner. A side is its rest vector plus its change, as for edges. The elements' shapes are computed
// sixteen at a time. Then each element adds to the records of its corners, one element after the other.
typedef real record __attribute__((vector_size(RECORD * sizeof(real)), may_alias, aligned(4 * sizeof(real))));
#define RECORD_AT(p, offset) ((record *)(void *)((p) + (offset)))

typedef struct elements { // sixteen elements in their present shape
    lanes slope[4][3];    // dV/dx of the corners [m^2]
    lanes j;              // J = V/V0, volume relative to the volume at rest
} elements;

// Set the slope of a corner to factor (a x b), and subtract it from the slope of the first corner. `factor`: 1/6, or
// half the thickness of a flat element.
LANES_INLINE void add_slope(elements *x, int corner, const lanes a[3], const lanes b[3], lanes factor)
{
    for (int k = 0; k < 3; k++) {
        const int u = (k + 1) % 3, v = (k + 2) % 3;
        x->slope[corner][k] = lanes_mul(factor, lanes_fnma(a[v], b[u], lanes_mul(a[u], b[v])));
        x->slope[0][k] = lanes_sub(x->slope[0][k], x->slope[corner][k]);
    }
}

LANES_INLINE elements elements_of(const tables *t, const records *node, int batch)
{
    const lanes zero = lanes_set(0), factor = lanes_set(t->sixth);
    const real *rest = t->side + (size_t)batch * 9 * KN_LANES;
    lanes at[4][3], side[3][3];
    elements x = {.slope = {{zero, zero, zero}}};
    for (int i = 0; i <= t->sides; i++) lanes_fetch(node->node[0], t->corner[batch][i], at[i]);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            // the third side of a flat element points along -y, because the corners 0, 1, 2 turn from x to z
            side[i][k] = i == t->sides ? lanes_set(k == 1 ? -1 : 0)
                                       : lanes_add(lanes_load(rest + (size_t)(3 * i + k) * KN_LANES),
                                                   lanes_sub(at[i + 1][k], at[0][k]));
    add_slope(&x, 1, side[1], side[2], factor);
    add_slope(&x, 2, side[2], side[0], factor);
    if (t->sides == 3) add_slope(&x, 3, side[0], side[1], factor);
    x.j = lanes_mul(dot(side[0], x.slope[1]), lanes_load(t->inverse_volume + (size_t)batch * KN_LANES));
    return x;
}

// Return the number of elements in a batch.
static int elements_in(const tables *t, int batch)
{
    return t->cells - batch * KN_LANES < KN_LANES ? t->cells - batch * KN_LANES : KN_LANES;
}

// Compute the gas of sixteen elements. Store the vectors g of their corners for the matrix products, [corner][16
// records]. Return the pull along g.
LANES_INLINE lanes gas_batch(const tables *t, const records *node, int batch, real *kept)
{
    const elements x = elements_of(t, node, batch);
    const lanes one = lanes_set(1), inverse = lanes_load(t->inverse_volume + (size_t)batch * KN_LANES);
    lanes rate = lanes_set(0);
    for (int i = 0; i <= t->sides; i++) {
        lanes v[3];
        lanes_fetch(node->node[2], t->corner[batch][i], v);
        rate = lanes_add(rate, dot(x.slope[i], v));
    }
    // over = (P - P0)/P0 at the end of the step, slope = -d(P/P0)/dJ
    const lanes held = lanes_max(x.j, lanes_set((real)KN_CELL_LEAST)), i1 = lanes_div(one, held);
    const lanes slope = lanes_mul(i1, i1), step = lanes_mul(lanes_set(t->law.dt), lanes_mul(rate, inverse));
    const lanes over = lanes_fma(lanes_sub(lanes_sub(held, x.j), step), slope, lanes_mul(lanes_sub(one, held), i1));
    const lanes root = lanes_sqrt(lanes_mul(lanes_set(t->law.dt * t->outside), lanes_mul(slope, inverse)));
    for (int i = 0; i <= t->sides; i++) {
        lanes g[3];
        for (int k = 0; k < 3; k++) g[k] = lanes_mul(root, x.slope[i][k]);
        lanes_put(kept + (size_t)i * KN_LANES * RECORD, g);
    }
    return lanes_div(lanes_mul(lanes_set(t->outside), over), root);
}

// Add the records of all nodes to a field of 3 components, and clear them.
static void collect(const tables *t, real *sums, real *field, int components, int first)
{
    static const int own[KN_LANES] = {0, 4, 8, 12, 16, 20, 24, 28, 32, 36, 40, 44, 48, 52, 56, 60};
    for (int row = 0; row < t->rows; row++, sums += KN_LANES * RECORD) {
        lanes v[3];
        lanes_fetch(sums, own, v);
        for (int k = 0; k < 3; k++) store_add(field + at(1, row, components, first + k, 0), v[k]);
        memset(sums, 0, KN_LANES * RECORD * sizeof *sums);
    }
}

// Add the gas forces at the end of the step to the residual of the corners of every cell, and the slope of the pressure
// to the corners' diagonal blocks.
static void cells_add(const kn_work *work, const tables *t, const records *x)
{
    for (int b = 0; b * KN_LANES < t->cells; b++) {
        real *kept = (real *)work->cell + (size_t)b * 4 * KN_LANES * RECORD;
        _Alignas(64) real push[KN_LANES];
        lanes_store(push, gas_batch(t, x, b, kept));
        for (int l = 0; l < elements_in(t, b); l++)
            for (int i = 0; i <= t->sides; i++) {
                const int corner = t->corner[b][i][l];
                const record g = *RECORD_AT(kept, (i * KN_LANES + l) * RECORD);
                const record low = {g[1], g[1], g[2], 0}, high = {g[1], g[2], g[2], 0};
                *RECORD_AT(x->sum[0], corner) += push[l] * g;
                *RECORD_AT(x->sum[1], corner) += g[0] * g;   // xx xy xz
                *RECORD_AT(x->sum[2], corner) += low * high; // yy yz zz
            }
    }
    collect(t, x->sum[0], work->r, 3, 0);
    collect(t, x->sum[1], work->p, 6, 0);
    collect(t, x->sum[2], work->p, 6, 3);
}

// Return the scalar product of two fields, summed row by row.
static double field_dot(const tables *t, const real *a, const real *b)
{
    double sum = 0;
    for (int row = 0; row < t->rows; row++) {
        lanes x[3], y[3];
        load_nodes(a, row, x);
        load_nodes(b, row, y);
        sum += lanes_sum(dot(x, y));
    }
    return sum;
}

// Do the work of cells_add with one pressure for the whole object. First sum the volumes, and sum dV/dx of every node
// in work->cell, a field of 3 components.
static void object_add(const kn_work *work, const tables *t, const records *x)
{
    real *r = work->r, *p = work->p, *kept = work->cell;
    double volume = 0;
    for (int b = 0; b * KN_LANES < t->cells; b++) {
        _Alignas(64) real j[KN_LANES], slope[4][KN_LANES * RECORD];
        const elements each = elements_of(t, x, b);
        lanes_store(j, each.j);
        for (int i = 0; i <= t->sides; i++) lanes_put(slope[i], each.slope[i]);
        for (int l = 0; l < elements_in(t, b); l++) {
            volume += (double)j[l] / (double)t->inverse_volume[b * KN_LANES + l];
            for (int i = 0; i <= t->sides; i++)
                *RECORD_AT(x->sum[0], t->corner[b][i][l]) += *RECORD_AT(slope[i], l * RECORD);
        }
    }
    memset(kept, 0, at(1, t->rows, 3, 0, 0) * sizeof *kept);
    collect(t, x->sum[0], kept, 3, 0);
    // dV/dt at the guessed velocities; over and slope as in gas_batch
    const double rate = field_dot(t, kept, work->guess) / t->volume, whole = volume / t->volume;
    const double held = fmax(whole, KN_CELL_LEAST), slope = 1 / (held * held), dt = (double)t->law.dt;
    const double over = (1 - held) / held + (held - whole - dt * rate) * slope;
    const lanes push = lanes_set((real)((double)t->outside * over));
    const lanes root = lanes_set((real)sqrt(dt * (double)t->outside * slope / t->volume));
    for (int row = 0; row < t->rows; row++) {
        lanes g[3];
        load_nodes(kept, row, g);
        for (int k = 0; k < 3; k++) {
            store_add(r + at(1, row, 3, k, 0), lanes_mul(push, g[k]));
            g[k] = lanes_mul(root, g[k]);
            lanes_store(kept + at(1, row, 3, k, 0), g[k]);
        }
        for (int c = 0, m = 0; c < 3; c++)
            for (int k = c; k < 3; k++, m++) store_add(p + at(1, row, 6, m, 0), lanes_mul(g[c], g[k]));
    }
}

// Add g (g.d) of every cell to q, where g is the vector of a cell and d the search direction. Return the gas's part of
// d.q.
static double cells_product(const kn_work *work, const tables *t, const records *x)
{
    double sum = 0;
    for (int b = 0; b * KN_LANES < t->cells; b++) {
        const real *kept = (const real *)work->cell + (size_t)b * 4 * KN_LANES * RECORD;
        for (int l = 0; l < elements_in(t, b); l++) {
            const real *g = kept + l * RECORD;
            record each = {0};
            for (int i = 0; i <= t->sides; i++)
                each += *RECORD_AT(g, i * KN_LANES * RECORD) * *RECORD_AT(x->node[0], t->corner[b][i][l]);
            const real rate = each[0] + each[1] + each[2];
            for (int i = 0; i <= t->sides; i++)
                *RECORD_AT(x->sum[0], t->corner[b][i][l]) += *RECORD_AT(g, i * KN_LANES * RECORD) * rate;
            sum += (double)rate * (double)rate;
        }
    }
    collect(t, x->sum[0], work->q, 3, 0);
    return sum;
}

// Do the work of cells_product with one pressure for the whole object.
static double object_product(const kn_work *work, const tables *t)
{
    const real *kept = work->cell;
    real *q = work->q;
    const double rate = field_dot(t, kept, work->d);
    for (size_t o = 0; o < at(1, t->rows, 3, 0, 0); o += KN_LANES)
        store_add(q + o, lanes_mul(lanes_load(kept + o), lanes_set((real)rate)));
    return rate * rate;
}

// --- the kernels ----------------------------------------------------------------------------------------------------

LANES_INLINE void edge_batches(const job *j, int part, kn_law_kind kind, bool stroke)
{
    const tables *t = j->model->tables;
    const records x = records_of(t, j->work);
    const range batches = range_of(j->work, t->batches, part);
    for (int b = batches.first; b < batches.end; b++)
        edge_batch(j->model, j->state, t, &x, b, kind, stroke, j->how,
                   j->again || (j->moved && batch_moved(t, j->work, b)), j->again);
}

#define EDGE_LOOP(name, kind, stroke)                                                                                  \
    static void edge_##name(void *loop, int part) { edge_batches(loop, part, kind, stroke); }
EDGE_LOOP(stroke, ((const tables *)((const job *)loop)->model->tables)->law.kind, true)
EDGE_LOOP(voigt, KN_LAW_VOIGT, false)
EDGE_LOOP(linear, KN_LAW_LINEAR, false)
EDGE_LOOP(table, KN_LAW_TABLE, false)
EDGE_LOOP(exact, KN_LAW_EXACT, false)

static double edge(const kn_model *model, kn_state *state, const kn_work *work, kn_linearization how, bool again)
{
    const tables *t = model->tables;
    const records x = records_of(t, work);
    job j = {model, state, work, how, again, again, 0};
    for (int row = 0; row < t->rows; row++) j.moved = j.moved || work->row_moved[row];
    run(&j, write_loop);
    if (model->def.pressure == KN_PRESSURE_CELLS) cells_add(work, t, &x);
    if (model->def.pressure == KN_PRESSURE_OBJECT) object_add(work, t, &x);
    // each law without stops has a loop of its own; laws with stops share one
    if (model->law.stroke) run(&j, edge_stroke);
    else if (t->law.kind == KN_LAW_VOIGT) run(&j, edge_voigt);
    else if (t->law.kind == KN_LAW_LINEAR) run(&j, edge_linear);
    else run(&j, t->law.kind == KN_LAW_TABLE ? edge_table : edge_exact);
    run(&j, finish_loop);
    return sum_of(work->sums, groups_of(model));
}

// --- conjugate gradients --------------------------------------------------------------------------------------------

// Add the products of all edges of the nodes of a row: g (g . gap), where `gap` is the difference of the search
// direction between the node and the other end. Return d.q for each lane.
LANES_INLINE lanes product_row(const tables *t, const fields *f, const real *direction, int row)
{
    const lanes mass = lanes_load(t->mass_dt + (size_t)row * KN_LANES);
    lanes d[3], q[3], sum = lanes_set(0);
    load_nodes(f->d, row, d);
    for (int k = 0; k < 3; k++) q[k] = lanes_mul(mass, d[k]);
    for (int turn = t->first[row]; turn < t->first[row + 1]; turn++) {
        lanes g[3], gap[3], other[3];
        lanes_fetch(direction, t->other[turn], other);
        for (int k = 0; k < 3; k++) {
            g[k] = lanes_load(f->g + at(1, turn, 3, k, 0));
            gap[k] = lanes_sub(d[k], other[k]);
        }
        const lanes force = dot(g, gap);
        for (int k = 0; k < 3; k++) q[k] = lanes_fma(g[k], force, q[k]);
    }
    for (int k = 0; k < 3; k++) {
        lanes_store(f->q + at(1, row, 3, k, 0), q[k]);
        sum = lanes_fma(d[k], q[k], sum);
    }
    return sum;
}

static void direction_loop(void *loop, int part)
{
    const job *j = loop;
    const fields f = fields_of(j->state, j->work, 1);
    const records x = records_of(j->model->tables, j->work);
    const range rows = rows_of(j, part);
    for (int row = rows.first; row < rows.end; row++) {
        lanes d[3];
        next_direction(&f, row, (real)j->factor);
        load_nodes(f.d, row, d);
        lanes_put(x.node[0] + (size_t)row * KN_LANES * RECORD, d);
    }
}

static void product_loop(void *loop, int part)
{
    const job *j = loop;
    const tables *t = j->model->tables;
    const fields f = fields_of(j->state, j->work, 1);
    const records x = records_of(t, j->work);
    const range rows = rows_of(j, part);
    for (int row = rows.first, together = rows_together(j->model); row < rows.end;) {
        const int group = row / together, end = row + together < rows.end ? row + together : rows.end;
        lanes sum = lanes_set(0);
        for (; row < end; row++) sum = lanes_add(sum, product_row(t, &f, x.node[0], row));
        j->work->sums[group] = lanes_sum(sum);
    }
}

static double apply(const kn_model *model, const kn_state *state, const kn_work *work, double beta)
{
    const tables *t = model->tables;
    const records x = records_of(t, work);
    job j = {.model = model, .state = state, .work = work, .factor = beta};
    run(&j, direction_loop);
    run(&j, product_loop);
    double total = sum_of(work->sums, groups_of(model));
    if (model->def.pressure == KN_PRESSURE_CELLS) total += cells_product(work, t, &x);
    if (model->def.pressure == KN_PRESSURE_OBJECT) total += object_product(work, t);
    return total;
}

// --- coarse level ---------------------------------------------------------------------------------------------------

// Weights of the eight coarse nodes of a cell at the nodes of a row. Corner c is one node further along x, y, z if the
// bits 0, 1, 2 of c are set.
LANES_INLINE void corner_weights(const tables *t, int row, lanes weight[8])
{
    const real *place = t->coarse_place + (size_t)row * 4 * KN_LANES;
    const lanes one = lanes_set(1), here = lanes_load(place + 3 * KN_LANES);
    const lanes x = lanes_load(place), y = lanes_load(place + KN_LANES), z = lanes_load(place + 2 * KN_LANES);
    const lanes along[2] = {lanes_sub(here, x), x}; // 0 where there is no node
    for (int c = 0; c < 4; c++) {
        const lanes both = lanes_mul(along[c & 1], c & 2 ? y : lanes_sub(one, y));
        weight[c] = lanes_mul(both, lanes_sub(one, z));
        weight[c + 4] = lanes_mul(both, z);
    }
}

LANES_INLINE int corner_of(const tables *t, int row, int c)
{
    int node = t->coarse_cell[row];
    for (int k = 0; k < 3; k++) node += (c >> k & 1) * t->coarse_step[k];
    return 3 * node;
}

LANES_INLINE lanes free_value(const kn_work *work, const real *field, int row, int k)
{
    const size_t o = at(1, row, 3, k, 0);
    const lanes value = lanes_load(field + o);
    return work->row_held[row] ? lanes_mul(value, lanes_load((const real *)work->free + o)) : value;
}

// Sum three vectors over their lanes. As records their lanes can be added four at a time.
LANES_INLINE void sum_lanes(const lanes v[3], real sum[3])
{
    _Alignas(64) real each[RECORD * KN_LANES];
    lanes_put(each, v);
    lanes all = lanes_add(lanes_load(each), lanes_load(each + KN_LANES));
    all = lanes_add(all, lanes_add(lanes_load(each + 2 * KN_LANES), lanes_load(each + 3 * KN_LANES)));
    lanes_store(each, all);
    for (int k = 0; k < 3; k++) sum[k] = (each[k] + each[RECORD + k]) + (each[2 * RECORD + k] + each[3 * RECORD + k]);
}

// Sum the residuals of the nodes of each cell, for its eight corners.
static void restrict_loop(void *loop, int part)
{
    const job *j = loop;
    const kn_work *work = j->work;
    const tables *t = j->model->tables;
    const range cells = range_of(work, t->coarse_cells, part);
    for (int cell = cells.first; cell < cells.end; cell++) {
        real *to = (real *)work->cut + 24 * cell;
        lanes sum[8][3];
        for (int c = 0; c < 8; c++)
            for (int k = 0; k < 3; k++) sum[c][k] = lanes_set(0);
        // the rows of one cell follow one another
        for (int row = t->coarse_first[cell]; row < t->coarse_first[cell + 1]; row++) {
            lanes weight[8], r[3];
            corner_weights(t, row, weight);
            for (int k = 0; k < 3; k++) r[k] = free_value(work, work->r, row, k);
            for (int c = 0; c < 8; c++)
                for (int k = 0; k < 3; k++) sum[c][k] = lanes_fma(weight[c], r[k], sum[c][k]);
        }
        for (int c = 0; c < 8; c++) sum_lanes(sum[c], to + 3 * c);
    }
}

static void restriction(const kn_model *model, const kn_work *work)
{
    const tables *t = model->tables;
    const real *sum = work->cut;
    real *to = work->coarse;
    job j = {.model = model, .work = work};
    run(&j, restrict_loop);
    for (int cell = 0; cell < t->coarse_cells; cell++)
        for (int c = 0; c < 8; c++, sum += 3)
            for (int k = 0; k < 3; k++) to[corner_of(t, t->coarse_first[cell], c) + k] += sum[k];
}

static void prolong_loop(void *loop, int part)
{
    const job *j = loop;
    const kn_work *work = j->work;
    const tables *t = j->model->tables;
    const fields f = {.z = work->z, .free = work->free};
    const real *from = (const real *)work->coarse + j->model->coarse->padded;
    const range rows = rows_of(j, part);
    for (int row = rows.first; row < rows.end; row++) {
        lanes weight[8], v[3] = {lanes_set(0), lanes_set(0), lanes_set(0)};
        corner_weights(t, row, weight);
        for (int c = 0; c < 8; c++)
            for (int k = 0; k < 3; k++) v[k] = lanes_fma(weight[c], lanes_set(from[corner_of(t, row, c) + k]), v[k]);
        for (int k = 0; k < 3; k++) {
            const size_t o = at(1, row, 3, k, 0);
            if (work->row_held[row]) v[k] = lanes_mul(v[k], lanes_load(f.free + o));
            store_add(f.z + o, v[k]);
        }
    }
}

static void prolongation(const kn_model *model, const kn_work *work)
{
    job j = {.model = model, .work = work};
    run(&j, prolong_loop);
}

const kn_kernels KN_KERNELS(net) = KN_KERNELS_TABLE;
