#ifndef KN_SERVER_WIRE_H
#define KN_SERVER_WIRE_H
// What the servo says -> what stands on the wire. One place, so that a daemon's log and a replay's are the same bytes.
// utime and execution_ns come from the caller's clock. Real-time safe but for kn_wire_scene's borrowed strings: the
// message points into the scene and is valid as long as it is.
#include "core/touch.h"
#include "proto/knead_contact_force_t.h"
#include "proto/knead_contact_model_t.h"
#include "proto/knead_event_t.h"
#include "proto/knead_probe_pose_t.h"
#include "proto/knead_scene_t.h"
#include "proto/knead_touch_patch_t.h"
#include "server/servo.h"

void kn_wire_force(knead_contact_force_t *message, const kn_tick_out *tick, int probe, int64_t utime,
                   int64_t execution_ns);
void kn_wire_contact(knead_contact_model_t *message, const kn_contact_unit *unit, int64_t utime);
// Of a probe's session and the pose that it answers.
void kn_wire_touch(knead_touch_patch_t *message, const kn_touch *touch, int64_t session, int64_t pose_seq,
                   int64_t utime);
void kn_wire_event(knead_event_t *message, const kn_event *event, int64_t utime);
void kn_wire_pose(knead_probe_pose_t *message, const kn_pose *pose);
// initial_hash: kn_state_hash of the object before anything touched it.
void kn_wire_scene(knead_scene_t *message, const kn_scene *scene, uint64_t initial_hash, int64_t utime);

// And back, for a client: any message there can be. What is in it is the local model's to judge.
void kn_wire_unit(kn_contact_unit *unit, const knead_contact_model_t *message);

// Whether the bytes of a scene_t hold the strings they say. The generated decoder believes their lengths and crashes on
// a negative one: ask first, in every program that hears a bus or reads a log.
bool kn_wire_scene_fits(const void *data, size_t size);

#endif
