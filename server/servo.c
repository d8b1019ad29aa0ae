#include "server/servo.h"
#include "core/algebra/algebra.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_event_t.h"
#include "proto/knead_probe_pose_t.h"
#include <assert.h>
#include <string.h>

#define SAME_FLAG(name)                                                                                                \
    static_assert(KN_FLAG_##name == KNEAD_CONTACT_FORCE_T_FLAG_##name,                                                 \
                  "core and contact_force_t give this flag the same number")
#define SAME_FAULT(name)                                                                                               \
    static_assert((int)KN_FAULT_##name == KNEAD_CONTACT_FORCE_T_FAULT_##name,                                          \
                  "core and contact_force_t give this fault the same number")
SAME_FLAG(ENGAGED);
SAME_FLAG(RAMPING);
SAME_FLAG(LATCHED);
SAME_FLAG(REENGAGE_LIFT);
SAME_FLAG(CLAMPED);
SAME_FLAG(GUARD);
SAME_FLAG(BRAKE);
SAME_FLAG(STALE);
static_assert(KN_QUALITY_FAST == 0 && KN_QUALITY_OWN == 3, "numbers of KIND_QUALITY");
static_assert(KN_BUTTON_LEAVING == KNEAD_PROBE_POSE_T_BUTTON_LEAVING, "the same bit");
SAME_FAULT(NONE);
SAME_FAULT(POSE_SILENCE);
SAME_FAULT(IMPULSE);
SAME_FAULT(NONFINITE);
SAME_FAULT(ESTOP);
SAME_FAULT(STOPPING);
SAME_FAULT(OVERLOAD);
static_assert(KN_EVENTS_PER_TICK >= 5 * KN_PROBES_MAX + 12, "the array has room for all events of a tick");

void kn_servo_init(kn_servo *servo, const kn_scene *scene, const kn_model *model, kn_backend *backend)
{
    memset(servo, 0, sizeof *servo);
    servo->scene = scene;
    servo->model = model;
    servo->backend = backend;
    servo->quality = servo->asked = scene->quality;
    for (int p = 0; p < KN_PROBES_MAX; p++) kn_safety_init(&servo->safety[p], &scene->limits);
}

void kn_servo_begin(kn_servo *servo, const kn_state *settled)
{
    servo->settled = settled;
    servo->untouched = settled;
    if (!settled) return;
    servo->backend->restore(servo->backend->self, settled);
}

// The solver iterates until the tolerance is met, within two limits: the smallest and the largest number of iterations.
// An effort is certain to be cheaper only if it raises neither limit.
bool kn_servo_cheaper(const kn_effort *a, const kn_effort *b)
{
    int least = a->passes * a->iterations - b->passes * b->iterations;
    int most = a->passes * a->iterations_max - b->passes * b->iterations_max;
    return least <= 0 && most <= 0 && (least < 0 || most < 0);
}

kn_event *kn_tick_event(kn_tick *t, int kind, int probe)
{
    kn_servo *servo = t->servo;
    // compute the hash once per tick, and only for ticks with an event; the step changes the state, so a later hash
    // would differ
    if (!t->hashed && !t->stepped) {
        t->hash = kn_state_hash(servo->model, servo->backend->state(servo->backend->self));
        t->hashed = true;
    }
    kn_event *e = &t->out->event[t->out->event_count++];
    *e = (kn_event){.tick = t->in->tick, .kind = kind, .probe = probe, .state_hash = t->hash};
    if (probe >= 0) e->session = servo->last[probe].session;
    return e;
}

// --- clutch ---

void kn_clutch_open(kn_clutch *clutch) { *clutch = (kn_clutch){.turn_wxyz = {1, 0, 0, 0}}; }

// Compute the offset from the device's pose to the pose at which the tool stays. The translation is in the axes of the
// room. The rotation is in the device's own axes. When the device later turns about an axis of the room, the tool turns
// about the same axis.
static void take_offset(kn_clutch *clutch, const kn_pose *device)
{
    for (int k = 0; k < 3; k++) clutch->offset_m[k] = clutch->stays_m[k] - device->position_m[k];
    const double *q = device->orientation_wxyz, back[4] = {q[0], -q[1], -q[2], -q[3]};
    kn_turn_multiply(back, clutch->stays_wxyz, clutch->turn_wxyz);
}

void kn_clutch_move(kn_clutch *clutch, const kn_pose *device, kn_pose *tool)
{
    bool held = device->buttons & KN_BUTTON_CLUTCH;
    // The clutch was released, so from now on the tool follows the device with the new offset.
    if (!held && clutch->held) take_offset(clutch, device);
    *tool = *device;
    for (int k = 0; k < 3; k++) tool->position_m[k] += clutch->offset_m[k];
    double turned[4];
    kn_turn_multiply(device->orientation_wxyz, clutch->turn_wxyz, turned);
    kn_turn_unit(turned, tool->orientation_wxyz);
    // The clutch was pressed, so remember the tool's pose.
    if (held && !clutch->held) {
        memcpy(clutch->stays_m, tool->position_m, sizeof clutch->stays_m);
        memcpy(clutch->stays_wxyz, tool->orientation_wxyz, sizeof clutch->stays_wxyz);
    }
    clutch->held = held;
    if (!held) return;
    // While the clutch is held, keep the tool at the remembered pose.
    memcpy(tool->position_m, clutch->stays_m, sizeof tool->position_m);
    memcpy(tool->orientation_wxyz, clutch->stays_wxyz, sizeof tool->orientation_wxyz);
    memset(tool->velocity_m_s, 0, sizeof tool->velocity_m_s);
}
