// The kernels of a block. This source is compiled for three instruction sets and two precisions. kernel.h says what the
// loops do, grid.h describes the layout.
#include "core/solve/coarse.h"
#include "core/solve/kernel_nodes.h"

// Constants of a model in its precision, equal for every instruction set. The share of a node along an axis is 1/2 at
// the two ends of the block and 1 between them.
typedef struct tables {
    law_tables law;                // must be first: its arrays are then aligned to 64 bytes like the block
    real direction[KN_FORWARD][3]; // rest vector of forward edge e [m]
    real inverse[KN_FORWARD];      // factor 1/(gamma L0) from growth rate to strain rate [1/m]
    real area[KN_FORWARD];         // factor gamma kappa L0 from stress to force [m^2]
    real root;                     // factor sqrt(kappa A) from sqrt(ds/db) to sqrt(force per rate)
    // mass_dt: mass of an inner node over dt [kg/s]; weight: downward force on an inner node [N]
    real mass_dt, weight;
    // vectors: number K of vectors per row; rows: rows per plane; row_count: rows of the whole block
    int vectors, rows, row_count, planes;
    real *lane_share; // [K][16] share of a node along the row, 0 in the padding
    real *lane_mass;  // [K][16] equal to lane_share, but 1 in the padding, so no block is singular
    // [3][K][16] weights of the edges with the shifts -1, 0 and +1 along the row, as far as they depend on the place in
    // the row. For shifts -1 and +1: 1 if the edge exists, else 0. For shift 0: the node's share.
    real *lane_near[3];
    real *lane_near_root[3];
    real *lane_here[3]; // [3][K][16] 1 if the edge of this shift exists, else 0
    // row_share, plane_share: shares of a row (along b) and of a plane (along c); row_root, plane_root: their roots
    real *row_share, *row_root, *plane_share, *plane_root;
    // diagonal: stiffness of a diagonal divided by the stiffness of a side; diagonal_root: root of `diagonal`
    real diagonal, diagonal_root;
    // Gas. cell_inverse_h: 1/h; cell_push, cell_rate, cell_root: factors from the slopes of J to P0 dV/dx, to dt dJ/dt,
    // and to sqrt(dt P0/V0) dV/dx; cell_axis: scene axes of a, b, c; cell_to: distance from a cell's first row to each
    // of its four rows.
    int cell_count;
    real cell_inverse_h, cell_push, cell_rate, cell_root;
    int cell_axis[3], cell_to[4];
    // Coarse level: places of rows and planes, counted in coarse nodes; weights of the coarse nodes at every lane of a
    // row, lane_up [coarse nodes][K][16], and of every node of a row, lane_down [nodes][16]
    real *row_place, *plane_place, *lane_up, *lane_down;
} tables;

static size_t tables_size(const kn_model *model)
{
    size_t stride = kn_grid_stride(&model->grid);
    size_t reals = 11 * stride + 2 * (size_t)(model->grid.len[1] + model->grid.len[2]);
    if (model->coarse) {
        const size_t along = (size_t)model->coarse->nodes[model->grid.axis[0]];
        reals += (along + KN_LANES) * stride + (size_t)(model->grid.len[1] + model->grid.len[2]);
    }
    return (sizeof(tables) + 63) / 64 * 64 + reals * sizeof(real) + 64;
}

// Take an array of the tables from the memory behind the struct.
static real *take(real **next, size_t count)
{
    real *p = *next;
    *next += count;
    return p;
}

// Return the share of node i of n along one axis: 0.5 at the two ends, else 1. A single node has 1.
static double end_share(int i, int n) { return n > 1 && (i == 0 || i == n - 1) ? 0.5 : 1.0; }

static void build_lanes(tables *t, const kn_grid *g, real **next)
{
    size_t stride = kn_grid_stride(g);
    t->lane_share = take(next, stride);
    t->lane_mass = take(next, stride);
    for (int s = 0; s < 3; s++) {
        t->lane_near[s] = take(next, stride);
        t->lane_near_root[s] = take(next, stride);
        t->lane_here[s] = take(next, stride);
    }
    for (int k = 0; k < g->vectors; k++)
        for (int l = 0; l < KN_LANES; l++) {
            // node a of the row is in lane l of vector k; its neighbour a + 1 is in the next vector, not the next lane
            int a = l * g->vectors + k, at = k * KN_LANES + l;
            double share = a < g->len[0] ? end_share(a, g->len[0]) : 0;
            t->lane_share[at] = (real)share;
            t->lane_mass[at] = (real)(share > 0 ? share : 1);
            for (int s = 0; s < 3; s++) {
                // an edge exists if both ends are in the row
                bool here = a < g->len[0] && a + s - 1 >= 0 && a + s - 1 < g->len[0];
                double weight = !here ? 0 : s == 1 ? share : 1;
                t->lane_near[s][at] = (real)weight;
                t->lane_near_root[s][at] = (real)sqrt(weight);
                t->lane_here[s][at] = here ? 1 : 0;
            }
        }
    t->diagonal = (real)g->diagonal;
    t->diagonal_root = (real)sqrt(g->diagonal);
}

static void build_rows(tables *t, const kn_grid *g, real **next)
{
    t->row_share = take(next, (size_t)g->len[1]);
    t->row_root = take(next, (size_t)g->len[1]);
    t->plane_share = take(next, (size_t)g->len[2]);
    t->plane_root = take(next, (size_t)g->len[2]);
    for (int b = 0; b < g->len[1]; b++) {
        t->row_share[b] = (real)end_share(b, g->len[1]);
        t->row_root[b] = (real)sqrt(end_share(b, g->len[1]));
    }
    for (int c = 0; c < g->len[2]; c++) {
        t->plane_share[c] = (real)end_share(c, g->len[2]);
        t->plane_root[c] = (real)sqrt(end_share(c, g->len[2]));
    }
}

// Return the place of node i along a grid axis, counted in coarse nodes from the first one.
static double coarse_place(const kn_model *model, int axis, int i)
{
    return kn_coarse_place(model->coarse, model->grid.axis[axis], i * model->grid.spacing_m);
}

static void build_coarse_lanes(tables *t, const kn_model *model, real **next)
{
    const kn_grid *g = &model->grid;
    if (!model->coarse) return;
    const int nodes = model->coarse->nodes[g->axis[0]];
    t->lane_up = take(next, (size_t)nodes * kn_grid_stride(g));
    t->lane_down = take(next, KN_LANES * kn_grid_stride(g));
    for (int a = 0; a < g->len[0]; a++) {
        // node a of the row is in lane l of vector k
        const int k = a % g->vectors, l = a / g->vectors;
        const double place = coarse_place(model, 0, a);
        for (int i = 0; i < nodes; i++) {
            const double weight = fmax(0, 1 - fabs(place - i));
            t->lane_up[(i * g->vectors + k) * KN_LANES + l] = (real)weight;
            t->lane_down[a * KN_LANES + i] = (real)weight;
        }
    }
}

static void build_coarse_rows(tables *t, const kn_model *model, real **next)
{
    const kn_grid *g = &model->grid;
    if (!model->coarse) return;
    t->row_place = take(next, (size_t)g->len[1]);
    t->plane_place = take(next, (size_t)g->len[2]);
    for (int b = 0; b < g->len[1]; b++) t->row_place[b] = (real)coarse_place(model, 1, b);
    for (int c = 0; c < g->len[2]; c++) t->plane_place[c] = (real)coarse_place(model, 2, c);
}

static void build_cells(tables *t, const kn_model *model); // kernel_cells.h

static void tables_build(const kn_model *model, void *block)
{
    const kn_grid *g = &model->grid;
    const kn_solver_def *solver = &model->def.solver;
    tables *t = block;
    real *next = (real *)((char *)block + (sizeof(tables) + 63) / 64 * 64);
    law_tables_build(&t->law, model);
    build_lanes(t, g, &next);
    build_coarse_lanes(t, model, &next);
    build_rows(t, g, &next);
    build_coarse_rows(t, model, &next);
    // for each forward edge: rest vector, factor to strain rate, factor to force
    for (int e = 0; e < KN_FORWARD; e++) {
        const int *step = kn_grid_forward[e];
        double length = g->spacing_m * sqrt((double)(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]));
        for (int k = 0; k < 3; k++) t->direction[e][g->axis[k]] = (real)(g->spacing_m * step[k]);
        t->inverse[e] = (real)(1.0 / (g->gamma * length));
        t->area[e] = (real)(g->gamma * g->kappa_m * length);
    }
    t->root = (real)sqrt(g->kappa_m * model->law.a_pa_s);
    double mass = model->def.density_kg_m3 * g->spacing_m * g->spacing_m * g->depth_m;
    t->mass_dt = (real)(mass * solver->mass_scale / solver->dt_s);
    t->weight = (real)(mass * model->def.gravity_m_s2);
    t->vectors = g->vectors;
    t->rows = g->len[1];
    t->row_count = g->rows;
    t->planes = g->len[2];
    build_cells(t, model);
}

// --- addressing -----------------------------------------------------------------------------------------------------

// Load component c of the neighbours of the nodes in vector k of a row. s = -1, 0 or +1: shift along the row.
LANES_INLINE lanes near(int K, const real *field, int row, int c, int k, int s)
{
    int to = k + s;
    if (to >= 0 && to < K) return lanes_load(field + at(K, row, 3, c, to));
    // the first vector, rotated by one lane, holds the neighbours of the last vector; the last vector, rotated the
    // other way, holds those of the first vector
    if (s > 0) return lanes_next(lanes_load(field + at(K, row, 3, c, 0)));
    return lanes_prev(lanes_load(field + at(K, row, 3, c, K - 1)));
}

// near_vector returns the index of the vector that holds the neighbours of the nodes in vector k. `turn` rotates values
// of vector k by lanes so that they can be added to this vector.
LANES_INLINE int near_vector(int K, int k, int s)
{
    int to = k + s;
    return to < 0 ? K - 1 : to < K ? to : 0;
}
LANES_INLINE lanes turn(int K, lanes a, int k, int s)
{
    int to = k + s;
    if (to >= 0 && to < K) return a;
    return s > 0 ? lanes_prev(a) : lanes_next(a);
}

// Return the row to which the forward edges of group g lead, or -1 if there is none; see the drawing in grid.h. Group
// -1 is the row itself.
LANES_INLINE int group_row(const tables *t, int row, int b, int c, int g)
{
    switch (g) {
    case -1: return row;
    case 0: return b + 1 < t->rows ? row + 1 : -1;
    case 1: return c + 1 < t->planes && b > 0 ? row + t->rows - 1 : -1;
    case 2: return c + 1 < t->planes ? row + t->rows : -1;
    default: return c + 1 < t->planes && b + 1 < t->rows ? row + t->rows + 1 : -1;
    }
}

// Return the part of an edge's weight that depends on row and plane, or its root if roots are passed. g: group of the
// edge, s: shift. In groups 0 and 2 (see grid.h) the edge with shift 0 is a side. All other edges of the groups 0 to 3
// are diagonals.
LANES_INLINE real group_share(real row, real plane, real diagonal, int g, int s)
{
    switch (g) {
    case -1: return row * plane;
    case 0: return s == 0 ? plane : plane * diagonal;
    case 2: return s == 0 ? row : row * diagonal;
    default: return diagonal;
    }
}

// In f64, the vectors g of the edges would be more than half of the bytes that a product moves, and would not fit the
// cache. So f64 stores only (root/length)^2 of an edge, and each product computes the edge's direction again from the
// displacements. Measured: a product takes 5 us longer at 2 560 nodes, and 25 us less at 5 733.
enum { LEAN = sizeof(real) == sizeof(double) };

// --- the edge pass --------------------------------------------------------------------------------------------------

// Sixteen edges: they lead from the nodes of vector k of a row to the nodes of row `to` that are shifted by s along the
// row.
typedef struct edges {
    // row, to: first and second row; k: vector; s: shift; e: index of the forward edge
    int row, to, k, s, e;
    bool moved; // a prescribed velocity has changed in one of the two rows
    // where to store g, and the row `to` of r and P; `aside` for a row of the other part
    real *g, *r, *p;
    // share: part of the edges' weight that depends on row and plane; root: root of `share`
    real share, root;
} edges;

// Compute the unit vectors of sixteen edges, their stress at the solver's guess, and the root of the law's slope there.
// Unless `again`, also advance the strains.
LANES_INLINE void edge_law(const kn_model *model, const tables *t, const fields *f, const edges *x, kn_law_kind kind,
                           bool stroke, kn_linearization how, bool again, bars *x16, lanes *stress, lanes *root)
{
    // differences between far end and near end: rest position, displacement, velocity
    x16->scale = lanes_set(t->inverse[x->e]);
    for (int c = 0; c < 3; c++) {
        x16->rest[c] = lanes_set(t->direction[x->e][c]);
        x16->shift[c] =
            lanes_sub(near(f->K, f->x, x->to, c, x->k, x->s), lanes_load(f->x + at(f->K, x->row, 3, c, x->k)));
        x16->dv[c] = lanes_sub(near(f->K, f->v, x->to, c, x->k, x->s), lanes_load(f->v + at(f->K, x->row, 3, c, x->k)));
    }
    bars_direct(&t->law, x16);
    lanes wanted = x16->rate;
    // if the guessed velocity differs from the last velocity, compute the edges' growth rate from the guess
    if (x->moved || again) {
        lanes dg[3];
        for (int c = 0; c < 3; c++)
            dg[c] = lanes_sub(near(f->K, f->guess, x->to, c, x->k, x->s),
                              lanes_load(f->guess + at(f->K, x->row, 3, c, x->k)));
        wanted = dot(x16->n, dg);
    }
    real *strain = kind == KN_LAW_VOIGT ? NULL : f->u + at(f->K, x->row, KN_FORWARD, x->e, x->k);
    bars_law(model, &t->law, x16, kind, stroke, how, wanted, x->moved || again, again,
             t->lane_here[x->s + 1] + (size_t)x->k * KN_LANES, strain, stress, root);
}

// Sums at the near ends of the edges of a row, kept in registers until all edges of the row are done.
typedef struct sums {
    lanes pull[3], block[6];
} sums;

// Linearise sixteen edges. Add their forces to the residual and their stiffness to the diagonal blocks of both ends,
// and store the vectors g for the matrix products.
LANES_INLINE void edge_add(const kn_model *model, const tables *t, const fields *f, const edges *x, kn_law_kind kind,
                           bool stroke, kn_linearization how, bool again, sums *own)
{
    bars x16;
    lanes stress, root;
    edge_law(model, t, f, x, kind, stroke, how, again, &x16, &stress, &root);
    // multiply by the weights of the edges; the weight is 0 if an edge does not exist
    size_t lane = (size_t)x->k * KN_LANES;
    lanes tension =
        lanes_mul(stress, lanes_mul(lanes_set(t->area[x->e] * x->share), lanes_load(t->lane_near[x->s + 1] + lane)));
    root = lanes_mul(root, lanes_mul(lanes_set(t->root * x->root), lanes_load(t->lane_near_root[x->s + 1] + lane)));
    int to = near_vector(f->K, x->k, x->s);
    lanes g[3], far[3], over = lanes_mul(root, x16.inverse);
    if (LEAN) lanes_store(x->g + at(f->K, 0, KN_FORWARD, x->e, x->k), lanes_mul(over, over));
    // add the force at the near end, whose sums are in registers, and subtract it at the far end, in memory
    for (int c = 0; c < 3; c++) {
        g[c] = lanes_mul(root, x16.n[c]);
        if (!LEAN) lanes_store(x->g + at(f->K, 0, 3 * KN_FORWARD, 3 * x->e + c, x->k), g[c]);
        far[c] = turn(f->K, g[c], x->k, x->s);
        lanes pull = lanes_mul(tension, x16.n[c]);
        own->pull[c] = lanes_add(own->pull[c], pull);
        real *other = x->r + at(f->K, 0, 3, c, to);
        lanes_store(other, lanes_sub(lanes_load(other), turn(f->K, pull, x->k, x->s)));
    }
    // diagonal blocks: g g' at both ends
    for (int c = 0, m = 0; c < 3; c++)
        for (int k = c; k < 3; k++, m++) {
            real *other = x->p + at(f->K, 0, 6, m, to);
            own->block[m] = lanes_fma(g[c], g[k], own->block[m]);
            lanes_store(other, lanes_fma(far[c], far[k], lanes_load(other)));
        }
}

LANES_INLINE lanes mass_of(const tables *t, int b, int c, int k)
{
    return lanes_mul(lanes_set(t->mass_dt * t->row_share[b] * t->plane_share[c]),
                     lanes_load(t->lane_mass + (size_t)k * KN_LANES));
}

// Finish vector k of a row after all of its edges have been added. Return r.z for each lane.
LANES_INLINE lanes finish_row(const tables *t, const fields *f, const kn_work *work, int row, int b, int c, int k,
                              bool again)
{
    lanes weight = lanes_mul(lanes_set(t->weight * t->row_share[b] * t->plane_share[c]),
                             lanes_load(t->lane_share + (size_t)k * KN_LANES));
    return finish_nodes(f, work, row, k, mass_of(t, b, c, k), weight, again);
}

// Add all forward edges of the nodes in vector k of a row.
LANES_INLINE void edge_row(const kn_model *model, const tables *t, const fields *f, const kn_work *work, int row, int b,
                           int c, int k, kn_law_kind kind, bool stroke, kn_linearization how, bool again)
{
    sums own;
    for (int i = 0; i < 3; i++) own.pull[i] = lanes_set(0);
    for (int i = 0; i < 6; i++) own.block[i] = lanes_set(0);
    // visit the rows to which forward edges lead: one edge leads to the row itself, three edges to each other row
    for (int g = -1; g < 4; g++) {
        int to = group_row(t, row, b, c, g);
        if (to < 0) continue;
        edges x = {.row = row, .to = to, .k = k, .moved = work->row_moved[row] || work->row_moved[to]};
        const bool mine = is_mine(f, to);
        if (row < f->first && !mine) continue;
        x.g = row < f->first ? f->aside : f->g + at(f->K, row, LEAN ? KN_FORWARD : 3 * KN_FORWARD, 0, 0);
        x.r = mine ? f->r + at(f->K, to, 3, 0, 0) : f->aside;
        x.p = mine ? f->p + at(f->K, to, 6, 0, 0) : f->aside;
        UNROLL(3)
        for (x.s = g < 0 ? 1 : -1; x.s <= 1; x.s++) {
            x.e = g < 0 ? 0 : 1 + 3 * g + x.s + 1;
            x.share = group_share(t->row_share[b], t->plane_share[c], t->diagonal, g, x.s);
            x.root = group_share(t->row_root[b], t->plane_root[c], t->diagonal_root, g, x.s);
            edge_add(model, t, f, &x, kind, stroke, how, again, &own);
        }
    }
    if (row < f->first) return;
    for (int i = 0; i < 3; i++) store_add(f->r + at(f->K, row, 3, i, k), own.pull[i]);
    for (int i = 0; i < 6; i++) store_add(f->p + at(f->K, row, 6, i, k), own.block[i]);
}

// The planes of a part: `first` to `end`. Edges lead from the plane before `first` into the part. So the part also
// computes the edges of that plane, and begins at the plane `from`; it writes to its own rows only.
//
//     planes    . . . o | . . . .       o: both parts compute the edges of this plane
//               part 0  |  part 1
typedef struct slab {
    int from, first, end;
} slab;

LANES_INLINE slab slab_of(const tables *t, const kn_work *work, int part, fields *f)
{
    const range planes = range_of(work, t->planes, part);
    f->first = planes.first * t->rows, f->end = planes.end * t->rows;
    f->aside = (real *)work->cut + at(f->K, t->rows + 3 * part, KN_FORWARD, 0, 0);
    const bool before = planes.first > 0 && planes.first < planes.end;
    return (slab){planes.first - before, planes.first, planes.end};
}

// Run the edge pass over the planes of a part. All edges that end in a row start in this row or in an earlier row. So a
// row is complete after its own edges. Sum r.z plane by plane.
LANES_INLINE void edge_pass(const job *j, int part, kn_law_kind kind, bool stroke, bool again, int K)
{
    const tables *t = j->model->tables;
    const kn_work *work = j->work;
    fields f = fields_of(j->state, work, K);
    const slab s = slab_of(t, work, part, &f);
    for (int c = s.from, row = c * t->rows; c < s.end; c++) {
        // the strains of the plane before are advanced by the part before
        if (f.u && !again) f.u = c < s.first ? (real *)work->cut - at(K, row, KN_FORWARD, 0, 0) : j->state->strain;
        lanes plane = lanes_set(0);
        for (int b = 0; b < t->rows; b++, row++) {
            for (int k = 0; k < f.K; k++) edge_row(j->model, t, &f, work, row, b, c, k, kind, stroke, j->how, again);
            for (int k = 0; k < f.K && c >= s.first; k++)
                plane = lanes_add(plane, finish_row(t, &f, work, row, b, c, k, again));
        }
        if (c >= s.first) work->sums[c] = lanes_sum(plane);
    }
}

#include "core/solve/kernel_cells.h"

// Define one loop for each kind of law. gcc -O3 takes twice as long to compile a single function with all kinds.
#define EDGE_PASS(name, kind, stroke, again, K)                                                                        \
    static void edge_##name(void *loop, int part)                                                                      \
    {                                                                                                                  \
        const job *j = loop;                                                                                           \
        if (j->model->def.pressure == KN_PRESSURE_CELLS) cells_loop(j, part, false);                                   \
        edge_pass(j, part, kind, stroke, again, K);                                                                    \
    }
EDGE_PASS(stroke, ((const tables *)j->model->tables)->law.kind, true, j->again, j->model->grid.vectors)
EDGE_PASS(voigt, KN_LAW_VOIGT, false, j->again, j->model->grid.vectors)
EDGE_PASS(linear, KN_LAW_LINEAR, false, j->again, j->model->grid.vectors)
EDGE_PASS(table_1, KN_LAW_TABLE, false, false, 1)
EDGE_PASS(table_2, KN_LAW_TABLE, false, false, 2)
EDGE_PASS(table, KN_LAW_TABLE, false, j->again, j->model->grid.vectors)
EDGE_PASS(exact, KN_LAW_EXACT, false, j->again, j->model->grid.vectors)

static double edge(const kn_model *model, kn_state *state, const kn_work *work, kn_linearization how, bool again)
{
    const tables *t = model->tables;
    job j = {model, state, work, how, again, again, 0};
    const int K = model->grid.vectors, one = again ? 0 : K;
    if (model->def.pressure == KN_PRESSURE_OBJECT) object_add(model, state, work);
    if (work->team && state->strain && !again) { // copy the strains of the plane below the cut
        const size_t plane = at(K, t->rows, KN_FORWARD, 0, 0), end = (size_t)range_of(work, t->planes, 0).end;
        memcpy(work->cut, (const real *)state->strain + (end - 1) * plane, plane * sizeof(real));
    }
    // each law without stops has a loop of its own; laws with stops share one
    if (model->law.stroke) run(&j, edge_stroke);
    else if (t->law.kind == KN_LAW_VOIGT) run(&j, edge_voigt);
    else if (t->law.kind == KN_LAW_LINEAR) run(&j, edge_linear);
    else if (t->law.kind == KN_LAW_TABLE) run(&j, one == 1 ? edge_table_1 : one == 2 ? edge_table_2 : edge_table);
    else run(&j, edge_exact);
    return sum_of(work->sums, t->planes);
}

// --- conjugate gradients --------------------------------------------------------------------------------------------

// Values at the near ends of the edges of a row: displacement x (f64 only), search direction d, product q.
typedef struct products {
    lanes x[3], d[3], q[3];
} products;

// Add the product of sixteen edges, g (g . gap), to q at their near ends, and subtract it from `far` at their far ends.
// `gap` is the difference of the search direction d between the near end and the far end.
LANES_INLINE void product_edges(const tables *t, const fields *f, int row, int to, int k, int s, int e, products *own,
                                lanes far[3])
{
    lanes g[3], gap[3];
    for (int c = 0; c < 3; c++) {
        // f64 computes the edge's vector from the displacements; f32 loads g
        if (LEAN) g[c] = lanes_add(lanes_set(t->direction[e][c]), lanes_sub(near(f->K, f->x, to, c, k, s), own->x[c]));
        else g[c] = lanes_load(f->g + at(f->K, row, 3 * KN_FORWARD, 3 * e + c, k));
        gap[c] = lanes_sub(own->d[c], near(f->K, f->d, to, c, k, s));
    }
    lanes force = dot(g, gap);
    if (LEAN) force = lanes_mul(force, lanes_load(f->g + at(f->K, row, KN_FORWARD, e, k)));
    for (int c = 0; c < 3; c++) {
        lanes push = lanes_mul(g[c], force);
        own->q[c] = lanes_add(own->q[c], push);
        far[c] = lanes_sub(far[c], turn(f->K, push, k, s));
    }
}

// Return a row of q, or `aside` for a row of the other part.
LANES_INLINE real *row_q(const fields *f, int row) { return row < f->end ? f->q + at(f->K, row, 3, 0, 0) : f->aside; }

// Load or store the three components of vector k of a row of q.
LANES_INLINE void load_q(int K, const real *row, int k, lanes q[3])
{
    for (int c = 0; c < 3; c++) q[c] = lanes_load(row + at(K, 0, 3, c, k));
}
LANES_INLINE void store_q(int K, real *row, int k, const lanes q[3])
{
    for (int c = 0; c < 3; c++) lanes_store(row + at(K, 0, 3, c, k), q[c]);
}

LANES_INLINE void load_own(const fields *f, int row, int k, products *own)
{
    for (int c = 0; c < 3; c++) {
        if (LEAN) own->x[c] = lanes_load(f->x + at(f->K, row, 3, c, k));
        own->d[c] = lanes_load(f->d + at(f->K, row, 3, c, k));
        own->q[c] = lanes_set(0);
    }
}

// Add the products of the forward edge within a row, from vector k.
LANES_INLINE void product_along(const tables *t, const fields *f, int row, int k, products *own)
{
    lanes next[3];
    if (row < f->first) return;
    load_q(f->K, row_q(f, row), near_vector(f->K, k, 1), next);
    product_edges(t, f, row, row, k, 1, 0, own, next);
    store_q(f->K, row_q(f, row), near_vector(f->K, k, 1), next);
}

// Add the products of all forward edges of vector k of a row: first the edge within the row, then three edges to each
// of four other rows. With one vector per row, the sums at the far ends stay in registers.
LANES_INLINE void product_one(const tables *t, const fields *f, int row, int b, int c, int k)
{
    products own;
    load_own(f, row, k, &own);
    product_along(t, f, row, k, &own);
    for (int g = 0; g < 4; g++) {
        const int to = group_row(t, row, b, c, g);
        lanes far[3];
        if (to < 0 || (row < f->first && to < f->first)) continue;
        real *q = row_q(f, to);
        load_q(f->K, q, near_vector(f->K, k, -1), far);
        UNROLL(3)
        for (int s = -1; s <= 1; s++) {
            if (f->K > 1 && s > -1) load_q(f->K, q, near_vector(f->K, k, s), far);
            product_edges(t, f, row, to, k, s, 1 + 3 * g + s + 1, &own, far);
            if (f->K > 1 || s == 1) store_q(f->K, q, near_vector(f->K, k, s), far);
        }
    }
    for (int i = 0; i < 3 && row >= f->first; i++) store_add(f->q + at(f->K, row, 3, i, k), own.q[i]);
}

// Do the work of product_one for both vectors of a row, with all sums at the far ends in registers.
LANES_INLINE void product_two(const tables *t, const fields *f, int row, int b, int c)
{
    products own[2];
    for (int k = 0; k < 2; k++) {
        load_own(f, row, k, &own[k]);
        product_along(t, f, row, k, &own[k]);
    }
    for (int g = 0; g < 4; g++) {
        const int to = group_row(t, row, b, c, g);
        lanes far[2][3];
        if (to < 0 || (row < f->first && to < f->first)) continue;
        real *q = row_q(f, to);
        for (int k = 0; k < 2; k++) load_q(2, q, k, far[k]);
        UNROLL(2)
        for (int k = 0; k < 2; k++) {
            UNROLL(3)
            for (int s = -1; s <= 1; s++)
                product_edges(t, f, row, to, k, s, 1 + 3 * g + s + 1, &own[k], far[near_vector(2, k, s)]);
        }
        for (int k = 0; k < 2; k++) store_q(2, q, k, far[k]);
    }
    for (int k = 0; k < 2 && row >= f->first; k++)
        for (int i = 0; i < 3; i++) store_add(f->q + at(2, row, 3, i, k), own[k].q[i]);
}

static void direction_loop(void *loop, int part)
{
    const job *j = loop;
    const tables *t = j->model->tables;
    fields f = fields_of(j->state, j->work, t->vectors);
    slab_of(t, j->work, part, &f);
    for (int row = f.first; row < f.end; row++) next_direction(&f, row, (real)j->factor);
}

// Compute the new search direction d = z + beta d and the product q = A d of edges and mass. Sum d.q.
LANES_INLINE void apply_rows(const job *j, int part, int K)
{
    const tables *t = j->model->tables;
    const kn_work *work = j->work;
    fields f = fields_of(j->state, work, K);
    const slab s = slab_of(t, work, part, &f);
    const real beta = (real)j->factor;
    // ready: number of rows with the new direction d; the products need d one plane and one row ahead
    int ready = work->team ? t->row_count : 0;
    for (int c = s.from, row = c * t->rows; c < s.end; c++) {
        lanes plane = lanes_set(0);
        for (int b = 0; b < t->rows; b++, row++) {
            for (; ready < t->row_count && ready <= row + t->rows + 1; ready++) next_direction(&f, ready, beta);
            if (f.K == 2) product_two(t, &f, row, b, c);
            for (int k = 0; k < f.K && f.K != 2; k++) product_one(t, &f, row, b, c, k);
            // add the product of the mass; the products of all edges that end in this row have been added
            for (int k = 0; k < f.K && c >= s.first; k++) {
                lanes mass = mass_of(t, b, c, k);
                for (int i = 0; i < 3; i++) {
                    size_t o = at(f.K, row, 3, i, k);
                    lanes d = lanes_load(f.d + o), q = lanes_fma(mass, d, lanes_load(f.q + o));
                    lanes_store(f.q + o, q);
                    plane = lanes_fma(d, q, plane);
                }
            }
        }
        if (c >= s.first) work->sums[c] = lanes_sum(plane);
    }
}

static __attribute__((noinline)) void apply_1(const job *j, int part) { apply_rows(j, part, 1); }
static __attribute__((noinline)) void apply_2(const job *j, int part) { apply_rows(j, part, 2); }

static void apply_loop(void *loop, int part)
{
    const job *j = loop;
    const int K = j->model->grid.vectors;
    if (K == 1) apply_1(j, part);
    else if (K == 2) apply_2(j, part);
    else apply_rows(j, part, K);
    if (j->model->def.pressure == KN_PRESSURE_CELLS) cells_loop(j, part, true);
}

static double apply(const kn_model *model, const kn_state *state, const kn_work *work, double beta)
{
    job j = {.model = model, .state = state, .work = work, .factor = beta};
    const int planes = ((const tables *)model->tables)->planes;
    if (work->team) run(&j, direction_loop);
    run(&j, apply_loop);
    const double dq = sum_of(work->sums, planes);
    if (model->def.pressure == KN_PRESSURE_CELLS) return dq + sum_of(work->sums + planes, planes);
    return model->def.pressure == KN_PRESSURE_OBJECT ? dq + object_product(model, work) : dq;
}

#include "core/solve/kernel_coarse.h"

const kn_kernels KN_KERNELS(grid) = KN_KERNELS_TABLE;
