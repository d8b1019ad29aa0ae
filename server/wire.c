#include "server/wire.h"
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
        .proxy_orientation_wxyz = {1.0, 0.0, 0.0, 0.0}, // plate and sphere do not turn
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
    static char version[] = KN_VERSION; // lcm-gen's strings are not const, though encoding only reads them
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

static uint32_t big_endian_32(const unsigned char *bytes)
{
    return (uint32_t)bytes[0] << 24 | (uint32_t)bytes[1] << 16 | (uint32_t)bytes[2] << 8 | bytes[3];
}

// hash, three int64, one int32, then three strings: an int32 length that counts the closing NUL, and the bytes.
bool kn_wire_scene_fits(const void *data, size_t size)
{
    const unsigned char *bytes = data;
    size_t at = 8 + 3 * 8 + 4;
    if (size < at) return false;
    uint64_t hash = (uint64_t)big_endian_32(bytes) << 32 | big_endian_32(bytes + 4);
    if (hash != (uint64_t)__knead_scene_t_get_hash()) return false;
    for (int i = 0; i < 3; i++) {
        if (size - at < 4) return false;
        size_t length = big_endian_32(bytes + at);
        at += 4;
        if (length < 1 || length > size - at) return false;
        if (memchr(bytes + at, 0, length) != bytes + at + length - 1) return false;
        at += length;
    }
    return at == size || at + KN_WIRE_MAC == size;
}
