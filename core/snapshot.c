#include "core/snapshot.h"
#include "core/algebra/bytes.h"
#include "core/solve/contact.h"
#include "core/field.h"
#include "core/hash.h"

#include <math.h>
#include <string.h>

#define LAYOUT 1

const char *kn_snapshot_fit_name(kn_snapshot_fit fit)
{
    static const char *const names[] = {
        "fits",      "another version",          "another lattice", "another material or structure",
        "truncated", "a number out of its range"};
    return names[fit];
}

// --- identity -------------------------------------------------------------------------------------------------------

// Hash the positions of the nodes, their places in memory, and the list of top nodes.
static uint64_t lattice_hash(const kn_model *m)
{
    uint64_t h = kn_hash_bytes(KN_HASH_SEED, m->rest_m, (size_t)m->node_count * sizeof *m->rest_m);
    for (int i = 0; i < m->node_count; i++) {
        uint64_t offset = m->offset[i];
        h = kn_hash_bytes(h, &offset, sizeof offset);
    }
    return kn_hash_bytes(h, m->top, (size_t)m->top_count * sizeof *m->top);
}

uint64_t kn_model_hash(const kn_model *model)
{
    const kn_model_def *d = &model->def;
    const kn_material *mat = &d->material;
    // hash the numbers that define the lattice; tools and quality points may differ between snapshot and model
    const double said[] = {mat->k1_pa,
                           mat->c1_pa_s,
                           mat->damper,
                           mat->c2_pa_s,
                           mat->alpha_pa_s,
                           mat->beta_per_pa,
                           mat->p0_pa,
                           mat->p1_pa,
                           mat->c_max_pa_s,
                           mat->c_min_pa_s,
                           mat->ratio,
                           mat->stroke[0],
                           mat->stroke[1],
                           d->gravity_m_s2,
                           d->thickness_m,
                           d->structure,
                           d->diagonal_stiffness,
                           d->pressure,
                           d->inside_pressure_pa,
                           d->support,
                           d->support_friction,
                           d->solver.kind,
                           d->solver.precision,
                           d->solver.dt_s,
                           d->solver.mass_scale};
    uint64_t h = kn_hash_bytes(lattice_hash(model), said, sizeof said);
    if (d->force_factor != 1) h = kn_hash_bytes(h, &d->force_factor, sizeof d->force_factor);
    h = kn_hash_bytes(h, model->node_mass_kg, (size_t)model->node_count * sizeof *model->node_mass_kg);
    return kn_hash_bytes(h, model->support, (size_t)model->node_count);
}

// --- the layout -----------------------------------------------------------------------------------------------------

// The values that must be equal in a snapshot and in the model that reads it.
typedef struct identity {
    uint64_t lattice, model, nodes, reals, precision, held;
} identity;

static identity identity_of(const kn_model *m)
{
    return (identity){lattice_hash(m),
                      kn_model_hash(m),
                      (uint64_t)m->node_count,
                      m->edge_reals,
                      (uint64_t)m->def.solver.precision,
                      KN_PROBES_MAX * (size_t)m->top_count};
}

static void put_identity(kn_codec *c, identity *i)
{
    uint64_t *value[] = {&i->lattice, &i->model, &i->nodes, &i->reals, &i->precision, &i->held};
    for (size_t k = 0; k < sizeof value / sizeof *value; k++) kn_codec_u64(c, value[k]);
}

// Compare the identity in a snapshot with the model's own. Return KN_SNAPSHOT_LATTICE if nodes, edges or precision
// differ. Return KN_SNAPSHOT_MATERIAL if only material, structure, support, gas or step differ.
static kn_snapshot_fit judge(const identity *found, const identity *own)
{
    bool lattice = found->lattice == own->lattice && found->nodes == own->nodes && found->reals == own->reals &&
                   found->precision == own->precision && found->held == own->held;
    return !lattice ? KN_SNAPSHOT_LATTICE : found->model != own->model ? KN_SNAPSHOT_MATERIAL : KN_SNAPSHOT_FITS;
}

// Write or read one probe.
static void put_probe(const kn_model *m, kn_codec *c, kn_probe_state *p)
{
    kn_codec_f64(c, p->position_m, 3);
    kn_codec_f64(c, p->velocity_m_s, 3);
    kn_codec_f64(c, &p->work_j, 1);
    kn_codec_i32(c, &p->attached, 0, 1);
    kn_codec_i32(c, &p->contacts, 0, m->top_count + kn_contact_samples(m));
}

static void put_tool(kn_codec *c, kn_tool_state *t)
{
    kn_codec_f64(c, t->orientation_wxyz, 4);
    kn_codec_f64(c, t->turn_rad_s, 3);
    kn_codec_f64(c, &t->relief_m, 1);
    kn_codec_f64(c, &t->grip_n, 1);
}

// Write or read a field of the state, preceded by its number of reals.
static void put_field(const kn_model *m, kn_codec *c, void *field, int components)
{
    uint64_t count = components == KN_FORWARD ? m->edge_reals : kn_model_field(m, components), found = count;
    if (!field) count = found = 0;
    kn_codec_u64(c, &found);
    c->wrong |= found != count;
    if (field) kn_codec_reals(c, field, count, kn_model_single(m));
}

// Write or read the anchors. Their keys must ascend, because the contact relies on this order.
static void put_anchors(const kn_model *m, kn_codec *c, kn_state *s)
{
    int64_t most = (int64_t)kn_contact_anchors(m);
    kn_codec_i32(c, &s->anchor_count, 0, (int32_t)(most < INT32_MAX ? most : INT32_MAX));
    for (int i = 0; i < s->anchor_count && !c->ended; i++) {
        kn_anchor *a = &s->anchor[i];
        kn_codec_u64(c, &a->key);
        kn_codec_f64(c, a->stretch_m, 3);
        kn_codec_i64(c, &a->flags, 0, KN_ANCHOR_SLIPS | KN_ANCHOR_BONDS);
        c->wrong |= c->from && i > 0 && a->key <= a[-1].key;
    }
    if (c->ended) s->anchor_count = 0;
}

static void put_held(const kn_model *m, kn_codec *c, kn_state *s)
{
    size_t count = KN_PROBES_MAX * (size_t)m->top_count;
    kn_codec_bytes(c, s->held, count);
    for (size_t i = 0; c->from && i < count; i++) c->wrong |= s->held[i] > 1;
}

// Measure, write or read the whole state.
static void put_state(const kn_model *m, kn_codec *c, kn_state *s)
{
    kn_codec_i64(c, &s->tick, 0, INT64_MAX / 2);
    for (int p = 0; p < KN_PROBES_MAX; p++) put_probe(m, c, &s->probe[p]);
    kn_codec_u64(c, &s->chatter_bits);
    kn_codec_f64(c, &s->last_force_n, 1);
    kn_codec_f64(c, &s->last_delta_n, 1);
    kn_codec_f64(c, &s->residual_scale, 1);
    kn_codec_i64(c, &s->secant_steps, 0, KN_SECANT_REST);
    kn_codec_i32(c, &s->bad, 0, 0);
    for (int p = 0; p < KN_PROBES_MAX; p++) put_tool(c, &s->tool[p]);
#define PUT(name, components) put_field(m, c, s->name, components);
    KN_STATE_FIELDS(PUT)
#undef PUT
    put_held(m, c, s);
    put_anchors(m, c, s);
}

static void put_all(const kn_model *m, kn_codec *c, kn_state *s)
{
    uint64_t layout = LAYOUT;
    identity own = identity_of(m);
    kn_codec_u64(c, &layout);
    put_identity(c, &own);
    put_state(m, c, s);
}

// --- measure, write, read -------------------------------------------------------------------------------------------

// The cast is safe: measuring and writing do not change the state.
size_t kn_snapshot_size(const kn_model *model, const kn_state *state)
{
    kn_codec c = {0};
    put_all(model, &c, (kn_state *)(uintptr_t)state);
    return c.at;
}

// sizeof kn_state is an upper bound for the plain members, because it includes padding and pointers.
size_t kn_snapshot_size_max(const kn_model *model)
{
    size_t plain = sizeof(identity) + sizeof(kn_state) + 64;
    size_t reals = kn_model_field(model, 9) + model->edge_reals;
    return plain + reals * kn_model_real(model) + KN_PROBES_MAX * (size_t)model->top_count +
           kn_contact_anchors(model) * sizeof(kn_anchor);
}

size_t kn_snapshot_write(const kn_model *model, const kn_state *state, uint8_t *bytes, size_t size)
{
    kn_codec c = {.to = bytes, .size = size};
    put_all(model, &c, (kn_state *)(uintptr_t)state);
    return c.wrong ? 0 : c.at;
}

kn_snapshot_fit kn_snapshot_read(const kn_model *model, const uint8_t *bytes, size_t size, kn_state *state)
{
    kn_codec c = {.from = bytes, .size = size};
    uint64_t layout = 0;
    identity found = {0}, own = identity_of(model);
    kn_codec_u64(&c, &layout);
    put_identity(&c, &found);
    // compare the identity before reading anything else
    if (c.ended) return KN_SNAPSHOT_SHORT;
    if (layout != LAYOUT) return KN_SNAPSHOT_LAYOUT;
    kn_snapshot_fit fit = judge(&found, &own);
    if (fit != KN_SNAPSHOT_FITS) return fit;
    put_state(model, &c, state);
    if (c.ended || c.at != size) return KN_SNAPSHOT_SHORT;
    return c.wrong ? KN_SNAPSHOT_VALUE : KN_SNAPSHOT_FITS;
}

// --- differences of two states --------------------------------------------------------------------------------------

// Number of reals that are compared without a branch, so that the compiler can use vector instructions.
#define PIECE 256

static bool moved_f32(const float *a, const float *b, size_t count, double by)
{
    const float most = (float)by;
    for (size_t from = 0; from < count; from += PIECE) {
        size_t to = from + PIECE < count ? from + PIECE : count;
        int far = 0;
        for (size_t i = from; i < to; i++) far |= fabsf(a[i] - b[i]) > most;
        if (far) return true;
    }
    return false;
}

static bool moved_f64(const double *a, const double *b, size_t count, double by)
{
    for (size_t from = 0; from < count; from += PIECE) {
        size_t to = from + PIECE < count ? from + PIECE : count;
        int far = 0;
        for (size_t i = from; i < to; i++) far |= fabs(a[i] - b[i]) > by;
        if (far) return true;
    }
    return false;
}

static bool moved(const kn_model *m, const void *a, const void *b, size_t count, double by)
{
    return kn_model_single(m) ? moved_f32(a, b, count, by) : moved_f64(a, b, count, by);
}

bool kn_state_moved(const kn_model *model, const kn_state *a, const kn_state *b, double by_m)
{
    return moved(model, a->displacement, b->displacement, kn_model_field(model, 3), by_m) ||
           (a->strain && moved(model, a->strain, b->strain, model->edge_reals, by_m / model->def.spacing_m));
}

// --- another material -----------------------------------------------------------------------------------------------

// Return true if two models have equal nodes and edges, at equal places in memory.
static bool same_lattice(const kn_model *a, const kn_model *b)
{
    const kn_model_def *d = &a->def, *e = &b->def;
    size_t nodes = (size_t)a->node_count;
    return a->node_count == b->node_count && a->edge_reals == b->edge_reals && a->top_count == b->top_count &&
           a->row_count == b->row_count && a->stride == b->stride && !a->composite == !b->composite &&
           !d->mesh == !e->mesh && d->thickness_m == e->thickness_m && d->structure == e->structure &&
           d->skin == e->skin && memcmp(a->rest_m, b->rest_m, nodes * sizeof *a->rest_m) == 0 &&
           memcmp(a->offset, b->offset, nodes * sizeof *a->offset) == 0 &&
           memcmp(a->top, b->top, (size_t)a->top_count * sizeof *a->top) == 0;
}

// Return true if two solvers are of one kind and precision. Their effort, such as iterations and tolerance, may differ.
static bool same_method(const kn_solver_def *a, const kn_solver_def *b)
{
    return a->kind == b->kind && a->precision == b->precision;
}

// Return true if two parts of tools are equal. Fields may be large, so their hashes are compared.
static bool same_solid(const kn_solid *a, const kn_solid *b)
{
    bool fields = a->field && b->field;
    return a->kind == b->kind && memcmp(a->half_m, b->half_m, sizeof a->half_m) == 0 && a->radius_m == b->radius_m &&
           a->length_m == b->length_m && memcmp(a->at_m, b->at_m, sizeof a->at_m) == 0 && a->turned == b->turned &&
           memcmp(a->turn, b->turn, sizeof a->turn) == 0 &&
           (fields ? a->field->hash == b->field->hash && a->field->cell_m == b->field->cell_m : a->field == b->field);
}

static bool same_tool(const kn_model *a, const kn_model *b, int p)
{
    const kn_probe_def *d = &a->def.probe[p], *e = &b->def.probe[p];
    if (strcmp(d->name, e->name) != 0 || d->shape != e->shape || memcmp(d->reach_m, e->reach_m, sizeof d->reach_m) != 0)
        return false;
    if (d->shape == KN_PROBE_PLATE) return d->size_m[0] == e->size_m[0] && d->size_m[1] == e->size_m[1];
    const kn_shape *s = &a->shape[p], *t = &b->shape[p];
    bool same = s->part_count == t->part_count;
    for (int i = 0; same && i < s->part_count; i++) same = same_solid(&s->part[i], &t->part[i]);
    return same;
}

static bool same_stops(const kn_law *a, const kn_law *b)
{
    return a->stroke == b->stroke && (!a->stroke || (a->in == b->in && a->out == b->out));
}

const char *kn_carry_misfit(const kn_model *from, const kn_model *to)
{
    const kn_model_def *d = &from->def, *e = &to->def;
    if (!same_lattice(from, to)) return "another lattice";
    if (!same_method(&d->solver, &e->solver)) return "another method or precision";
    if (d->support != e->support || d->pressure != e->pressure) return "another support or pressure";
    if ((from->law.kind == KN_LAW_VOIGT) != (to->law.kind == KN_LAW_VOIGT))
        return "a damper where there was none, or none where there was one";
    if (!same_stops(&from->law, &to->law)) return "other stops of the damper";
    bool tools = d->probe_count == e->probe_count;
    for (int p = 0; tools && p < d->probe_count; p++) tools = same_tool(from, to, p);
    if (!tools) return "another tool";
    if ((kn_contact_anchors(from) > 0) != (kn_contact_anchors(to) > 0))
        return "contact that now sticks, or no longer sticks";
    // with adhesion or grip, contact reaches farther, so the state may need room for more samples
    return kn_contact_samples(from) == kn_contact_samples(to) && kn_state_size(from) == kn_state_size(to)
               ? NULL
               : "contact that reaches farther or less far";
}

static double gamma_of(const kn_model *m) { return m->def.mesh ? m->gamma : m->grid.gamma; }

void kn_carry(const kn_model *from, const kn_state *now, const kn_model *to, kn_state *then)
{
    double share = gamma_of(from) / gamma_of(to);
    kn_state_copy(to, then, now);
    // the extension u gamma L0 stays the same, so the strain u changes by the ratio of the two gammas
    for (size_t e = 0; share != 1 && then->strain && e < to->edge_reals; e++)
        kn_real_set(to, then->strain, e, share * kn_real_get(to, then->strain, e));
}
