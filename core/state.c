#include "core/arena.h"
#include "core/hash.h"
#include "core/rigid.h"
#include "core/solver_fixed.h"

#include <stdlib.h>
#include <string.h>

static size_t real_size(const kn_model *m)
{
    return m->def.solver.precision == KN_PRECISION_F32 ? sizeof(float) : sizeof(double);
}

static size_t field_bytes(const kn_model *m, int components)
{
    if (components != KN_FORWARD) return kn_model_field(m, components) * real_size(m);
    // Edge fields: a Voigt element's strain follows from its length and is not stored. The integer solver sums up the
    // strain step by step, so it needs the field.
    const bool read_off = m->law.kind == KN_LAW_VOIGT && m->def.solver.kind != KN_SOLVER_FIXED;
    return read_off ? 0 : m->edge_reals * real_size(m);
}

// Return the number of reals stored for the cells' pressure: see kn_work.cell.
static size_t cell_reals(const kn_model *m)
{
    if (m->def.pressure == KN_PRESSURE_OBJECT) return kn_model_field(m, 3);
    return m->def.mesh ? 12 * (size_t)m->cell_count : kn_model_field(m, m->grid.flat ? 8 : 24);
}

// Hand out the scratch of the implicit solver.
static void layout_implicit(const kn_model *m, kn_arena *a, kn_scratch *s)
{
    kn_work *w = &s->work;
    // vectors first, then edges, blocks of held rows and cells
    struct {
        void **field;
        int components;
    } list[] = {{&w->guess, 3}, {&w->r, 3}, {&w->q, 3}, {&w->d, 3}, {&w->z, 3}, {&w->p, 6}, {&w->free, 3}};
    for (size_t i = 0; i < sizeof list / sizeof list[0]; i++)
        *list[i].field = kn_arena_take(a, kn_model_field(m, list[i].components) * real_size(m));
    w->g = kn_arena_take(a, (size_t)kn_work_edge(m) * m->edge_reals * real_size(m));
    w->whole = m->composite ? kn_arena_take(a, kn_model_field(m, 6) * real_size(m)) : NULL;
    w->cell = NULL;
    if (m->def.pressure != KN_PRESSURE_NONE) w->cell = kn_arena_take(a, cell_reals(m) * real_size(m));
    // then one byte per row, and the arrays of contact and rigid motion
    w->row_held = kn_arena_take(a, (size_t)m->row_count);
    w->row_moved = kn_arena_take(a, (size_t)m->row_count);
    s->row_base = kn_arena_take(a, (size_t)m->row_count);
    s->rigid.arm = kn_rigid_wanted(m) ? kn_arena_take(a, kn_rigid_bytes(m)) : NULL;
    s->last_held = kn_arena_take(a, (size_t)m->top_count * sizeof(int));
}

// Hand out the scratch of the Runge-Kutta solver.
static void layout_rk4(const kn_model *m, kn_arena *a, kn_scratch *s)
{
    size_t nodes = (size_t)m->node_count;
    s->fixed = kn_arena_take(a, nodes);
    s->velocity = kn_arena_take(a, nodes * sizeof *s->velocity);
    s->force = kn_arena_take(a, nodes * sizeof *s->force);
    s->reaction = kn_arena_take(a, nodes * sizeof *s->reaction);
    s->stages = kn_arena_take(a, kn_rk4_scratch(m));
    s->boundary = (kn_boundary){s->fixed, (const double(*)[3])s->velocity, (const double(*)[3])s->force, s->reaction};
}

// Hand out the scratch of the integer solver, which has a layout of its own.
static void layout_fixed(const kn_model *m, kn_arena *a, kn_scratch *s)
{
    s->stages = kn_arena_take(a, kn_fixed_scratch(m));
    if (s->stages) kn_fixed_scratch_init(m, s->stages);
}

// Lay out the arena. One description serves to measure (base NULL) and to hand out memory. `kept`: leave out the
// scratch.
static size_t layout(const kn_model *m, char *base, bool kept)
{
    kn_arena a = {.base = base};
    kn_state unused_state, *state = base ? (kn_state *)(void *)base : &unused_state;
    kn_scratch unused_scratch, *scratch = &unused_scratch;
    // saved part: the struct, the fields, held nodes and anchors
    kn_arena_take(&a, sizeof *state);
#define KN_FIELD(name, components)                                                                                     \
    state->name = kn_arena_take(&a, field_bytes(m, components));                                                       \
    if (field_bytes(m, components) == 0) state->name = NULL;
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    state->held = kn_arena_take(&a, KN_PROBES_MAX * (size_t)m->top_count);
    size_t anchors = kn_contact_anchors(m);
    state->anchor = anchors > 0 ? kn_arena_take(&a, anchors * sizeof *state->anchor) : NULL;
    if (base) state->bytes = a.used;
    if (kept) return a.used;
    // scratch: contact and the solver's vectors
    state->scratch = kn_arena_take(&a, sizeof *scratch);
    if (base) scratch = state->scratch;
    void *contact = kn_arena_take(&a, kn_contact_bytes(m));
    if (base) kn_contact_init(m, &scratch->contact, contact);
    if (m->def.solver.kind == KN_SOLVER_IMPLICIT) layout_implicit(m, &a, scratch);
    else if (m->def.solver.kind == KN_SOLVER_FIXED) layout_fixed(m, &a, scratch);
    else layout_rk4(m, &a, scratch);
    if (base) state->bytes = a.used;
    return a.used;
}

size_t kn_state_size(const kn_model *model) { return layout(model, NULL, false); }
size_t kn_state_kept(const kn_model *model) { return layout(model, NULL, true); }

static kn_state *allocate(const kn_model *m, size_t bytes, bool kept)
{
    kn_state *state = aligned_alloc(64, bytes);
    if (!state) return NULL;
    memset(state, 0, bytes); // this writes to every memory page now, so that no tick causes a page fault
    layout(m, (char *)state, kept);
    return state;
}

kn_state *kn_state_create(const kn_model *model)
{
    kn_state *state = allocate(model, model->state_bytes, false);
    if (state) kn_state_reset(model, state);
    return state;
}

kn_state *kn_state_keep(const kn_model *model) { return allocate(model, kn_state_kept(model), true); }

void kn_state_destroy(kn_state *state) { free(state); }

// Reset the implicit solver's scratch: zero vectors, and free components except those of the support.
static void reset_implicit(const kn_model *m, kn_scratch *s)
{
    kn_work *w = &s->work;
    memset(w->guess, 0, kn_model_field(m, 3) * real_size(m));
    memset(w->q, 0, kn_model_field(m, 3) * real_size(m));
    memset(w->d, 0, kn_model_field(m, 3) * real_size(m));
    // edges that do not exist are never written, so their g must be 0
    memset(w->g, 0, (size_t)kn_work_edge(m) * m->edge_reals * real_size(m));
    memset(s->row_base, 0, (size_t)m->row_count);
    memset(w->row_moved, 0, (size_t)m->row_count);
    s->last_held_count = 0;
    // free everything, then hold what the support holds
    for (size_t i = 0; i < kn_model_field(m, 3); i++) kn_real_set(m, w->free, i, 1);
    for (int node = 0; node < m->node_count; node++) {
        size_t o = m->offset[node];
        if (m->support[node]) s->row_base[o / (3 * m->stride)] = 1;
        for (size_t k = 0; k < 3; k++) kn_real_set(m, w->free, o + k * m->stride, m->support[node] >> k & 1 ? 0 : 1);
    }
    memcpy(w->row_held, s->row_base, (size_t)m->row_count);
}

void kn_state_reset(const kn_model *model, kn_state *state)
{
    // the plain part first, then the fields up to the held nodes; anchors are empty when their count is 0
    memset(state, 0, offsetof(kn_state, displacement));
#define KN_FIELD(name, components)                                                                                     \
    if (state->name) memset(state->name, 0, field_bytes(model, components));
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    memset(state->held, 0, KN_PROBES_MAX * (size_t)model->top_count);
    if (model->def.solver.kind == KN_SOLVER_IMPLICIT) reset_implicit(model, kn_state_scratch(state));
}

void kn_state_copy(const kn_model *model, kn_state *dst, const kn_state *src)
{
    memcpy(dst, src, offsetof(kn_state, displacement));
#define KN_FIELD(name, components)                                                                                     \
    if (src->name) memcpy(dst->name, src->name, field_bytes(model, components));
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    memcpy(dst->held, src->held, KN_PROBES_MAX * (size_t)model->top_count);
    if (src->anchor) memcpy(dst->anchor, src->anchor, (size_t)src->anchor_count * sizeof *src->anchor);
}

// Hash tools that turn, are coupled or stick, and their anchors. A scene without such tools adds nothing to the hash.
static uint64_t hash_tools(const kn_state *state, uint64_t h)
{
    static const kn_tool_state none;
    for (int p = 0; p < KN_PROBES_MAX; p++)
        if (memcmp(&state->tool[p], &none, sizeof none) != 0) h = kn_hash_bytes(h, &state->tool[p], sizeof none);
    if (state->anchor_count == 0) return h;
    return kn_hash_bytes(h, state->anchor, (size_t)state->anchor_count * sizeof *state->anchor);
}

uint64_t kn_state_hash(const kn_model *model, const kn_state *state)
{
    // hash the plain members from behind `tick` up to `bad`; the fields and anchors follow below
    size_t from = offsetof(kn_state, probe), to = offsetof(kn_state, bad) + sizeof state->bad;
    uint64_t h = kn_hash_bytes(KN_HASH_SEED, (const char *)state + from, to - from);
#define KN_FIELD(name, components)                                                                                     \
    if (state->name) h = kn_hash_bytes(h, state->name, field_bytes(model, components));
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    h = kn_hash_bytes(h, state->held, KN_PROBES_MAX * (size_t)model->top_count);
    return hash_tools(state, h);
}

static void node_vector(const kn_model *m, const void *field, int node, double out[3])
{
    for (size_t k = 0; k < 3; k++) out[k] = kn_real_get(m, field, m->offset[node] + k * m->stride);
}

void kn_state_position(const kn_model *model, const kn_state *state, int node, double x_m[3])
{
    double moved[3];
    node_vector(model, state->displacement, node, moved);
    for (int k = 0; k < 3; k++) x_m[k] = model->rest_m[node][k] + moved[k];
}

void kn_state_velocity(const kn_model *model, const kn_state *state, int node, double v_m_s[3])
{
    node_vector(model, state->velocity, node, v_m_s);
}
