#ifndef KN_SERVER_WIRE_H
#define KN_SERVER_WIRE_H
// Conversion of the servo's results to messages, in one place, so that the logs of a daemon and of a replay have the
// same bytes. `utime` and `execution_ns` come from the caller's clock. All functions are real-time safe. The message of
// kn_wire_scene borrows the scene's strings, and is valid as long as the scene.
#include "core/touch.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_contact_model_t.h"
#include "proto/knead_event_t.h"
#include "proto/knead_probe_pose_t.h"
#include "proto/knead_scene_t.h"
#include "proto/knead_touch_patch_t.h"
#include "server/auth.h"
#include "server/servo.h"
#include <lcm/lcm.h>

void kn_wire_force(knead_contact_force_t *message, const kn_tick_out *tick, int probe, int64_t utime,
                   int64_t execution_ns);
void kn_wire_contact(knead_contact_model_t *message, const kn_contact_unit *unit, int64_t utime);
// `session`: the probe's session. `pose_seq`: number of the pose that the patch answers.
void kn_wire_touch(knead_touch_patch_t *message, const kn_touch *touch, int64_t session, int64_t pose_seq,
                   int64_t utime);
void kn_wire_event(knead_event_t *message, const kn_event *event, int64_t utime);
void kn_wire_pose(knead_probe_pose_t *message, const kn_pose *pose);
// `initial_hash`: state hash of the object before anything touched it.
void kn_wire_scene(knead_scene_t *message, const kn_scene *scene, uint64_t initial_hash, int64_t utime);

// Convert a contact_model_t message back to a contact unit, for a client. Any content is accepted, because the local
// contact model checks the content.
void kn_wire_unit(kn_contact_unit *unit, const knead_contact_model_t *message);

// Return whether the bytes are an encoded scene_t whose string lengths fit into `size` bytes. The generated decoder
// trusts these lengths and crashes on a negative one. Call this function before decoding a scene in every program that
// receives from a bus or reads a log.
bool kn_wire_scene_fits(const void *data, size_t size);

// Return whether all `count` numbers in `value` are finite.
bool kn_wire_finite(const double *value, int count);

// Send an encoded message of `size` bytes. If `auth` is not NULL, sign the message first. `signed_us`: age stamp of the
// sender's last signed message (kn_auth_now). `bytes` has room for KN_AUTH_TRAILER more bytes. Return false if `size`
// is not positive, because encoding has failed, or if LCM refuses the message.
bool kn_wire_send(lcm_t *lcm, const kn_auth *auth, int64_t *signed_us, const char *channel, uint8_t *bytes, int size);

#endif
