#include "core/state.h"
#include "core/hash.h"

#include <string.h>

size_t kn_state_field(const kn_model *m, int components)
{
    if (components != KN_FORWARD) return kn_model_field(m, components) * kn_model_real(m);
    // Size of the field `strain`. Without a damper, the strain of the Voigt element follows from the edge's length, so
    // it is not stored. Only the integer solver always stores the strain, because it sums the strain up step by step.
    const bool read_off = m->law.kind == KN_LAW_VOIGT && m->def.solver.kind != KN_SOLVER_FIXED;
    return read_off ? 0 : m->edge_reals * kn_model_real(m);
}

void kn_state_copy(const kn_model *model, kn_state *dst, const kn_state *src)
{
    memcpy(dst, src, offsetof(kn_state, displacement));
#define KN_FIELD(name, components)                                                                                     \
    if (src->name) memcpy(dst->name, src->name, kn_state_field(model, components));
    KN_STATE_FIELDS(KN_FIELD)
#undef KN_FIELD
    memcpy(dst->held, src->held, KN_PROBES_MAX * (size_t)model->top_count);
    if (src->anchor) memcpy(dst->anchor, src->anchor, (size_t)src->anchor_count * sizeof *src->anchor);
}

// Hash the states of tools that are not all 0 (tools that turn, are coupled or stick) and the anchors. A scene without
// such tools adds nothing to the hash.
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
    // hash the members from `probe` to `bad`, then the fields, held nodes, tools and anchors
    size_t from = offsetof(kn_state, probe), to = offsetof(kn_state, bad) + sizeof state->bad;
    uint64_t h = kn_hash_bytes(KN_HASH_SEED, (const char *)state + from, to - from);
#define KN_FIELD(name, components)                                                                                     \
    if (state->name) h = kn_hash_bytes(h, state->name, kn_state_field(model, components));
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
