#include "core/carry.h"
#include "core/contact.h"
#include "core/field.h"
#include "core/kernel.h"
#include "core/sampling.h"
#include "core/shape.h"

#include <string.h>

// Return true if the two lattices have the same nodes and edges in the same places of memory.
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

// Compare the step methods. Settings of effort, such as iterations and tolerance, may differ.
static bool same_method(const kn_solver_def *a, const kn_solver_def *b)
{
    return a->kind == b->kind && a->precision == b->precision;
}

// Compare shapes by value. Fields may be large, so compare them by their hash.
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
    // adhesion and grip reach farther, so there may be more samples
    return kn_sampling_max(from) == kn_sampling_max(to) && kn_state_kept(from) == kn_state_kept(to)
               ? NULL
               : "contact of another range";
}

static double gamma_of(const kn_model *m) { return m->def.mesh ? m->gamma : m->grid.gamma; }

void kn_carry(const kn_model *from, const kn_state *now, const kn_model *to, kn_state *then)
{
    double share = gamma_of(from) / gamma_of(to);
    kn_state_copy(to, then, now);
    // the extension u gamma L0 is kept, so the strain u changes by the ratio of the two gammas
    for (size_t e = 0; share != 1 && then->strain && e < to->edge_reals; e++)
        kn_real_set(to, then->strain, e, share * kn_real_get(to, then->strain, e));
}
