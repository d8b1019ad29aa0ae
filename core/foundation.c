#include "core/foundation.h"

#include <math.h>
#include <string.h>

// The samples from `first` on that share their nodes.
typedef struct patch {
    kn_sample *sample;
    int count;
    double x[9][3];     // of a field, at the nodes
    double add[9][3];   // what is added to another
    double block[9][6]; // xx xy xz yy yz zz
} patch;

static bool same_nodes(const kn_sample *a, const kn_sample *b)
{
    return a->probe == b->probe && a->face == b->face && a->offset[0] == b->offset[0] && a->offset[4] == b->offset[4] &&
           a->offset[8] == b->offset[8];
}

static void fetch(const kn_model *m, const void *field, patch *p)
{
    for (size_t a = 0; a < 9; a++) {
        size_t o = p->sample->offset[a];
        for (size_t k = 0; k < 3; k++) p->x[a][k] = kn_real_get(m, field, o + k * m->stride);
    }
}

// The patch behind `from`, with the field at its nodes and nothing to add; false behind the last one.
static bool next_patch(const kn_model *m, const kn_contact *contact, const void *field, int from, patch *p)
{
    if (from >= contact->sample_count) return false;
    p->sample = &contact->sample[from];
    p->count = 1;
    while (from + p->count < contact->sample_count && same_nodes(p->sample, p->sample + p->count)) p->count++;
    fetch(m, field, p);
    memset(p->add, 0, sizeof p->add);
    return true;
}

static void add_to(const kn_model *m, void *field, const patch *p)
{
    for (size_t a = 0; a < 9; a++)
        for (size_t k = 0; k < 3; k++)
            if (p->add[a][k] != 0) kn_real_add(m, field, p->sample->offset[a] + k * m->stride, p->add[a][k]);
}

static void add_blocks(const kn_model *m, void *field, const patch *p)
{
    for (size_t a = 0; a < 9; a++) {
        size_t o = p->sample->offset[a], first = o / (3 * m->stride) * 6 * m->stride + o % (3 * m->stride);
        for (size_t c = 0; c < 6; c++) // same row and lane, 6 components
            if (p->block[a][c] != 0) kn_real_add(m, field, first + c * m->stride, p->block[a][c]);
    }
}

// Along the sphere's push, of the skin at the sample.
static double rate_of(const kn_sample *s, const patch *p)
{
    double v[3] = {0};
    for (int a = 0; a < 9; a++)
        for (int k = 0; k < 3; k++) v[k] += s->weight[a] * p->x[a][k];
    return s->normal[0] * v[0] + s->normal[1] * v[1] + s->normal[2] * v[2];
}

// At the end of a step at the velocities of the patch.
static double end_depth(const kn_model *m, const kn_state *state, const kn_sample *s, const patch *p)
{
    const double *v = state->probe[s->probe].velocity_m_s;
    double sphere = s->normal[0] * v[0] + s->normal[1] * v[1] + s->normal[2] * v[2];
    return s->depth_m - m->def.solver.dt_s * (rate_of(s, p) - sphere);
}

static void push(const kn_sample *s, double force_n, patch *p)
{
    double f[3];
    for (int k = 0; k < 3; k++) f[k] = force_n * s->normal[k];
    for (int a = 0; a < 9; a++)
        for (int k = 0; k < 3; k++) p->add[a][k] += s->weight[a] * f[k];
}

static void stiffen(const kn_sample *s, double stiffness, patch *p)
{
    double nn[6];
    for (int i = 0, c = 0; i < 3; i++)
        for (int k = i; k < 3; k++, c++) nn[c] = stiffness * s->normal[i] * s->normal[k];
    for (int a = 0; a < 9; a++)
        for (int c = 0; c < 6; c++) p->block[a][c] += s->weight[a] * s->weight[a] * nn[c];
}

void kn_foundation_push(const kn_model *model, kn_state *state, kn_scratch *scratch)
{
    patch p;
    for (int i = 0; next_patch(model, &scratch->contact, scratch->work.guess, i, &p); i += p.count) {
        memset(p.block, 0, sizeof p.block);
        for (kn_sample *s = p.sample; s < p.sample + p.count; s++) {
            double depth = end_depth(model, state, s, &p);
            s->active = depth > 0;
            if (!s->active) continue;
            push(s, s->stiffness_n_m * depth, &p);
            stiffen(s, model->def.solver.dt_s * s->stiffness_n_m, &p);
        }
        add_to(model, scratch->work.r, &p);
        add_blocks(model, scratch->work.p, &p);
    }
}

double kn_foundation_apply(const kn_model *model, kn_scratch *scratch)
{
    patch p;
    double sum = 0;
    for (int i = 0; next_patch(model, &scratch->contact, scratch->work.d, i, &p); i += p.count) {
        for (const kn_sample *s = p.sample; s < p.sample + p.count; s++) {
            if (!s->active) continue;
            double rate = rate_of(s, &p), force = model->def.solver.dt_s * s->stiffness_n_m * rate;
            push(s, force, &p);
            sum += force * rate;
        }
        add_to(model, scratch->work.q, &p);
    }
    return sum;
}

int kn_foundation_change(const kn_model *model, kn_state *state, kn_scratch *scratch)
{
    patch p;
    int changed = 0;
    for (int i = 0; next_patch(model, &scratch->contact, scratch->work.guess, i, &p); i += p.count) {
        int before = changed;
        for (kn_sample *s = p.sample; s < p.sample + p.count; s++) {
            double depth = end_depth(model, state, s, &p), force = s->stiffness_n_m * depth;
            if ((depth > 0) == s->active) continue;
            push(s, s->active ? -force : force, &p);
            s->active = !s->active;
            changed++;
        }
        if (changed > before) add_to(model, scratch->work.r, &p);
    }
    return changed;
}

void kn_foundation_read(const kn_model *model, kn_state *state, kn_scratch *scratch)
{
    patch p;
    for (int i = 0; next_patch(model, &scratch->contact, scratch->work.guess, i, &p); i += p.count)
        for (kn_sample *s = p.sample; s < p.sample + p.count; s++)
            s->force_n = s->active ? fmax(0, s->stiffness_n_m * end_depth(model, state, s, &p)) : 0;
}
