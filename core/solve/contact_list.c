#include "core/solve/contact_list.h"
#include "core/algebra/algebra.h"

#include <math.h>
#include <string.h>

#define SAMPLES_MAX (KN_PATCH_SIDE_MAX * KN_PATCH_SIDE_MAX)
_Static_assert(SAMPLES_MAX <= KN_LANES, "the samples of a patch are the lanes of a vector");

// --- sizes ----------------------------------------------------------------------------------------------------------

int kn_samples_per_patch(double spacing_m, double fine_m)
{
    return (int)fmin(fmax(ceil(8 * spacing_m / fine_m - 1e-9), 2), KN_PATCH_SIDE_MAX);
}

// Distance from the tool up to which a gripped sample is found, m. No grip is strong enough to stretch a contact as far
// as this.
#define GRIP_M 0.002

double kn_contact_margin(const kn_model *model, const kn_probe_def *def)
{
    return 0.1 * model->def.spacing_m + def->adhesion_pa / kn_probe_foundation(def) + (def->grip_n > 0 ? GRIP_M : 0);
}

// Return an upper bound of the number of patches of all tools, and store that of their samples. It assumes that the
// lower half of every tool is pressed into the skin, with a margin of one patch, or of two at the rim, where patches
// hold few samples. The ball around a tool's shape stands for the tool.
static int tool_patches(const kn_model *model, double *samples)
{
    double count = 0, h = model->def.spacing_m, all = model->skin_count;
    *samples = 0;
    for (int f = 0; f < model->face_count; f++) all += (double)model->face[f].len[0] * model->face[f].len[1];
    for (int p = 0; p < model->def.probe_count; p++) {
        const kn_shape *shape = &model->shape[p];
        if (model->def.probe[p].shape == KN_PROBE_PLATE) continue;
        const double reach = (shape->bound_m + kn_contact_margin(model, &model->def.probe[p])) / h;
        const double per = kn_samples_per_patch(model->composite ? INFINITY : h, shape->fine_m);
        count += fmin(2 * 3.1416 * (reach + 2) * (reach + 2), all);
        *samples += per * per * fmin(2 * 3.1416 * (reach + 1) * (reach + 1), all);
    }
    return (int)fmin(count, 1e7);
}

int kn_contact_samples(const kn_model *model)
{
    double samples;
    tool_patches(model, &samples);
    return (int)fmin(model->base_count + samples, 1e8);
}

// Return true if the samples of this tool need anchors, because its contact sticks (friction, adhesion or grip).
static bool sticks(const kn_probe_def *def)
{
    return def->shape != KN_PROBE_PLATE && (def->friction > 0 || def->adhesion_pa > 0 || def->grip_n > 0);
}

size_t kn_contact_anchors(const kn_model *model)
{
    bool any = model->def.support == KN_SUPPORT_FRICTION && model->def.support_friction > 0;
    for (int p = 0; p < model->def.probe_count; p++) any |= sticks(&model->def.probe[p]);
    return any ? (size_t)kn_contact_samples(model) : 0;
}

// Return the number of reals of kn_contact_patch.lanes for a number of nodes and samples.
static size_t lane_reals(int nodes, int samples) { return (size_t)(KN_CONTACT_WEIGHT + nodes + samples) * KN_LANES; }

// Divide the memory at `base` among the lists, and return its size. If `base` is NULL, only measure.
static size_t layout(const kn_model *model, kn_contact *contact, char *base)
{
    double samples;
    const int patches = tool_patches(model, &samples), nodes = model->skin_count > 0 ? 3 : 9;
    *contact = (kn_contact){.hold_max = model->top_count,
                            .sample_max = kn_contact_samples(model),
                            .patch_max = model->base_count + patches};
    const size_t lanes = kn_model_real(model) * ((size_t)model->base_count * lane_reals(1, 1) +
                                                 (size_t)patches * lane_reals(nodes, SAMPLES_MAX));
    const size_t patch = lanes + (size_t)contact->sample_max * sizeof(kn_sample);
    const size_t hold = patch + (size_t)contact->patch_max * sizeof(kn_contact_patch);
    if (base) {
        contact->lanes = contact->lanes_free = base;
        contact->sample = (kn_sample *)(void *)(base + lanes);
        contact->patch = (kn_contact_patch *)(void *)(base + patch);
        contact->hold = (kn_held_node *)(void *)(base + hold);
    }
    return hold + (size_t)contact->hold_max * sizeof(kn_held_node);
}

size_t kn_contact_bytes(const kn_model *model)
{
    kn_contact unused;
    return layout(model, &unused, NULL);
}

void kn_contact_init(const kn_model *model, kn_contact *contact, void *memory) { layout(model, contact, memory); }

void kn_contact_clear(kn_contact *contact)
{
    contact->hold_count = contact->sample_count = contact->patch_count = 0;
    contact->lanes_free = contact->lanes;
}

// --- patches --------------------------------------------------------------------------------------------------------

kn_contact_patch *kn_contact_patch_begin(const kn_model *model, kn_contact *contact, int probe, int nodes,
                                         const int *node, int samples)
{
    const size_t bytes = kn_model_real(model) * lane_reals(nodes, samples);
    const size_t room = (size_t)((char *)contact->sample - contact->lanes_free);
    if (contact->patch_count == contact->patch_max || bytes > room) return NULL;
    kn_contact_patch *p = &contact->patch[contact->patch_count];
    *p = (kn_contact_patch){.probe = probe, .first = contact->sample_count, .nodes = nodes};
    p->lanes = contact->lanes_free;
    for (int a = 0; a < nodes; a++) {
        p->node[a] = node[a];
        p->offset[a] = model->offset[node[a]];
    }
    memset(p->lanes, 0, kn_model_real(model) * lane_reals(nodes, 0));
    contact->lanes_free += bytes;
    contact->patch_count++;
    return p;
}

kn_sample *kn_sample_begin(kn_contact *contact, kn_contact_patch *patch)
{
    if (!patch || contact->sample_count >= contact->sample_max) {
        contact->samples_lost++;
        return NULL;
    }
    kn_sample *s = &contact->sample[contact->sample_count++];
    *s = (kn_sample){.probe = patch->probe, .patch = patch};
    patch->count++;
    return s;
}

// Store a sample in lane l of its patch p. This macro holds the source for both precisions.
#define LANE(real)                                                                                                     \
    real *to = (real *)p->lanes + l, *spread = (real *)p->lanes + lane_reals(p->nodes, (int)l);                        \
    for (int k = 0; k < 3; k++) {                                                                                      \
        to[(KN_CONTACT_NORMAL + k) * KN_LANES] = (real)s->normal[k];                                                   \
        to[(KN_CONTACT_ARM + k) * KN_LANES] = (real)s->arm_m[k];                                                       \
    }                                                                                                                  \
    memset(spread, 0, KN_LANES * sizeof *spread);                                                                      \
    for (int a = 0; a < p->nodes; a++) {                                                                               \
        to[(KN_CONTACT_WEIGHT + a) * KN_LANES] = (real)s->weight[a];                                                   \
        spread[a] = (real)s->weight[a];                                                                                \
    }

void kn_sample_end(const kn_model *model, kn_contact *contact, kn_sample *s)
{
    const kn_contact_patch *p = s->patch;
    const ptrdiff_t l = s - contact->sample - p->first;
    if (kn_model_single(model)) {
        LANE(float)
    } else {
        LANE(double)
    }
}

void kn_sample_velocity(const kn_model *model, const kn_sample *s, const void *field, double v_m_s[3])
{
    for (size_t k = 0; k < 3; k++) {
        v_m_s[k] = 0;
        for (int a = 0; a < s->patch->nodes; a++)
            v_m_s[k] += s->weight[a] * kn_real_get(model, field, s->patch->offset[a] + k * model->stride);
    }
}
