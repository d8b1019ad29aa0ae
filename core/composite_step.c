// The kernels of a composite: the kernels of its parts, and the exchange between tied nodes and their masters.
#include "core/composite.h"

#define real float
#define NAME(name) name##_f32
#include "core/composite_ties.h"
#undef real
#undef NAME
#define real double
#define NAME(name) name##_f64
#include "core/composite_ties.h"
#undef real
#undef NAME

static bool single(const kn_model *m) { return m->def.solver.precision == KN_PRECISION_F32; }

// Set a field at all tied nodes to the mean of their masters' values, in the model's precision.
static void spread(const kn_model *m, void *field)
{
    if (single(m)) spread_f32(m->composite, m->stride, field);
    else spread_f64(m->composite, m->stride, field);
}

static void gather(const kn_model *m, void *field, int part)
{
    if (single(m)) gather_f32(m->composite, m->stride, field, part);
    else gather_f64(m->composite, m->stride, field, part);
}

static void gather_all(const kn_model *m, void *field)
{
    for (int p = 0; p < m->composite->part_count; p++) gather(m, field, p);
}

static void gather_blocks(const kn_model *m, const kn_work *w, int part)
{
    if (single(m)) gather_blocks_f32(m->composite, m->stride, w->p, w->whole, part);
    else gather_blocks_f64(m->composite, m->stride, w->p, w->whole, part);
}

// The rows of one part, in the form of a separate state.
typedef struct view {
    kn_state state;
    kn_work work;
} view;

// Return the address of a part's first row in a field.
static void *rows_from(const kn_model *m, void *field, int components, int row)
{
    size_t reals = (size_t)row * (size_t)components * m->stride;
    return field ? (char *)field + reals * m->kernels->real_size : NULL;
}

// Set up the view of one part.
static void view_of(const kn_model *m, const kn_state *state, int part, view *v)
{
    const kn_work *w = kn_state_work(state);
    const int row = m->composite->row_first[part];
#define KN_FIELD(name, components) v->state.name = rows_from(m, state->name, components, row);
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    v->work = (kn_work){
        .guess = rows_from(m, w->guess, 3, row),
        .r = rows_from(m, w->r, 3, row),
        .q = rows_from(m, w->q, 3, row),
        .d = rows_from(m, w->d, 3, row),
        .z = rows_from(m, w->z, 3, row),
        .p = rows_from(m, w->p, 6, row),
        .whole = rows_from(m, w->whole, 6, row),
        .g = rows_from(m, w->g, kn_work_edge(m) * KN_FORWARD, row),
        .free = rows_from(m, w->free, 3, row),
        .row_held = w->row_held + row,
        .row_moved = w->row_moved + row,
    };
    v->state.scratch = &v->work;
}

// Copy the masters' guess to their tied nodes. If a prescribed velocity of a master has changed, mark the rows of its
// tied nodes as moved, too.
static void follow(const kn_model *m, const kn_work *w)
{
    const kn_composite *c = m->composite;
    const size_t row = 3 * m->stride;
    for (int t = 0; t < c->tie_first[c->part_count]; t++)
        for (int i = 0; i < c->tie[t].count; i++)
            w->row_moved[c->tie[t].node / row] |= w->row_moved[c->tie[t].master[i] / row];
    spread(m, w->guess);
}

// Run the edge pass part by part, the last part first: the sums of its tied nodes must reach their masters before the
// masters' rows are finished.
static double edge(const kn_model *m, kn_state *state, kn_linearization how, bool again)
{
    const kn_composite *c = m->composite;
    const kn_work *w = kn_state_work(state);
    double rz = 0;
    view v;
    follow(m, w);
    // every part adds the forces and diagonal blocks of its tied nodes to the masters in earlier parts
    for (int p = c->part_count - 1; p >= 0; p--) {
        view_of(m, state, p, &v);
        rz += c->inside->edge(&c->part[p], &v.state, how, again);
        gather(m, w->r, p);
        gather_blocks(m, w, p);
    }
    return rz;
}

// The remaining kernels of kernel.h, run part by part.
static double recall(const kn_model *m, kn_state *state)
{
    const kn_composite *c = m->composite;
    double rz = 0;
    view v;
    for (int p = 0; p < c->part_count; p++) {
        view_of(m, state, p, &v);
        rz += c->inside->recall(&c->part[p], &v.state);
    }
    return rz;
}

static double apply(const kn_model *m, kn_state *state, double beta)
{
    const kn_composite *c = m->composite;
    double dq = 0;
    view v;
    // tied nodes get the direction of their masters; after the product, update gathers q
    spread(m, kn_state_work(state)->z);
    for (int p = 0; p < c->part_count; p++) {
        view_of(m, state, p, &v);
        dq += c->inside->apply(&c->part[p], &v.state, beta);
    }
    return dq;
}

static double update(const kn_model *m, kn_state *state, double alpha)
{
    const kn_composite *c = m->composite;
    const kn_work *w = kn_state_work(state);
    double rz = 0;
    view v;
    // add the products of tied nodes to their masters
    gather_all(m, w->q);
    if (alpha == 0) gather_all(m, w->r); // alpha 0 means that contact has changed the residual r, so collect it again
    for (int p = 0; p < c->part_count; p++) {
        view_of(m, state, p, &v);
        rz += c->inside->update(&c->part[p], &v.state, alpha);
    }
    return rz;
}

static void integrate(const kn_model *m, kn_state *state)
{
    const kn_composite *c = m->composite;
    view v;
    for (int p = 0; p < c->part_count; p++) {
        view_of(m, state, p, &v);
        c->inside->integrate(&c->part[p], &v.state);
    }
    // tied nodes moved like their masters except for rounding; copy again, so that rounding does not accumulate
    spread(m, state->displacement);
    spread(m, state->velocity);
    spread(m, state->change);
}

void kn_composite_kernels(kn_model *m)
{
    kn_composite *c = m->composite;
    c->kernels = (kn_kernels){.name = c->inside->name,
                              .real_size = c->inside->real_size,
                              .edge = edge,
                              .recall = recall,
                              .apply = apply,
                              .update = update,
                              .integrate = integrate};
    m->kernels = &c->kernels;
}
