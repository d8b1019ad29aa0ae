#ifndef KN_CORE_SOLVE_KERNEL_NODES_H
#define KN_CORE_SOLVE_KERNEL_NODES_H
// Work of the kernels at nodes, sixteen at a time: a row holds K vectors of nodes, in a net one. Sums over nodes are
// added row by row within a group of rows, then group by group. A group is a plane of a block, or sixteen rows of a
// net.
#include "core/solve/contact.h"
#include "core/solve/kernel_law.h"
#include <limits.h>
#include <string.h>

// Return the offset of vector k of component c of a row, in a field with C components.
LANES_INLINE size_t at(int K, int row, int C, int c, int k)
{
    return (((size_t)row * (size_t)C + (size_t)c) * (size_t)K + (size_t)k) * KN_LANES;
}

// --- parts ----------------------------------------------------------------------------------------------------------

// A kernel's loop over groups of rows is done in parts, one for each thread of a team. A part writes only to its own
// rows. Every group leaves its sum in work->sums, and the sums are added in the order of the groups. So the number of
// parts changes no bit.
typedef struct job { // arguments of a loop
    const kn_model *model;
    const kn_state *state;
    const kn_work *work;
    kn_linearization how;
    bool again, moved; // moved: the guess differs from the last velocity in some row (net)
    double factor;     // alpha of update, beta of apply
} job;

typedef struct range {
    int first, end;
} range;

LANES_INLINE range range_of(const kn_work *work, int count, int part)
{
    const int parts = work->team ? KN_TEAM_PARTS : 1;
    return (range){(count * part + parts - 1) / parts, (count * (part + 1) + parts - 1) / parts};
}

// Return the number of rows of a net or a block, of rows in a group, of groups, and of vectors in a row.
static inline int rows_in(const kn_model *m) { return m->def.mesh ? m->row_count : m->grid.rows; }
static inline int rows_together(const kn_model *m) { return m->def.mesh ? 16 : m->grid.len[1]; }
static inline int groups_of(const kn_model *m) { return (rows_in(m) + rows_together(m) - 1) / rows_together(m); }
static inline int vectors_of(const kn_model *m) { return m->def.mesh ? 1 : m->grid.vectors; }

// Return the rows of a part of a loop over groups.
LANES_INLINE range rows_of(const job *j, int part)
{
    const range groups = range_of(j->work, groups_of(j->model), part);
    const int rows = rows_in(j->model), first = groups.first * rows_together(j->model),
              end = groups.end * rows_together(j->model);
    return (range){first < rows ? first : rows, end < rows ? end : rows};
}

static void run(job *j, kn_team_work *loop)
{
    if (j->work->team) j->work->team->run(j->work->team, loop, j);
    else loop(j, 0);
}

// Add the sums of the groups in their order.
static double sum_of(const double *sums, int groups)
{
    double total = 0;
    for (int i = 0; i < groups; i++) total += sums[i];
    return total;
}

LANES_INLINE void store_add(real *p, lanes a) { lanes_store(p, lanes_add(lanes_load(p), a)); }

typedef struct fields { // the fields of a state and of the solver, with the type `real`
    // K: number of vectors per row. If K is a constant 1, the compiler removes the branches from the loops.
    int K;
    int first, end; // rows of this part; a part writes to no other rows
    const real *x, *v;
    real *u, *guess, *r, *q, *d, *z, *p, *g;
    const real *free;
    real *aside; // memory for results that are the other part's: a row of g
} fields;

LANES_INLINE bool is_mine(const fields *f, int row) { return row >= f->first && row < f->end; }

LANES_INLINE fields fields_of(const kn_state *state, const kn_work *work, int K)
{
    return (fields){K,
                    0,
                    INT_MAX,
                    state->displacement,
                    state->velocity,
                    state->strain,
                    work->guess,
                    work->r,
                    work->q,
                    work->d,
                    work->z,
                    work->p,
                    work->g,
                    work->free,
                    NULL};
}

// Compute z = P r for the symmetric blocks P of sixteen nodes. Return r.z for each lane.
LANES_INLINE lanes multiply_block(const lanes p[6], const lanes r[3], lanes z[3])
{
    z[0] = lanes_fma(p[2], r[2], lanes_fma(p[1], r[1], lanes_mul(p[0], r[0])));
    z[1] = lanes_fma(p[4], r[2], lanes_fma(p[3], r[1], lanes_mul(p[1], r[0])));
    z[2] = lanes_fma(p[5], r[2], lanes_fma(p[4], r[1], lanes_mul(p[2], r[0])));
    return dot(r, z);
}

// Invert symmetric 3 x 3 blocks by their cofactors.
LANES_INLINE void invert_block(const lanes m[6], lanes p[6])
{
    p[0] = lanes_fnma(m[4], m[4], lanes_mul(m[3], m[5]));
    p[1] = lanes_fnma(m[1], m[5], lanes_mul(m[2], m[4]));
    p[2] = lanes_fnma(m[2], m[3], lanes_mul(m[1], m[4]));
    p[3] = lanes_fnma(m[2], m[2], lanes_mul(m[0], m[5]));
    p[4] = lanes_fnma(m[0], m[4], lanes_mul(m[1], m[2]));
    p[5] = lanes_fnma(m[1], m[1], lanes_mul(m[0], m[3]));
    lanes determinant = lanes_fma(m[2], p[2], lanes_fma(m[1], p[1], lanes_mul(m[0], p[0])));
    lanes inverse = lanes_div(lanes_set(1), determinant);
    for (int i = 0; i < 6; i++) p[i] = lanes_mul(p[i], inverse);
}

// Finish vector k of a row after all of its edges have been added: add mass over dt and weight, apply constraints,
// invert the blocks, compute z. Return r.z for each lane.
LANES_INLINE lanes finish_nodes(const fields *f, const kn_work *work, int row, int k, lanes mass, lanes weight,
                                bool again)
{
    // add mass over dt to the diagonal of every block
    lanes m[6], p[6], r[3], z[3];
    for (int i = 0; i < 3; i++) r[i] = lanes_load(f->r + at(f->K, row, 3, i, k));
    for (int i = 0; i < 6; i++) m[i] = lanes_load(f->p + at(f->K, row, 6, i, k));
    m[0] = lanes_add(m[0], mass);
    m[3] = lanes_add(m[3], mass);
    m[5] = lanes_add(m[5], mass);
    r[2] = lanes_sub(r[2], weight);
    // add inertia if the guess differs from the last velocity
    if (work->row_moved[row] || again)
        for (int i = 0; i < 3; i++) {
            size_t o = at(f->K, row, 3, i, k);
            r[i] = lanes_fma(mass, lanes_sub(lanes_load(f->v + o), lanes_load(f->guess + o)), r[i]);
        }
    if (work->row_held[row]) {
        // keep the block without constraints, which a composite adds to the masters of tied nodes
        for (int i = 0; work->whole && i < 6; i++) lanes_store((real *)work->whole + at(f->K, row, 6, i, k), m[i]);
        static const int diagonal[3] = {0, 3, 5}, pair[3][3] = {{1, 0, 1}, {2, 0, 2}, {4, 1, 2}};
        lanes loose[3], one = lanes_set(1);
        for (int i = 0; i < 3; i++) loose[i] = lanes_load(f->free + at(f->K, row, 3, i, k));
        // clear the rows and columns of prescribed components, so that the inverse acts on free components only
        for (int i = 0; i < 3; i++) {
            int o = pair[i][0];
            m[o] = lanes_mul(m[o], lanes_mul(loose[pair[i][1]], loose[pair[i][2]]));
            // the diagonal of a prescribed component becomes 1, so that the block can be inverted
            m[diagonal[i]] = lanes_less(loose[i], lanes_set((real)0.5), one, m[diagonal[i]]);
        }
        // the diagonal of a prescribed component in the inverse becomes 0, so that the component never changes
        invert_block(m, p);
        for (int i = 0; i < 3; i++) p[diagonal[i]] = lanes_mul(p[diagonal[i]], loose[i]);
    } else {
        invert_block(m, p);
    }
    lanes rz = multiply_block(p, r, z);
    for (int i = 0; i < 3; i++) {
        lanes_store(f->r + at(f->K, row, 3, i, k), r[i]);
        lanes_store(f->z + at(f->K, row, 3, i, k), z[i]);
    }
    for (int i = 0; i < 6; i++) lanes_store(f->p + at(f->K, row, 6, i, k), p[i]);
    return rz;
}

static void begin_loop(void *loop, int part)
{
    const job *j = loop;
    const range rows = rows_of(j, part);
    const size_t row = at(vectors_of(j->model), 1, 3, 0, 0);
    const size_t from = (size_t)rows.first * row, reals = (size_t)rows.end * row - from;
    memset((real *)j->work->r + from, 0, reals * sizeof(real));
    memset((real *)j->work->p + 2 * from, 0, 2 * reals * sizeof(real));
    if (!j->again) memcpy((real *)j->work->guess + from, (const real *)j->state->velocity + from, reals * sizeof(real));
}

static void begin(const kn_model *model, const kn_state *state, const kn_work *work, bool again)
{
    job j = {.model = model, .state = state, .work = work, .again = again};
    run(&j, begin_loop);
}

// Set z to the last step's change of velocity at free components. Sum r.z.
static void recall_loop(void *loop, int part)
{
    const job *j = loop;
    const real *change = j->state->change, *r = j->work->r, *free = j->work->free;
    const range rows = rows_of(j, part);
    const size_t reals = at(vectors_of(j->model), 1, 3, 0, 0);
    real *z = j->work->z;
    for (int row = rows.first, together = rows_together(j->model); row < rows.end; row += together) {
        const int end = row + together < rows.end ? row + together : rows.end;
        lanes sum = lanes_set(0);
        for (size_t o = (size_t)row * reals; o < (size_t)end * reals; o += KN_LANES) {
            lanes d = lanes_mul(lanes_load(change + o), lanes_load(free + o));
            lanes_store(z + o, d);
            sum = lanes_fma(d, lanes_load(r + o), sum);
        }
        j->work->sums[row / together] = lanes_sum(sum);
    }
}

static double recall(const kn_model *model, const kn_state *state, const kn_work *work)
{
    job j = {.model = model, .state = state, .work = work};
    run(&j, recall_loop);
    return sum_of(work->sums, groups_of(model));
}

// Compute d = z + beta d of one row.
LANES_INLINE void next_direction(const fields *f, int row, real beta)
{
    for (int i = 0; i < 3 * f->K; i++) {
        size_t o = at(f->K, row, 3, 0, i);
        lanes_store(f->d + o, lanes_fma(lanes_set(beta), lanes_load(f->d + o), lanes_load(f->z + o)));
    }
}

// Compute guess += alpha d, r -= alpha q, z = P r. Sum r.z.
LANES_INLINE void update_nodes(const job *j, int part, int K)
{
    const kn_work *work = j->work;
    const range rows = rows_of(j, part);
    fields f = {.K = K, .guess = work->guess, .r = work->r, .q = work->q, .d = work->d, .z = work->z, .p = work->p};
    const lanes a = lanes_set((real)j->factor), zero = lanes_set(0);
    for (int row = rows.first, together = rows_together(j->model); row < rows.end;) {
        const int group = row / together, end = row + together < rows.end ? row + together : rows.end;
        lanes sum = zero;
        for (; row < end; row++)
            for (int k = 0; k < f.K; k++) {
                lanes p[6], r[3], z[3];
                for (int i = 0; i < 6; i++) p[i] = lanes_load(f.p + at(f.K, row, 6, i, k));
                for (int i = 0; i < 3; i++) {
                    size_t o = at(f.K, row, 3, i, k);
                    lanes_store(f.guess + o, lanes_fma(a, lanes_load(f.d + o), lanes_load(f.guess + o)));
                    r[i] = lanes_fnma(a, lanes_load(f.q + o), lanes_load(f.r + o));
                    lanes_store(f.r + o, r[i]);
                    lanes_store(f.q + o, zero); // clear q for the next product A d
                }
                sum = lanes_add(sum, multiply_block(p, r, z));
                for (int i = 0; i < 3; i++) lanes_store(f.z + at(f.K, row, 3, i, k), z[i]);
            }
        work->sums[group] = lanes_sum(sum);
    }
}

static void update_loop(void *loop, int part)
{
    const job *j = loop;
    if (vectors_of(j->model) == 1) update_nodes(j, part, 1);
    else update_nodes(j, part, vectors_of(j->model));
}

static double update(const kn_model *model, const kn_work *work, double alpha)
{
    job j = {.model = model, .work = work, .factor = alpha};
    run(&j, update_loop);
    return sum_of(work->sums, groups_of(model));
}

// Advance displacements, velocities and the last change of velocity.
static void integrate_loop(void *loop, int part)
{
    const job *j = loop;
    real *x = j->state->displacement, *v = j->state->velocity, *change = j->state->change;
    const real *guess = j->work->guess;
    const range rows = rows_of(j, part);
    const size_t row = at(vectors_of(j->model), 1, 3, 0, 0);
    const lanes dt = lanes_set((real)j->model->law.dt_s);
    for (size_t o = (size_t)rows.first * row; o < (size_t)rows.end * row; o += KN_LANES) {
        lanes g = lanes_load(guess + o);
        lanes_store(change + o, lanes_sub(g, lanes_load(v + o)));
        lanes_store(v + o, g);
        lanes_store(x + o, lanes_fma(dt, g, lanes_load(x + o)));
    }
}

static void integrate(const kn_model *model, kn_state *state, const kn_work *work)
{
    job j = {.model = model, .state = state, .work = work};
    run(&j, integrate_loop);
}

// --- coarse level ---------------------------------------------------------------------------------------------------

// Compute up to `count` vectors of the product of the inverse coarse matrix and r_c. The accumulators stay in
// registers. Store r.z for each lane.
LANES_INLINE void coarse_product(const job *j, int from, int count, real *sums)
{
    const kn_coarse *coarse = j->model->coarse;
    const real *column = (const real *)coarse->inverse + (size_t)from * KN_LANES, *r = j->work->coarse;
    real *z = (real *)j->work->coarse + coarse->padded;
    lanes sum[6], rz = lanes_set(0);
    UNROLL(6)
    for (int i = 0; i < count; i++) sum[i] = lanes_set(0);
    for (const real *end = r + coarse->unknowns; r < end; r++, column += coarse->padded) {
        const lanes value = lanes_set(*r);
        UNROLL(6)
        for (int i = 0; i < count; i++) sum[i] = lanes_fma(value, lanes_load(column + (size_t)i * KN_LANES), sum[i]);
    }
    UNROLL(6)
    for (int i = 0; i < count; i++) {
        const size_t o = (size_t)(from + i) * KN_LANES;
        lanes_store(z + o, sum[i]);
        rz = lanes_fma(sum[i], lanes_load((const real *)j->work->coarse + o), rz);
    }
    lanes_store(sums, rz);
}

static void coarse_loop(void *loop, int part)
{
    const job *j = loop;
    const int vectors = j->model->coarse->padded / KN_LANES;
    const range sixes = range_of(j->work, (vectors + 5) / 6, part);
    for (int i = sixes.first, v = 6 * i; i < sixes.end; i++, v += 6) {
        real *sums = (real *)j->work->cut + i * KN_LANES;
        switch (vectors - v) {
        case 1: coarse_product(j, v, 1, sums); break;
        case 2: coarse_product(j, v, 2, sums); break;
        case 3: coarse_product(j, v, 3, sums); break;
        case 4: coarse_product(j, v, 4, sums); break;
        case 5: coarse_product(j, v, 5, sums); break;
        default: coarse_product(j, v, 6, sums); break;
        }
    }
}

static double coarse_solve(const kn_model *model, const kn_work *work)
{
    job j = {.model = model, .work = work};
    lanes rz = lanes_set(0);
    if (model->coarse->padded > 6 * KN_LANES) run(&j, coarse_loop);
    else coarse_loop(&j, 0); // a single part
    for (int v = 0; v < model->coarse->padded; v += 6 * KN_LANES)
        rz = lanes_add(rz, lanes_load((const real *)work->cut + v / 6));
    return lanes_sum(rz);
}

// --- contact --------------------------------------------------------------------------------------------------------

// The samples of a patch are the lanes of a vector. At first every lane interpolates its velocity from those of the
// nodes; at the end every node adds up the forces of the samples, one sample after the other, with the nodes as lanes.

LANES_INLINE lanes contact_lanes(const kn_contact_patch *p, int vector)
{
    return lanes_load((const real *)p->lanes + (size_t)vector * KN_LANES);
}

// Interpolate the velocities of the samples of a patch from a field.
LANES_INLINE void contact_rate(const kn_contact_patch *p, const real *field, size_t stride, lanes rate[3])
{
    for (int k = 0; k < 3; k++) rate[k] = lanes_set(0);
    for (int a = 0; a < p->nodes; a++) {
        const lanes weight = contact_lanes(p, KN_CONTACT_WEIGHT + a);
        for (size_t k = 0; k < 3; k++)
            rate[k] = lanes_fma(weight, lanes_set(field[p->offset[a] + k * stride]), rate[k]);
    }
}

// Compute dt K v for the stiffness K of every sample.
LANES_INLINE void contact_force(const kn_contact_patch *p, const lanes v[3], lanes force[3])
{
    const lanes side = contact_lanes(p, KN_CONTACT_SIDE);
    lanes n[3];
    for (int k = 0; k < 3; k++) n[k] = contact_lanes(p, KN_CONTACT_NORMAL + k);
    const lanes along = lanes_mul(contact_lanes(p, KN_CONTACT_ALONG), dot(n, v));
    for (int k = 0; k < 3; k++) force[k] = lanes_fma(side, v[k], lanes_mul(along, n[k]));
}

// Add the forces of the samples to the nodes of a patch.
LANES_INLINE void contact_push(const kn_contact_patch *p, const lanes force[3], real *field, size_t stride)
{
    _Alignas(64) real each[3][KN_LANES];
    const real *spread = (const real *)p->lanes + (size_t)(KN_CONTACT_WEIGHT + p->nodes) * KN_LANES;
    lanes sum[3] = {lanes_set(0), lanes_set(0), lanes_set(0)};
    for (int k = 0; k < 3; k++) lanes_store(each[k], force[k]);
    for (int l = 0; l < p->count; l++) {
        const lanes weight = lanes_load(spread + (size_t)l * KN_LANES);
        for (int k = 0; k < 3; k++) sum[k] = lanes_fma(lanes_set(each[k][l]), weight, sum[k]);
    }
    for (int k = 0; k < 3; k++) lanes_store(each[k], sum[k]);
    for (int a = 0; a < p->nodes; a++)
        for (size_t k = 0; k < 3; k++) field[p->offset[a] + k * stride] += each[k][a];
}

LANES_INLINE void cross(const lanes a[3], const lanes b[3], lanes out[3])
{
    for (int k = 0; k < 3; k++) {
        const int u = (k + 1) % 3, v = (k + 2) % 3;
        out[k] = lanes_fnma(a[v], b[u], lanes_mul(a[u], b[v]));
    }
}

static void contact_rates(const kn_model *model, const kn_contact *contact, const void *field, double (*wrench)[6])
{
    for (const kn_contact_patch *p = contact->patch; p < contact->patch + contact->patch_count; p++) {
        lanes rate[3], force[3], arm[3], torque[3];
        contact_rate(p, field, model->stride, rate);
        for (int k = 0; k < 3; k++) {
            lanes_store((real *)p->lanes + (size_t)(KN_CONTACT_RATE + k) * KN_LANES, rate[k]);
            arm[k] = contact_lanes(p, KN_CONTACT_ARM + k);
        }
        if (!wrench || p->probe == KN_TABLE || !contact->tool[p->probe].coupled) continue;
        contact_force(p, rate, force);
        cross(arm, force, torque);
        for (int k = 0; k < 3; k++) {
            wrench[p->probe][k] += lanes_sum(force[k]);
            wrench[p->probe][3 + k] += lanes_sum(torque[k]);
        }
    }
}

// Add the stiffnesses of the samples to the diagonal blocks of the nodes of a patch.
LANES_INLINE void contact_stiffen(const kn_contact_patch *p, real *blocks, size_t stride)
{
    _Alignas(64) real each[6][KN_LANES];
    const real *spread = (const real *)p->lanes + (size_t)(KN_CONTACT_WEIGHT + p->nodes) * KN_LANES;
    const lanes along = contact_lanes(p, KN_CONTACT_ALONG), side = contact_lanes(p, KN_CONTACT_SIDE);
    lanes n[3], sum[6];
    for (int k = 0; k < 3; k++) n[k] = contact_lanes(p, KN_CONTACT_NORMAL + k);
    for (int i = 0, c = 0; i < 3; i++)
        for (int j = i; j < 3; j++, c++) {
            const lanes k = lanes_mul(along, lanes_mul(n[i], n[j]));
            lanes_store(each[c], i == j ? lanes_add(k, side) : k);
            sum[c] = lanes_set(0);
        }
    for (int l = 0; l < p->count; l++) {
        const lanes weight = lanes_load(spread + (size_t)l * KN_LANES), weight2 = lanes_mul(weight, weight);
        for (int c = 0; c < 6; c++) sum[c] = lanes_fma(lanes_set(each[c][l]), weight2, sum[c]);
    }
    for (int c = 0; c < 6; c++) lanes_store(each[c], sum[c]);
    for (int a = 0; a < p->nodes; a++) {
        // the offset is that in a field of 3 components
        real *block = blocks + p->offset[a] / (3 * stride) * 6 * stride + p->offset[a] % (3 * stride);
        for (size_t c = 0; c < 6; c++) block[c * stride] += each[c][a];
    }
}

static void contact_add(const kn_model *model, const kn_work *work, const kn_contact *contact, bool blocks)
{
    for (const kn_contact_patch *p = contact->patch; p < contact->patch + contact->patch_count; p++) {
        lanes force[3];
        for (int k = 0; k < 3; k++) force[k] = contact_lanes(p, KN_CONTACT_FORCE + k);
        contact_push(p, force, work->r, model->stride);
        if (blocks) contact_stiffen(p, work->p, model->stride);
    }
}

static double contact_product(const kn_model *model, const kn_work *work, const kn_contact *contact,
                              const double (*velocity)[6])
{
    double total = 0;
    for (const kn_contact_patch *p = contact->patch; p < contact->patch + contact->patch_count; p++) {
        lanes rate[3], apart[3], force[3];
        if (velocity)
            for (int k = 0; k < 3; k++) rate[k] = contact_lanes(p, KN_CONTACT_RATE + k);
        else contact_rate(p, work->d, model->stride, rate);
        // apart: velocity of the skin relative to the tool
        for (int k = 0; k < 3; k++) apart[k] = rate[k];
        if (velocity && p->probe != KN_TABLE) {
            const double *v = velocity[p->probe];
            lanes turn[3], arm[3], around[3];
            for (int k = 0; k < 3; k++) {
                turn[k] = lanes_set((real)v[3 + k]);
                arm[k] = contact_lanes(p, KN_CONTACT_ARM + k);
            }
            cross(turn, arm, around);
            for (int k = 0; k < 3; k++) apart[k] = lanes_sub(apart[k], lanes_add(lanes_set((real)v[k]), around[k]));
        }
        contact_force(p, apart, force);
        contact_push(p, force, work->q, model->stride);
        total += lanes_sum(dot(rate, force));
    }
    return total;
}

// --- the table of kernels -------------------------------------------------------------------------------------------

#define KN_KERNELS_TABLE                                                                                               \
    {                                                                                                                  \
        .name = KN_KERNELS_NAME, .tables_size = tables_size, .tables_build = tables_build, .begin = begin,             \
        .edge = edge, .recall = recall, .apply = apply, .update = update, .restriction = restriction,                  \
        .coarse_solve = coarse_solve, .prolongation = prolongation, .contact_rates = contact_rates,                    \
        .contact_add = contact_add, .contact_product = contact_product, .integrate = integrate                         \
    }

#endif
