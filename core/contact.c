#include "core/contact.h"
#include "core/kernel.h"
#include "core/sampling.h"
#include "core/vec.h"

#include <math.h>
#include <string.h>

// Return true if contact with this tool sticks (friction, adhesion or grip), so that its samples need anchors.
static bool sticks(const kn_probe_def *def) { return def->friction > 0 || def->adhesion_pa > 0 || def->grip_n > 0; }

size_t kn_contact_anchors(const kn_model *model)
{
    bool any = model->def.support == KN_SUPPORT_FRICTION && model->def.support_friction > 0;
    for (int p = 0; p < model->def.probe_count; p++) any |= sticks(&model->def.probe[p]);
    return any ? (size_t)kn_sampling_max(model) : 0;
}

size_t kn_contact_bytes(const kn_model *model)
{
    return (size_t)model->top_count * sizeof(kn_hold) + (size_t)kn_sampling_max(model) * sizeof(kn_sample);
}

void kn_contact_init(const kn_model *model, kn_contact *contact, void *memory)
{
    *contact = (kn_contact){.hold_max = model->top_count, .sample_max = kn_sampling_max(model)};
    contact->sample = memory;
    contact->hold = (kn_hold *)(void *)(contact->sample + contact->sample_max);
}

// --- plate ----------------------------------------------------------------------------------------------------------

// Return whether a point is under the plate. The slack keeps a node at the plate's very edge under it, whatever the
// last digits of its position are.
static bool under_plate(const kn_model *model, const kn_probe_def *def, const double plate[3], const double x[3])
{
    double slack = 0.1 * model->def.spacing_m;
    return fabs(x[0] - plate[0]) <= 0.5 * def->size_m[0] + slack &&
           fabs(x[1] - plate[1]) <= 0.5 * def->size_m[1] + slack;
}

// Return whether another plate holds the top node t. The first plate that touches a node holds it.
static bool held_by_other(const kn_model *model, const kn_state *state, int p, int t)
{
    for (int q = 0; q < model->def.probe_count; q++)
        if (q != p && state->held[(size_t)q * (size_t)model->top_count + (size_t)t]) return true;
    return false;
}

// Return true if a node ahead of the plate moves away from the plate by itself. If such a node were held, a plate that
// slows down would take back nodes that it has just released. A node that was held may overlap the plate only by the
// rounding of its displacement. Such a node is also not held again.
#define ROUNDING 0x1p-20
static bool gets_away(double above, double way, double displacement)
{
    return above + way <= ROUNDING * fabs(displacement);
}

// List the nodes that plate p holds in this step: those held already, and those that it meets now.
static void find_holds(const kn_model *model, kn_state *state, int p, kn_contact *contact)
{
    const kn_probe_state *probe = &state->probe[p];
    // plane: height of the plate at the end of the step
    double dt = model->def.solver.dt_s, plane = probe->position_m[2] + dt * probe->velocity_m_s[2];
    uint8_t *held = state->held + (size_t)p * (size_t)model->top_count;
    for (int t = 0; t < model->top_count; t++) {
        kn_hold hold = {.node = model->top[t], .top = t, .probe = p};
        memcpy(hold.velocity_m_s, probe->velocity_m_s, sizeof hold.velocity_m_s);
        if (!held[t]) {
            // a new node must be under the plate and in its path, and must not move away by itself
            double x[3], v[3];
            kn_state_position(model, state, hold.node, x);
            if (x[2] <= plane || !under_plate(model, &model->def.probe[p], probe->position_m, x)) continue;
            kn_state_velocity(model, state, hold.node, v);
            if (gets_away(x[2] - plane, dt * v[2], x[2] - model->rest_m[hold.node][2])) continue;
            // If a node is deeper inside the plate than this step can bring it, the node came in from the side and rose
            // beside the plate. Under a plate that goes up, a node is not held if it is deeper than its own motion can
            // have brought it. Otherwise the plate would push it down by a quarter of a cell.
            double down = fmax(0, -probe->velocity_m_s[2]);
            double came = dt * fmax(0, v[2] - probe->velocity_m_s[2]), h = model->def.spacing_m;
            double deepest = probe->velocity_m_s[2] > 0 ? 2 * came + 1e-3 * h : 0.25 * h + dt * down;
            if (x[2] - plane > deepest || held_by_other(model, state, p, t)) continue;
            // first touch: the node only moves out of the way, by the part of the plate's step that is left
            hold.velocity_m_s[2] = (plane - x[2]) / dt;
            held[t] = 1;
        }
        if (contact->hold_count < contact->hold_max) contact->hold[contact->hold_count++] = hold;
    }
}

// --- anchors of sticking samples ------------------------------------------------------------------------------------

// Restore the memory of a sample from the last step. The stretch e turns with its tool and
// stays tangential to the skin.
static void recall(const kn_model *model, const kn_contact *contact, const kn_anchor *anchor, kn_sample *s)
{
    double turned[3] = {0};
    s->bonds = anchor->flags & KN_ANCHOR_BONDS;
    // a sample that did not slip has static friction, which is larger than sliding friction
    if (!(anchor->flags & KN_ANCHOR_SLIPS) && s->friction > 0) s->friction *= KN_STICTION;
    if (s->probe != KN_TABLE) kn_cross(contact->tool[s->probe].velocity + 3, anchor->stretch_m, turned);
    for (int k = 0; k < 3; k++) s->stretch_m[k] = anchor->stretch_m[k] + model->def.solver.dt_s * turned[k];
    double out = kn_dot(s->stretch_m, s->normal);
    for (int k = 0; k < 3; k++) s->stretch_m[k] -= out * s->normal[k];
}

// Restore the memory of all samples. Anchors and samples are both in ascending order of their
// keys, so one merge is enough.
static void recall_all(const kn_model *model, const kn_state *state, kn_contact *contact)
{
    int at = 0;
    for (int i = 0; i < contact->sample_count; i++) {
        kn_sample *s = &contact->sample[i];
        while (at < state->anchor_count && state->anchor[at].key < s->key) at++;
        if (at < state->anchor_count && state->anchor[at].key == s->key) recall(model, contact, &state->anchor[at], s);
        else if (s->friction > 0) s->friction *= KN_STICTION;
        if (s->probe == KN_TABLE || !s->bonds) continue;
        const kn_probe_def *def = &model->def.probe[s->probe];
        // contact that touched in the last step may pull up to its adhesion; a gripped sample may pull without limit
        s->lowest_m = -def->adhesion_pa / kn_probe_foundation(def);
        if (state->tool[s->probe].grip_n > 0) s->lowest_m = -INFINITY, s->friction = INFINITY;
    }
}

// Store the anchor of a pressing sample. The stretch is computed from the tangential force, so it lies on the friction
// cone at most.
static void remember(kn_state *state, const kn_sample *s)
{
    kn_anchor *a = &state->anchor[state->anchor_count++];
    *a = (kn_anchor){.key = s->key, .flags = KN_ANCHOR_BONDS};
    if (!(s->friction > 0)) return;
    double full = s->foundation_n_m;
    if (s->line.side_n_m < full) a->flags |= KN_ANCHOR_SLIPS;
    for (int k = 0; k < 3; k++) a->stretch_m[k] = -(s->force_n[k] - s->pressing_n * s->normal[k]) / full;
}

static void remember_all(kn_state *state, const kn_contact *contact)
{
    state->anchor_count = 0;
    if (!state->anchor) return;
    for (int i = 0; i < contact->sample_count; i++)
        if (contact->sample[i].line.active) remember(state, &contact->sample[i]);
}

// --- the step's two ends --------------------------------------------------------------------------------------------

double kn_sample_gap_rate(const kn_model *model, const kn_contact *contact, const kn_sample *s, const void *field)
{
    size_t stride = model->stride;
    double v[3] = {0};
    if (s->probe != KN_TABLE) kn_tool_velocity(&contact->tool[s->probe], s->arm_m, v);
    double rate = -kn_dot(s->normal, v);
    for (int a = 0; a < s->nodes; a++)
        for (size_t k = 0; k < 3; k++)
            rate += s->weight[a] * s->normal[k] * kn_real_get(model, field, s->offset[a] + k * stride);
    return rate;
}

// Shrink a tool that enters the model inside the object by its depth in the object. The tool grows back slowly.
static void relieve(kn_state *state, int p, kn_contact *contact, int first)
{
    double deepest = 0;
    for (int i = first; i < contact->sample_count; i++) deepest = fmax(deepest, contact->sample[i].depth_m);
    for (int i = first; i < contact->sample_count; i++) contact->sample[i].depth_m -= deepest;
    state->tool[p].relief_m = deepest;
}

void kn_sample_push(kn_sample *s)
{
    s->pressing_n = fmax(0, s->foundation_n_m * s->depth_m);
    s->line.active = s->pressing_n > 0;
    for (int k = 0; k < 3; k++) s->force_n[k] = s->pressing_n * s->normal[k];
}

void kn_contact_find(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact)
{
    // the table first, then every tool: sample keys ascend in this order
    contact->hold_count = contact->sample_count = 0;
    contact->coupled = false;
    kn_sampling_table(model, state, contact);
    for (int p = 0; p < model->def.probe_count; p++) {
        bool was = state->probe[p].attached;
        kn_tool_begin(model, state, p, &input->probe[p], &contact->tool[p]);
        if (!state->probe[p].attached) {
            // a plate that is not attached holds nothing
            memset(state->held + (size_t)p * (size_t)model->top_count, 0, (size_t)model->top_count);
            continue;
        }
        contact->coupled |= contact->tool[p].coupled;
        int first = contact->sample_count;
        if (model->def.probe[p].shape == KN_PROBE_PLATE) find_holds(model, state, p, contact);
        else kn_sampling_find(model, state, p, contact);
        if (!was && contact->tool[p].coupled) relieve(state, p, contact, first);
    }
    if (state->anchor) recall_all(model, state, contact);
}

// Add a force at `arm` from the tool's position to the output of a probe.
static void add_force(kn_probe_output *out, const double arm[3], const double force[3])
{
    double torque[3];
    kn_cross(arm, force, torque);
    for (int k = 0; k < 3; k++) out->force_n[k] += force[k], out->torque_n_m[k] += torque[k];
    out->contacts++;
}

static void end_hold(const kn_model *model, kn_state *state, const kn_hold *hold, kn_output *output)
{
    // The work follows the node's own motion, which differs from the plate's at first touch. Work is also done on a
    // node that pulls.
    state->probe[hold->probe].work_j -= model->def.solver.dt_s * kn_dot(hold->force_n, hold->velocity_m_s);
    // a held node that pulls at the plate is released
    if (hold->gone || !(hold->force_n[2] >= 0)) {
        state->held[(size_t)hold->probe * (size_t)model->top_count + (size_t)hold->top] = 0;
        return;
    }
    double arm[3];
    kn_state_position(model, state, hold->node, arm);
    for (int k = 0; k < 3; k++) arm[k] -= state->probe[hold->probe].position_m[k];
    add_force(&output->probe[hold->probe], arm, hold->force_n);
}

static void end_sample(const kn_model *model, kn_state *state, const kn_contact *contact, const kn_sample *s,
                       kn_output *output, double held_n[KN_PROBES_MAX][3])
{
    double force[3], v[3];
    if (s->probe == KN_TABLE || !s->line.active) return;
    kn_tool_velocity(&contact->tool[s->probe], s->arm_m, v);
    double *work = &state->probe[s->probe].work_j, dt = model->def.solver.dt_s;
    // add the work of the pressure, of the friction, and of a tool that grows back
    *work += dt * s->pressing_n * kn_dot(s->normal, v);
    if (s->friction > 0) *work += dt * (kn_dot(s->force_n, v) - s->pressing_n * kn_dot(s->normal, v));
    if (contact->tool[s->probe].growth_m_s > 0) *work += dt * s->pressing_n * contact->tool[s->probe].growth_m_s;
    for (int k = 0; k < 3; k++) force[k] = -s->force_n[k];
    add_force(&output->probe[s->probe], s->arm_m, force);
    // held_n: force that adhesion, friction and grip transmit, without the pressure
    for (int k = 0; k < 3; k++) held_n[s->probe][k] += s->force_n[k] - fmax(0, s->pressing_n) * s->normal[k];
}

static void end_tool(const kn_model *model, kn_state *state, int p, const kn_tool_step *tool, const double held_n[3],
                     kn_probe_output *out)
{
    kn_probe_state *probe = &state->probe[p];
    kn_tool_state *own = &state->tool[p];
    if (!probe->attached) return;
    // if the limit of a grip is exceeded, the grip is torn loose until the client asks for `grip` again
    if (own->grip_n > 0 && kn_dot(held_n, held_n) > own->grip_n * own->grip_n) own->grip_n = -1;
    probe->contacts = out->contacts;
    kn_tool_advance(model, state, p, tool);
    memcpy(out->position_m, probe->position_m, sizeof out->position_m);
    if (kn_tool_turns(&model->def.probe[p]))
        memcpy(out->orientation_wxyz, own->orientation_wxyz, sizeof out->orientation_wxyz);
    out->work_j = probe->work_j;
}

void kn_contact_end(const kn_model *model, kn_state *state, const kn_input *input, kn_contact *contact,
                    kn_output *output)
{
    double held_n[KN_PROBES_MAX][3] = {{0}};
    // a probe that is not attached gets the position of its pose as the output position
    for (int p = 0; p < model->def.probe_count; p++) {
        memcpy(output->probe[p].position_m, input->probe[p].position_m, sizeof output->probe[p].position_m);
        output->probe[p].orientation_wxyz[0] = 1;
    }
    for (int i = 0; i < contact->hold_count; i++) end_hold(model, state, &contact->hold[i], output);
    for (int i = 0; i < contact->sample_count; i++)
        end_sample(model, state, contact, &contact->sample[i], output, held_n);
    remember_all(state, contact);
    for (int p = 0; p < model->def.probe_count; p++)
        end_tool(model, state, p, &contact->tool[p], held_n[p], &output->probe[p]);
}

// --- clearance ------------------------------------------------------------------------------------------------------

double kn_clearance(const kn_model *model, const kn_state *state, int p, const double position_m[3],
                    const double orientation_wxyz[4])
{
    const kn_probe_def *def = &model->def.probe[p];
    double clear = INFINITY, x[3], turn[3][3];
    // every shape but a plate is measured by its distance function at the skin
    if (def->shape != KN_PROBE_PLATE) {
        kn_tool_matrix(orientation_wxyz, turn);
        return kn_sampling_clearance(model, state, p, position_m, (const double(*)[3])turn);
    }
    // for a plate: the least height above the top nodes under the plate
    for (int t = 0; t < model->top_count; t++) {
        kn_state_position(model, state, model->top[t], x);
        if (under_plate(model, def, position_m, x)) clear = fmin(clear, position_m[2] - x[2]);
    }
    return clear;
}
