#ifndef KN_TESTS_RECORDED_PRESS_H
#define KN_TESTS_RECORDED_PRESS_H
// A log of a press whose server missed cycles.
#include "clients/knead/path.h"
#include "core/scene/scene.h"
#include "server/log.h"
#include "server/servo.h"
#include "server/wire.h"
#include <stdio.h>
#include <stdlib.h>

#define SMALL KN_SOURCE_DIR "/core/scenes/dough-small.yaml"

static void must(bool ok, const char *what)
{
    if (ok) return;
    fprintf(stderr, "%s\n", what);
    exit(1);
}

// ---- logs: a server without clock and bus, whose plate is pressed 3 mm at 1 cm/s, held for 0.5 s and lifted

enum { MISSED_MS = 21 };

typedef struct recorder {
    kn_servo servo;
    kn_tick_in in;
    kn_tick_out out;
    kn_pose hand;
    kn_path *path;
    lcm_eventlog_t *log;
} recorder;

static void record_message(recorder *r, const char *channel, uint8_t *bytes, int size)
{
    must(size > 0 && kn_log_write(r->log, r->hand.utime, channel, bytes, (size_t)size), channel);
}

static void record_tick(recorder *r, int missed)
{
    uint8_t bytes[512];
    knead_probe_pose_t pose;
    knead_contact_force_t force;
    kn_path_point at;
    r->in.missed = missed;
    r->in.tick += 1 + missed;
    r->hand.utime = 1700000000000000 + 1000 * r->in.tick;
    r->hand.seq++;
    kn_path_at(r->path, 1e-3 * (double)r->in.tick, &at);
    memcpy(r->hand.position_m, at.position_m, sizeof at.position_m);
    memcpy(r->hand.velocity_m_s, at.velocity_m_s, sizeof at.velocity_m_s);
    r->in.pose[0] = &r->hand;
    r->in.fresh[0] = true;
    kn_wire_pose(&pose, &r->hand);
    record_message(r, "KNEAD_POSE_plate", bytes, knead_probe_pose_t_encode(bytes, 0, sizeof bytes, &pose));
    kn_servo_tick(&r->servo, &r->in, &r->out);
    kn_wire_force(&force, &r->out, 0, r->hand.utime, 1);
    record_message(r, "KNEAD_FORCE_plate", bytes, knead_contact_force_t_encode(bytes, 0, sizeof bytes, &force));
}

// missed.lcmlog, once. Three times seven cycles are missed on the way down, and as many again while the plate is held.
// Returns the time when the hand begins to rise.
static double record_press(void)
{
    static const char file[] = "missed.lcmlog";
    static double rises_s;
    static uint8_t bytes[16384];
    char error[300];
    recorder r = {.in.tick = -1, .hand = {.session = 7, .orientation_wxyz = {1}}};
    const kn_path_def press = {.touch_z_m = 0.03, .clear_m = 0.005, .depth_m = 0.003, .speed_m_s = 0.01, .hold_s = 0.5};
    kn_backend backend = {0};
    if (rises_s > 0) return rises_s;
    knead_scene_t text;
    kn_scene *scene = kn_scene_load(SMALL, NULL, 0, error, sizeof error);
    must(scene && (r.path = kn_path_press(&press)), error);
    kn_model *model = kn_model_build(&scene->model, error, sizeof error);
    must(model && kn_backend_cpu(&backend, model) && (r.log = lcm_eventlog_create(file, "w")), "no server");
    kn_servo_init(&r.servo, scene, model, &backend);
    r.hand.utime = 1700000000000000;
    kn_wire_scene(&text, scene, 0, r.hand.utime);
    record_message(&r, "KNEAD_SCENE", bytes, knead_scene_t_encode(bytes, 0, sizeof bytes, &text));
    const double held_s = r.path->hold_end_s - press.hold_s;
    const int64_t down = (int64_t)(1e3 * held_s) - 200, standing = down + 400;
    while (1e-3 * (double)r.in.tick < r.path->hold_end_s + 0.3) {
        const int64_t next = r.in.tick + 1;
        bool trouble = false;
        for (int i = 0; i < 3; i++) trouble |= next == down + 30 * i || next == standing + 30 * i;
        record_tick(&r, trouble ? MISSED_MS / 3 : 0); // 20 at once, and the servo would let go
    }
    rises_s = r.path->hold_end_s;
    kn_path_destroy(r.path);
    lcm_eventlog_destroy(r.log);
    backend.destroy(backend.self);
    kn_model_destroy(model);
    kn_scene_destroy(scene);
    return rises_s;
}

#endif
