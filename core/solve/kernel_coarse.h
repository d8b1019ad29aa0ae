// The transfers between a block and the coarse level of the preconditioner (coarse.c), sixteen nodes at a time. This
// file is a part of kernel_grid.c, which includes it.
//
// T is trilinear, so it is done axis by axis: along the row in lanes, then from row to row, then from plane to plane.
// The sums over the nodes of a plane are added to the coarse planes in the order of the planes.
//
//     work.coarse:  r_c [padded]   z_c [padded]   sums [coarse planes + 1][coarse rows + 1][3][K][16]
//                   each plane [planes][coarse rows + 1][3][K][16]
//
// An axis with a single coarse node has a second one, of weight 0, so that every place has a node above it.

// Return the index of the coarse node at or below a place along an axis with n of them. `above`: weight of the next
// one.
LANES_INLINE int coarse_below(real place, int n, real *above)
{
    int below = (int)place;
    if (below > n - 2) below = n > 1 ? n - 2 : 0;
    *above = place - (real)below;
    return below;
}

// Arrays of one transfer, see the drawing above. `row`: reals of a coarse row, [3][K][16]; `plane`: reals of a coarse
// plane. first, last: range of the coarse rows [1] and planes [2] in which the block lies, `last` at most one beyond.
typedef struct transfer {
    int K, nodes[3], step[3], first[3], last[3];
    size_t row, plane;
    real *r, *z, *sums, *each;
} transfer;

LANES_INLINE transfer transfer_of(const kn_model *model, const kn_work *work, int K)
{
    const kn_coarse *coarse = model->coarse;
    const tables *t = model->tables;
    transfer x = {.K = K, .row = 3 * (size_t)K * KN_LANES};
    const int step[3] = {3, 3 * coarse->nodes[0], 3 * coarse->nodes[0] * coarse->nodes[1]};
    for (int i = 0; i < 3; i++) {
        x.nodes[i] = coarse->nodes[model->grid.axis[i]];
        x.step[i] = step[model->grid.axis[i]];
    }
    real above;
    x.first[1] = coarse_below(t->row_place[0], x.nodes[1], &above);
    x.last[1] = coarse_below(t->row_place[t->rows - 1], x.nodes[1], &above) + 1;
    x.first[2] = coarse_below(t->plane_place[0], x.nodes[2], &above);
    x.last[2] = coarse_below(t->plane_place[t->planes - 1], x.nodes[2], &above) + 1;
    x.plane = (size_t)(x.nodes[1] + 1) * x.row;
    x.r = work->coarse;
    x.z = x.r + coarse->padded;
    x.sums = x.z + coarse->padded;
    x.each = x.sums + (size_t)(x.nodes[2] + 1) * x.plane;
    return x;
}

// Store the sums of one vector at a coarse row, and begin those of the next.
LANES_INLINE void next_coarse_row(real *row, int K, int k, lanes low[3], lanes high[3])
{
    for (int i = 0; i < 3; i++) {
        lanes_store(row + (size_t)(i * K + k) * KN_LANES, low[i]);
        low[i] = high[i];
        high[i] = lanes_set(0);
    }
}

// Sum the residual of free components over the rows of one plane, for every coarse row.
LANES_INLINE void restrict_plane(const tables *t, const transfer *x, const kn_work *work, int c)
{
    const real *r = work->r, *free = work->free;
    real *plane = x->each + (size_t)c * x->plane;
    const lanes zero = lanes_set(0);
    for (int k = 0; k < x->K; k++) {
        lanes low[3] = {zero, zero, zero}, high[3] = {zero, zero, zero};
        int to = x->first[1];
        for (int b = 0, row = c * t->rows; b < t->rows; b++, row++) {
            real above;
            const int below = coarse_below(t->row_place[b], x->nodes[1], &above);
            for (; to < below; to++) next_coarse_row(plane + (size_t)to * x->row, x->K, k, low, high);
            const lanes up = lanes_set(above), down = lanes_set(1 - above);
            for (int i = 0; i < 3; i++) {
                const size_t o = at(x->K, row, 3, i, k);
                lanes value = lanes_load(r + o);
                if (work->row_held[row]) value = lanes_mul(value, lanes_load(free + o));
                low[i] = lanes_fma(down, value, low[i]);
                high[i] = lanes_fma(up, value, high[i]);
            }
        }
        for (; to <= x->last[1]; to++) next_coarse_row(plane + (size_t)to * x->row, x->K, k, low, high);
    }
}

// Sum along a coarse row, and add the sums to r_c. Lane A of a sum is that of coarse node A.
LANES_INLINE void restrict_row(const tables *t, const transfer *x, int b, int c, int length)
{
    const real *from = x->sums + (size_t)c * x->plane + (size_t)b * x->row;
    const int stride = x->K * KN_LANES;
    lanes sum[3] = {lanes_set(0), lanes_set(0), lanes_set(0)};
    for (int n = 0; n < length; n++) {
        // node n of the row is in lane n / K of vector n % K
        const int o = n % x->K * KN_LANES + n / x->K;
        const lanes weight = lanes_load(t->lane_down + (size_t)n * KN_LANES);
        for (int i = 0; i < 3; i++) sum[i] = lanes_fma(lanes_set(from[i * stride + o]), weight, sum[i]);
    }
    for (int i = 0; i < 3; i++) {
        _Alignas(64) real each[KN_LANES];
        lanes_store(each, sum[i]);
        for (int a = 0; a < x->nodes[0]; a++) x->r[a * x->step[0] + b * x->step[1] + c * x->step[2] + i] += each[a];
    }
}

LANES_INLINE void restrict_planes(const job *j, int part, int K)
{
    const tables *t = j->model->tables;
    const transfer x = transfer_of(j->model, j->work, K);
    const range planes = range_of(j->work, t->planes, part);
    for (int c = planes.first; c < planes.end; c++) restrict_plane(t, &x, j->work, c);
}

static void restrict_loop(void *loop, int part)
{
    const job *j = loop;
    if (j->model->grid.vectors == 1) restrict_planes(j, part, 1);
    else restrict_planes(j, part, j->model->grid.vectors);
}

static void restriction(const kn_model *model, const kn_work *work)
{
    const tables *t = model->tables;
    job j = {.model = model, .work = work};
    const transfer x = transfer_of(model, work, t->vectors);
    run(&j, restrict_loop);
    const size_t from = (size_t)x.first[1] * x.row, to = (size_t)(x.last[1] + 1) * x.row;
    // add the planes to the coarse planes, in their order
    for (int c = x.first[2]; c <= x.last[2]; c++)
        memset(x.sums + (size_t)c * x.plane + from, 0, (to - from) * sizeof(real));
    for (int c = 0; c < t->planes; c++) {
        real above, *sum = x.sums + (size_t)coarse_below(t->plane_place[c], x.nodes[2], &above) * x.plane;
        const lanes up = lanes_set(above), down = lanes_set(1 - above);
        for (size_t o = from; o < to; o += KN_LANES) {
            const lanes value = lanes_load(x.each + (size_t)c * x.plane + o);
            lanes_store(sum + o, lanes_fma(down, value, lanes_load(sum + o)));
            lanes_store(sum + x.plane + o, lanes_fma(up, value, lanes_load(sum + x.plane + o)));
        }
    }
    // r_c has no place for the second node of an axis with a single one
    for (int c = x.first[2]; c <= x.last[2] && c < x.nodes[2]; c++)
        for (int b = x.first[1]; b <= x.last[1] && b < x.nodes[1]; b++) restrict_row(t, &x, b, c, model->grid.len[0]);
}

// Spread the velocities of a coarse row along the row.
LANES_INLINE void prolong_row(const tables *t, const transfer *x, int b, int c)
{
    real *to = x->sums + (size_t)c * x->plane + (size_t)b * x->row;
    const real *from = x->z + b * x->step[1] + c * x->step[2];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < x->K; k++) {
            lanes sum = lanes_set(0);
            for (int a = 0; a < x->nodes[0]; a++)
                sum = lanes_fma(lanes_set(from[a * x->step[0] + i]),
                                lanes_load(t->lane_up + (size_t)(a * x->K + k) * KN_LANES), sum);
            lanes_store(to + (size_t)(i * x->K + k) * KN_LANES, sum);
        }
}

LANES_INLINE void prolong_planes(const job *j, int part, int K)
{
    const kn_work *work = j->work;
    const tables *t = j->model->tables;
    const transfer x = transfer_of(j->model, work, K);
    const size_t first = (size_t)x.first[1] * x.row, end = (size_t)(x.last[1] + 1) * x.row;
    const range planes = range_of(work, t->planes, part);
    const real *free = work->free;
    real *z = work->z;
    for (int c = planes.first, row = c * t->rows; c < planes.end; c++) {
        real above, *plane = x.each + (size_t)planes.first * x.plane;
        const real *from = x.sums + (size_t)coarse_below(t->plane_place[c], x.nodes[2], &above) * x.plane;
        lanes up = lanes_set(above), down = lanes_set(1 - above);
        for (size_t o = first; o < end; o += KN_LANES) {
            const lanes value = lanes_mul(down, lanes_load(from + o));
            lanes_store(plane + o, lanes_fma(up, lanes_load(from + x.plane + o), value));
        }
        for (int b = 0; b < t->rows; b++, row++) {
            const real *low = plane + (size_t)coarse_below(t->row_place[b], x.nodes[1], &above) * x.row;
            up = lanes_set(above), down = lanes_set(1 - above);
            for (size_t o = 0; o < x.row; o += KN_LANES) {
                const size_t to = at(K, row, 3, 0, 0) + o;
                lanes value = lanes_fma(up, lanes_load(low + x.row + o), lanes_mul(down, lanes_load(low + o)));
                if (work->row_held[row]) value = lanes_mul(value, lanes_load(free + to));
                lanes_store(z + to, lanes_add(lanes_load(z + to), value));
            }
        }
    }
}

static void prolong_loop(void *loop, int part)
{
    const job *j = loop;
    const int K = j->model->grid.vectors;
    if (K == 1) prolong_planes(j, part, 1);
    else prolong_planes(j, part, K);
}

static void prolongation(const kn_model *model, const kn_work *work)
{
    const tables *t = model->tables;
    job j = {.model = model, .work = work};
    const transfer x = transfer_of(model, work, t->vectors);
    for (int c = x.first[2]; c <= x.last[2] && c < x.nodes[2]; c++)
        for (int b = x.first[1]; b <= x.last[1] && b < x.nodes[1]; b++) prolong_row(t, &x, b, c);
    run(&j, prolong_loop);
}
