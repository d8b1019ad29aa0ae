#include "server/wire.h"
#include "server/bus.h"
#include <math.h>
#include <string.h>

void kn_wire_force(knead_contact_force_t *message, const kn_tick_out *tick, int probe, int64_t utime,
                   int64_t execution_ns)
{
    const kn_force *f = &tick->force[probe];
    *message = (knead_contact_force_t){
        .utime = utime,
        .session = f->session,
        .seq = f->seq,
        .sent_ns = f->sent_ns,
        .tick = tick->tick,
        .execution_ns = execution_ns,
        .gain = f->gain,
        .energy_j = f->energy_j,
        .residual = f->residual,
        .missed_cycles = tick->missed,
        .contacts = f->contacts,
        .flags = f->flags,
        .fault = f->fault,
        .frame = KNEAD_PROBE_POSE_T_FRAME_SCENE,
    };
    memcpy(message->contact_force_n, f->contact_force_n, sizeof message->contact_force_n);
    memcpy(message->contact_torque_n_m, f->contact_torque_n_m, sizeof message->contact_torque_n_m);
    memcpy(message->force_n, f->force_n, sizeof message->force_n);
    memcpy(message->torque_n_m, f->torque_n_m, sizeof message->torque_n_m);
    memcpy(message->proxy_position_m, f->proxy_position_m, sizeof message->proxy_position_m);
    memcpy(message->proxy_orientation_wxyz, f->proxy_orientation_wxyz, sizeof message->proxy_orientation_wxyz);
}

// Fields with the same name in kn_contact_unit and contact_model_t. One list serves the conversion in both directions.
// clang-format off
#define SAME_FIELDS(X)                                                                                                 \
    X(session) X(pose_seq) X(generation) X(flags) X(contact_index) X(contact_count) X(force_n) X(proxy_velocity_m_s)   \
    X(a_n_s_per_m) X(h_n) X(c2_n_s_per_m) X(k1_n_per_m) X(k_vc_n_per_m) X(b_vc_n_s_per_m) X(friction) X(valid_ms)
// clang-format on
#define SAME_VECTORS(X) X(proxy_m) X(normal) X(friction_anchor_m)

void kn_wire_contact(knead_contact_model_t *message, const kn_contact_unit *unit, int64_t utime)
{
    *message = (knead_contact_model_t){.utime = utime, .frame = KNEAD_PROBE_POSE_T_FRAME_SCENE};
#define TO_WIRE(name) message->name = unit->name;
    SAME_FIELDS(TO_WIRE)
#undef TO_WIRE
#define TO_WIRE(name) memcpy(message->name, unit->name, sizeof message->name);
    SAME_VECTORS(TO_WIRE)
#undef TO_WIRE
}

void kn_wire_unit(kn_contact_unit *unit, const knead_contact_model_t *message)
{
    *unit = (kn_contact_unit){.utime = message->utime};
#define FROM_WIRE(name) unit->name = message->name;
    SAME_FIELDS(FROM_WIRE)
#undef FROM_WIRE
#define FROM_WIRE(name) memcpy(unit->name, message->name, sizeof unit->name);
    SAME_VECTORS(FROM_WIRE)
#undef FROM_WIRE
}

void kn_wire_touch(knead_touch_patch_t *message, const kn_touch *touch, int64_t session, int64_t pose_seq,
                   int64_t utime)
{
    *message = (knead_touch_patch_t){
        .utime = utime,
        .session = session,
        .pose_seq = pose_seq,
        .area_m2 = touch->area_m2,
        .peak_pressure_pa = touch->peak_pressure_pa,
        .frame = KNEAD_TOUCH_PATCH_T_FRAME_TOOL,
    };
    memcpy(message->centre_m, touch->centre_m, sizeof message->centre_m);
    memcpy(message->normal, touch->normal, sizeof message->normal);
    memcpy(message->slip_velocity_m_s, touch->slip_velocity_m_s, sizeof message->slip_velocity_m_s);
    memcpy(message->pressure_pa, touch->pressure_pa, sizeof message->pressure_pa);
}

void kn_wire_event(knead_event_t *message, const kn_event *event, int64_t utime)
{
    *message = (knead_event_t){
        .utime = utime,
        .tick = event->tick,
        .session = event->session,
        .state_hash = (int64_t)event->state_hash,
        .kind = event->kind,
        .probe = event->probe,
    };
    memcpy(message->arg, event->arg, sizeof message->arg);
}

void kn_wire_pose(knead_probe_pose_t *message, const kn_pose *pose)
{
    *message = (knead_probe_pose_t){
        .utime = pose->utime,
        .session = pose->session,
        .seq = pose->seq,
        .sent_ns = pose->sent_ns,
        .buttons = pose->buttons,
        .frame = KNEAD_PROBE_POSE_T_FRAME_SCENE,
    };
    memcpy(message->position_m, pose->position_m, sizeof message->position_m);
    memcpy(message->orientation_wxyz, pose->orientation_wxyz, sizeof message->orientation_wxyz);
    memcpy(message->velocity_m_s, pose->velocity_m_s, sizeof message->velocity_m_s);
}

void kn_wire_scene(knead_scene_t *message, const kn_scene *scene, uint64_t initial_hash, int64_t utime)
{
    // a writable array, because lcm-gen's strings are not const, although encoding only reads them
    static char version[] = KN_VERSION;
    *message = (knead_scene_t){
        .utime = utime,
        .text_hash = (int64_t)scene->text_hash,
        .initial_hash = (int64_t)initial_hash,
        .format = scene->version,
        .version = version,
        .name = (char *)scene->name,
        .text = scene->text,
    };
}

// Layout of a scene_t: hash, three int64, one int32, then three strings. A string is an int32 length, which counts the
// closing NUL, and the bytes.
bool kn_wire_scene_fits(const void *data, size_t size)
{
    const unsigned char *bytes = data;
    size_t at = 8 + 3 * 8 + 4;
    if (size < at) return false;
    if (kn_bytes_64(bytes) != __knead_scene_t_get_hash()) return false;
    for (int i = 0; i < 3; i++) {
        if (size - at < 4) return false;
        size_t length = kn_bytes_32(bytes + at);
        at += 4;
        // the NUL must be the last byte of the string, and the only NUL
        if (length < 1 || length > size - at) return false;
        if (memchr(bytes + at, 0, length) != bytes + at + length - 1) return false;
        at += length;
    }
    return kn_auth_fits(size, at);
}

bool kn_wire_finite(const double *value, int count)
{
    for (int i = 0; i < count; i++)
        if (!isfinite(value[i])) return false;
    return true;
}

bool kn_wire_send(lcm_t *lcm, const kn_auth *auth, int64_t *signed_us, const char *channel, uint8_t *bytes, int size)
{
    if (size > 0 && auth) size = (int)kn_auth_sign(auth, channel, bytes, (size_t)size, kn_auth_now(auth, signed_us));
    return size > 0 && lcm_publish(lcm, channel, bytes, (unsigned)size) == 0;
}
