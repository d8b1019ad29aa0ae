// Gas pressure in the cells of a block, sixteen cells at a time. This file is a part of kernel_grid.c, which includes
// it. core/cell.h has the equations.
//
// A cell is named after its lowest node. It lies between the nodes a and a+1 of four rows (two in a flat object). The
// lanes of a row of cells are those of its first row of nodes. The corners at a+1 are in the next vector, or one lane
// rotation away, as the far ends of edges are.
//
//     c ^   to[2] . . . to[3]         corners 2r (a) and 2r + 1 (a+1) on row to[r], i.e. da + 2 db + 4 dc
//       |     .   cell   .            flat: rows to[0] and to[1]
//       |   to[0] . . . to[1]
//       +------------------> b
//
// All lengths are in spacings. All coordinates are in the order of the grid axes a, b, c, which count as right-handed,
// whatever the scene axes are. At rest every number is a small whole number, J is exactly 1, and the gas exerts no
// force.

typedef struct cells {
    lanes slope[8][3]; // derivative of J with respect to each corner's position, times 36 (flat cells: times 2)
    lanes j;           // J = V/V0, volume relative to the volume at rest
} cells;

// Store in to[] the rows of nodes that hold the corners of one row of cells. The first of them is row b of plane c.
// Return false if no cells begin at this row, because it is at the end of the block.
LANES_INLINE bool cell_rows(const tables *t, int row, int b, int c, int to[4])
{
    for (int r = 0; r < 4; r++) to[r] = row + t->cell_to[r];
    return (t->rows == 1 || b + 1 < t->rows) && (t->planes == 1 || c + 1 < t->planes);
}

// Load a component of a field for sixteen cells at their near (`end` = 0) or far (`end` = 1) corners along the row.
LANES_INLINE lanes cell_end(int K, const real *field, int row, int component, int k, int end)
{
    return end ? near(K, field, row, component, k, 1) : lanes_load(field + at(K, row, 3, component, k));
}

// Add values to the near (own) and far corners along a row, for sixteen cells. With one vector per row, both are in one
// vector, so one store is enough.
LANES_INLINE void add_ends(int K, real *field, int row, int C, int component, int k, lanes own, lanes far)
{
    if (K == 1) {
        store_add(field + at(1, row, C, component, 0), lanes_add(own, turn(1, far, 0, 1)));
    } else {
        store_add(field + at(K, row, C, component, k), own);
        store_add(field + at(K, row, C, component, near_vector(K, k, 1)), turn(K, far, k, 1));
    }
}

LANES_INLINE lanes twice_and(lanes a, lanes b) { return lanes_fma(lanes_set(2), a, b); }

// Add the cross product a x b to `sum`, or subtract it if `plus` is false.
LANES_INLINE void add_cross(lanes sum[3], bool plus, const lanes a[3], const lanes b[3])
{
    UNROLL(3)
    for (int i = 0; i < 3; i++) {
        const int u = (i + 1) % 3, v = (i + 2) % 3;
        lanes first = lanes_mul(a[u], b[v]), cross = lanes_fnma(a[v], b[u], first);
        sum[i] = plus ? lanes_add(sum[i], cross) : lanes_sub(sum[i], cross);
    }
}

// Add the contribution of a bilinear face p0 p1 p2 p3 to the slopes of its corners; u x v points along `axis`. At p0 it
// is
//     integral (1-u)(1-v) x_u cross x_v = (2 A + B) x (2 C + D)/36     A = p1-p0  B = p2-p3  C = p3-p0  D = p2-p1
LANES_INLINE void add_face(lanes slope[8][3], lanes corner[8][3], int axis, int end)
{
    const int u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3, p0 = end << axis, p1 = p0 | u, p3 = p0 | v, p2 = p1 | v;
    lanes low[3], high[3], left[3], right[3];
    UNROLL(3)
    for (int i = 0; i < 3; i++) {
        lanes a = lanes_sub(corner[p1][i], corner[p0][i]), b = lanes_sub(corner[p2][i], corner[p3][i]);
        lanes c = lanes_sub(corner[p3][i], corner[p0][i]), d = lanes_sub(corner[p2][i], corner[p1][i]);
        low[i] = twice_and(a, b);
        high[i] = twice_and(b, a);
        left[i] = twice_and(c, d);
        right[i] = twice_and(d, c);
    }
    add_cross(slope[p0], end, low, left);
    add_cross(slope[p1], end, low, right);
    add_cross(slope[p2], end, high, right);
    add_cross(slope[p3], end, high, left);
}

// Compute J = V/V0 of solid cells and its derivatives (slopes) from the positions of their corners.
LANES_INLINE void block_shape(cells *x, lanes corner[8][3])
{
    for (int i = 0; i < 8; i++)
        for (int c = 0; c < 3; c++) x->slope[i][c] = lanes_set(0);
    UNROLL(3)
    for (int axis = 0; axis < 3; axis++) {
        add_face(x->slope, corner, axis, 0);
        add_face(x->slope, corner, axis, 1);
    }
    // V is linear in all coordinates along axis a, so J follows from these coordinates and their slopes
    lanes sum = lanes_mul(corner[1][0], x->slope[1][0]);
    for (int i = 2; i < 8; i++) sum = lanes_fma(corner[i][0], x->slope[i][0], sum);
    x->j = lanes_fma(lanes_sub(sum, lanes_set(36)), lanes_set((real)(1.0 / 36)), lanes_set(1));
}

// Compute slopes and J of flat cells: V is half the cross product of the diagonals 0-3 and 1-2.
LANES_INLINE void flat_shape(cells *x, lanes corner[8][3])
{
    const lanes *d1 = corner[3], d2[2] = {lanes_sub(corner[2][0], corner[1][0]), lanes_sub(corner[2][1], corner[1][1])};
    const lanes zero = lanes_set(0);
    x->slope[3][0] = d2[1];
    x->slope[3][1] = lanes_sub(zero, d2[0]);
    x->slope[0][0] = x->slope[3][1];
    x->slope[2][0] = lanes_sub(zero, d1[1]);
    x->slope[2][1] = d1[0];
    for (int i = 0; i < 2; i++) {
        x->slope[0][i] = lanes_sub(zero, x->slope[3][i]);
        x->slope[1][i] = lanes_sub(zero, x->slope[2][i]);
    }
    lanes cross = lanes_fnma(d1[1], d2[0], lanes_mul(d1[0], d2[1]));
    x->j = lanes_fma(lanes_sub(cross, lanes_set(2)), lanes_set((real)0.5), lanes_set(1));
}

LANES_INLINE void cell_shape(const tables *t, const fields *f, const int to[4], int k, bool flat, cells *x)
{
    const int dims = flat ? 2 : 3;
    lanes corner[8][3], inverse = lanes_set(t->cell_inverse_h);
    // positions of the corners relative to the first corner, in spacings
    for (int c = 0; c < dims; c++) {
        lanes first = lanes_load(f->x + at(f->K, to[0], 3, t->cell_axis[c], k));
        corner[0][c] = lanes_set(0);
        for (int i = 1; i < 1 << dims; i++) {
            lanes moved = lanes_sub(cell_end(f->K, f->x, to[i >> 1], t->cell_axis[c], k, i & 1), first);
            corner[i][c] = lanes_fma(moved, inverse, lanes_set((real)(i >> c & 1)));
        }
    }
    if (flat) flat_shape(x, corner);
    else block_shape(x, corner);
}

// Index of a pair of axes in a diagonal block, which is stored as xx xy xz yy yz zz.
static const int pair_of[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

// Add the gas forces at the end of the step to the residual of the corners of sixteen cells. Add the slope of the
// pressure to the corners' diagonal blocks, and store the vectors g for the matrix products.
LANES_INLINE void cell_add(const tables *t, const fields *f, real *kept, int row, const int to[4], int k, bool flat)
{
    const int dims = flat ? 2 : 3;
    cells x;
    cell_shape(t, f, to, k, flat, &x);
    // rate: dJ/dt at the guessed velocities
    lanes rate = lanes_set(0);
    for (int i = 0; i < 1 << dims; i++)
        for (int c = 0; c < dims; c++)
            rate = lanes_fma(x.slope[i][c], cell_end(f->K, f->guess, to[i >> 1], t->cell_axis[c], k, i & 1), rate);
    const lanes one = lanes_set(1), here = lanes_load(t->lane_here[2] + (size_t)k * KN_LANES);
    lanes m = lanes_max(x.j, lanes_set((real)KN_CELL_LEAST)), i1 = lanes_div(one, m);
    // over = (P - P0)/P0 at the end of the step, see cell.h
    lanes over = lanes_mul(i1, lanes_fma(lanes_sub(m, x.j), i1, lanes_sub(one, m)));
    over = lanes_fnma(lanes_mul(lanes_set(t->cell_rate), rate), lanes_mul(i1, i1), over);
    lanes push = lanes_mul(lanes_mul(lanes_set(t->cell_push), here), over);
    lanes root = lanes_mul(lanes_mul(lanes_set(t->cell_root), here), i1);
    // for each row of corners: add the forces and the diagonal blocks, and store g
    for (int r = 0; r < 1 << (dims - 1); r++) {
        lanes g[2][3];
        const bool mine = is_mine(f, to[r]);
        for (int c = 0; c < dims; c++) {
            for (int end = 0; end < 2; end++) {
                g[end][c] = lanes_mul(root, x.slope[2 * r + end][c]);
                if (row >= f->first)
                    lanes_store(kept + at(f->K, row, dims << dims, (2 * r + end) * dims + c, k), g[end][c]);
            }
            if (!mine) continue;
            add_ends(f->K, f->r, to[r], 3, t->cell_axis[c], k, lanes_mul(push, x.slope[2 * r][c]),
                     lanes_mul(push, x.slope[2 * r + 1][c]));
        }
        for (int c = 0; c < dims && mine; c++)
            for (int e = c; e < dims; e++)
                add_ends(f->K, f->p, to[r], 6, pair_of[t->cell_axis[c]][t->cell_axis[e]], k,
                         lanes_mul(g[0][c], g[0][e]), lanes_mul(g[1][c], g[1][e]));
    }
}

// Add g (g.d) of sixteen cells to q, where g is the vector of each cell and d the search direction. Return (g.d)^2 for
// each lane.
LANES_INLINE lanes cell_product(const tables *t, const fields *f, const real *kept, int row, const int to[4], int k,
                                bool flat)
{
    const int dims = flat ? 2 : 3;
    const real *g = kept + at(f->K, row, dims << dims, 0, k);
    const size_t step = at(f->K, 0, 1, 0, f->K);
    lanes rate = lanes_set(0);
    for (int i = 0; i < 1 << dims; i++)
        for (int c = 0; c < dims; c++)
            rate = lanes_fma(lanes_load(g + step * (size_t)(i * dims + c)),
                             cell_end(f->K, f->d, to[i >> 1], t->cell_axis[c], k, i & 1), rate);
    for (int r = 0; r < 1 << (dims - 1); r++)
        for (int c = 0; c < dims && is_mine(f, to[r]); c++)
            add_ends(f->K, f->q, to[r], 3, t->cell_axis[c], k,
                     lanes_mul(lanes_load(g + step * (size_t)(2 * r * dims + c)), rate),
                     lanes_mul(lanes_load(g + step * (size_t)((2 * r + 1) * dims + c)), rate));
    return lanes_mul(rate, rate);
}

// Visit the cells of a part in memory order. If `product`, call cell_product and sum (g.d)^2; else call cell_add.
LANES_INLINE void cells_pass(const job *j, int part, int K, bool flat, bool product)
{
    const tables *t = j->model->tables;
    real *kept = j->work->cell;
    fields f = fields_of(j->state, j->work, K);
    const slab s = slab_of(t, j->work, part, &f);
    for (int c = s.from, row = c * t->rows; c < s.end; c++) {
        lanes plane = lanes_set(0);
        for (int b = 0; b < t->rows; b++, row++) {
            int to[4];
            if (!cell_rows(t, row, b, c, to)) continue;
            for (int k = 0; k < f.K; k++) {
                if (product) plane = lanes_add(plane, cell_product(t, &f, kept, row, to, k, flat));
                else cell_add(t, &f, kept, row, to, k, flat);
            }
        }
        if (product && c >= s.first) j->work->sums[t->planes + c] = lanes_sum(plane);
    }
}

static __attribute__((noinline)) void cells_loop(const job *j, int part, bool product)
{
    const int K = j->model->grid.vectors;
    if (j->model->grid.flat && product) cells_pass(j, part, K, true, true);
    else if (j->model->grid.flat) cells_pass(j, part, K, true, false);
    else if (K == 1 && product) cells_pass(j, part, 1, false, true);
    else if (K == 1) cells_pass(j, part, 1, false, false);
    else if (product) cells_pass(j, part, K, false, true);
    else cells_pass(j, part, K, false, false);
}

// --- one pressure for the whole object ------------------------------------------------------------------------------

// Sum dV/dx of every node over its cells into `kept`. Return the sum of J over all cells.
static double object_shape(const kn_model *model, const kn_state *state, const kn_work *work)
{
    const tables *t = model->tables;
    const bool flat = model->grid.flat;
    const int dims = flat ? 2 : 3;
    real *kept = work->cell;
    fields f = fields_of(state, work, model->grid.vectors);
    double sum = 0;
    memset(kept, 0, kn_model_field(model, 3) * sizeof(real));
    for (int c = 0, row = 0; c < t->planes; c++) {
        lanes plane = lanes_set(0);
        for (int b = 0; b < t->rows; b++, row++) {
            int to[4];
            if (!cell_rows(t, row, b, c, to)) continue;
            for (int k = 0; k < f.K; k++) {
                cells x;
                cell_shape(t, &f, to, k, flat, &x);
                lanes here = lanes_load(t->lane_here[2] + (size_t)k * KN_LANES);
                plane = lanes_fma(here, x.j, plane);
                for (int i = 0; i < 1 << dims; i += 2)
                    for (int e = 0; e < dims; e++)
                        add_ends(f.K, kept, to[i >> 1], 3, t->cell_axis[e], k, lanes_mul(here, x.slope[i][e]),
                                 lanes_mul(here, x.slope[i + 1][e]));
            }
        }
        sum += lanes_sum(plane);
    }
    return sum;
}

// Return the rate of change of the object's volume for a field of velocities: the scalar product of dV/dx (`kept`) and
// `field`.
static double object_rate(const kn_model *model, const real *kept, const real *field)
{
    const tables *t = model->tables;
    const size_t reals = (size_t)t->rows * 3 * model->stride; // number of reals in one plane of the field
    double sum = 0;
    for (int c = 0; c < t->planes; c++, kept += reals, field += reals) {
        lanes plane = lanes_set(0);
        for (size_t o = 0; o < reals; o += KN_LANES)
            plane = lanes_fma(lanes_load(kept + o), lanes_load(field + o), plane);
        sum += lanes_sum(plane);
    }
    return sum;
}

static void object_add(const kn_model *model, const kn_state *state, const kn_work *work)
{
    const tables *t = model->tables;
    real *kept = work->cell;
    fields f = fields_of(state, work, model->grid.vectors);
    double count = t->cell_count, j = object_shape(model, state, work) / count, slope;
    // (P - P0)/P0 of the whole object at the end of the step
    double over = kn_cell_pressure(j, &slope);
    over -= (double)t->cell_rate * object_rate(model, kept, f.guess) / count * slope;
    const lanes push = lanes_set((real)((double)t->cell_push * over));
    const lanes root = lanes_set((real)((double)t->cell_root * sqrt(slope / count)));
    // at every node: add the force, turn dV/dx into g, and add g g' to the diagonal block
    for (int row = 0; row < t->row_count; row++)
        for (int k = 0; k < f.K; k++) {
            lanes g[3];
            for (int i = 0; i < 3; i++) {
                real *here = kept + at(f.K, row, 3, i, k);
                store_add(f.r + at(f.K, row, 3, i, k), lanes_mul(push, lanes_load(here)));
                g[i] = lanes_mul(root, lanes_load(here));
                lanes_store(here, g[i]);
            }
            for (int i = 0; i < 3; i++)
                for (int e = i; e < 3; e++) store_add(f.p + at(f.K, row, 6, pair_of[i][e], k), lanes_mul(g[i], g[e]));
        }
}

// Add g (g.d) to q, where g is the vector of the whole object and d the search direction. Return (g.d)^2.
static double object_product(const kn_model *model, const kn_work *work)
{
    const real *kept = work->cell;
    real *q = work->q;
    double rate = object_rate(model, kept, work->d);
    for (size_t o = 0; o < kn_model_field(model, 3); o += KN_LANES)
        store_add(q + o, lanes_mul(lanes_load(kept + o), lanes_set((real)rate)));
    return rate * rate;
}

// Set the constants of Boyle's law. cell_shape computes lengths in spacings and slopes that are larger by the factor
// `whole`, so dV/dx = V0/(h whole) slope.
static void build_cells(tables *t, const kn_model *model)
{
    const kn_grid *g = &model->grid;
    if (model->def.pressure == KN_PRESSURE_NONE) return;
    const double h = g->spacing_m, v0 = h * h * g->depth_m, whole = g->flat ? 2 : 36;
    const double dt = model->def.solver.dt_s, gas = kn_model_gas_pa(model);
    t->cell_count = kn_grid_cells(g, NULL);
    t->cell_inverse_h = (real)(1 / h);
    t->cell_push = (real)(gas * v0 / (h * whole));
    t->cell_rate = (real)(dt / (h * whole));
    t->cell_root = (real)(sqrt(dt * gas * v0) / (h * whole));
    // a flat object has either one row per plane (its rows follow one another along c) or one plane (along b)
    const bool upright = g->flat && g->len[1] == 1;
    t->cell_axis[0] = g->axis[0];
    t->cell_axis[1] = g->axis[upright ? 2 : 1];
    t->cell_axis[2] = g->axis[2];
    // for the rows that hold a cell's corners: distance of each row from the first one, in rows
    t->cell_to[1] = 1;
    t->cell_to[2] = g->len[1];
    t->cell_to[3] = g->len[1] + 1;
}
