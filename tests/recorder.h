#ifndef KN_TESTS_RECORDER_H
#define KN_TESTS_RECORDER_H
// kneadd without a clock and a bus. The servo runs on a scene, and its poses, events and forces go into a log in the
// order that they would have on the bus. A test can provoke all that a real server meets: late and lost poses, missed
// cycles, sessions that end and begin again, several tools, a reset, a stop.
#include "proto/knead_event_t.h"
#include "server/log.h"
#include "server/served_object.h"
#include "server/wire.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define KN_RECORDER_START_US 1700000000000000

typedef struct kn_recorder {
    kn_served_object on;
    kn_servo servo;
    kn_tick_in in; // input of the next tick
    kn_tick_out out;
    kn_pose hand[KN_PROBES_MAX], mailbox[KN_PROBES_MAX];
    lcm_eventlog_t *log;
    int64_t utime, late_us; // time of the last tick; delay of the next tick behind its millisecond
    int64_t lose_tick;      // the logger loses the forces of this tick
    bool mute;              // the logger does not run
} kn_recorder;

static inline void kn_recorder_put(kn_recorder *r, const char *channel, void *bytes, int size)
{
    if (r->mute || (size > 0 && kn_log_write(r->log, r->utime, channel, bytes, (size_t)size))) return;
    fprintf(stderr, "%s is not written\n", channel);
    exit(1);
}

static inline void kn_recorder_scene(kn_recorder *r)
{
    static uint8_t bytes[1 << 16];
    knead_scene_t m;
    kn_wire_scene(&m, r->on.scene, kn_state_hash(r->on.model, r->on.backend.state(r->on.backend.self)), r->utime);
    kn_recorder_put(r, "KNEAD_SCENE", bytes, knead_scene_t_encode(bytes, 0, sizeof bytes, &m));
}

// Open the recorder with all tools at the origin. End the program if the scene or the log cannot be opened.
static inline void kn_recorder_open(kn_recorder *r, const char *log, const kn_served_object_def *def)
{
    char error[512];
    *r = (kn_recorder){.in.tick = -1, .utime = KN_RECORDER_START_US, .lose_tick = -1};
    int code = kn_served_object_load(&r->on, def, error, sizeof error);
    if (code != 0) fprintf(stderr, "%s\n", error), exit(code);
    if (!(r->log = lcm_eventlog_create(log, "w"))) perror(log), exit(3);
    kn_servo_init(&r->servo, r->on.scene, r->on.model, &r->on.backend);
    kn_servo_begin(&r->servo, r->on.settled);
    for (int p = 0; p < KN_PROBES_MAX; p++) r->hand[p] = (kn_pose){.session = p + 1, .orientation_wxyz = {1}};
    kn_recorder_scene(r);
}

static inline void kn_recorder_close(kn_recorder *r)
{
    lcm_eventlog_destroy(r->log);
    kn_served_object_free(&r->on);
}

// Put a pose on the bus and into the mailbox.
static inline void kn_recorder_pose(kn_recorder *r, int p)
{
    char channel[80];
    uint8_t bytes[512];
    knead_probe_pose_t m;
    r->hand[p].seq++;
    r->hand[p].utime = r->utime;
    kn_wire_pose(&m, &r->hand[p]);
    snprintf(channel, sizeof channel, "KNEAD_POSE_%s", r->on.scene->model.probe[p].name);
    kn_recorder_put(r, channel, bytes, knead_probe_pose_t_encode(bytes, 0, sizeof bytes, &m));
    r->mailbox[p] = r->hand[p];
    r->in.pose[p] = &r->mailbox[p];
    r->in.fresh[p] = true;
}

static inline void kn_recorder_tick(kn_recorder *r)
{
    char channel[80];
    uint8_t bytes[512];
    r->in.tick += 1 + r->in.missed;
    r->utime = KN_RECORDER_START_US + 1000 * r->in.tick + r->late_us;
    kn_servo_tick(&r->servo, &r->in, &r->out);
    for (int i = 0; i < r->out.event_count; i++) {
        knead_event_t m;
        kn_wire_event(&m, &r->out.event[i], r->utime);
        kn_recorder_put(r, "KNEAD_EVENT", bytes, knead_event_t_encode(bytes, 0, sizeof bytes, &m));
    }
    for (int p = 0; p < r->on.scene->model.probe_count; p++) {
        knead_contact_force_t m;
        if (!r->out.force[p].live || r->in.tick == r->lose_tick) continue;
        kn_wire_force(&m, &r->out, p, r->utime, 12345);
        snprintf(channel, sizeof channel, "KNEAD_FORCE_%s", r->on.scene->model.probe[p].name);
        kn_recorder_put(r, channel, bytes, knead_contact_force_t_encode(bytes, 0, sizeof bytes, &m));
    }
    for (int p = 0; p < KN_PROBES_MAX; p++)
        if (r->out.force[p].left) r->in.pose[p] = NULL;
    memset(r->in.fresh, 0, sizeof r->in.fresh);
    r->in.reset = r->in.recover = false;
    r->in.take = KN_QUALITY_CAUSE_NONE;
    r->in.missed = 0;
}

#endif
