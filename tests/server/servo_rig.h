#ifndef KN_TESTS_SERVO_RIG_H
#define KN_TESTS_SERVO_RIG_H
// A servo on an object. One call is one tick, and the poses come directly from the test.
#include "proto/knead_event_t.h"
#include "server/servo.h"
#include "tests/check.h"

typedef struct rig {
    kn_scene *scene;
    kn_model *model;
    kn_backend backend;
    kn_servo servo;
    kn_pose pose[KN_PROBES_MAX];
    kn_tick_in in;
    kn_tick_out out;
    int kinds[KNEAD_EVENT_T_KIND_OVERLOAD + 1]; // events seen so far
} rig;

// set: a setting of the scene, or NULL. All tools start above the object.
static inline rig *rig_make_of(const char *scene, const char *set)
{
    rig *r = calloc(1, sizeof *r);
    r->scene = load_scene(scene, &set, set ? 1 : 0);
    r->model = build(&r->scene->model);
    if (!kn_backend_cpu(&r->backend, r->model)) exit(1);
    kn_servo_init(&r->servo, r->scene, r->model, &r->backend);
    r->in.tick = -1;
    for (int p = 0; p < KN_PROBES_MAX; p++)
        r->pose[p] = (kn_pose){.session = 100 + p, .orientation_wxyz = {1}, .position_m = {0, 0, 0.08}};
    return r;
}

static inline void rig_free(rig *r)
{
    r->backend.destroy(r->backend.self);
    kn_model_destroy(r->model);
    kn_scene_destroy(r->scene);
    free(r);
}

OWNS(rig, rig_free)

// Run a tick, and clear the inputs that hold for one tick.
static inline void tick(rig *r)
{
    r->in.tick += 1 + r->in.missed;
    kn_servo_tick(&r->servo, &r->in, &r->out);
    for (int i = 0; i < r->out.event_count; i++) r->kinds[r->out.event[i].kind]++;
    memset(r->in.fresh, 0, sizeof r->in.fresh);
    r->in.reset = r->in.recover = r->in.undo = false;
    r->in.restore = NULL, r->in.change = NULL;
    r->in.take = KN_QUALITY_CAUSE_NONE;
    r->in.overload = r->in.missed = 0;
}

static inline const kn_state *object(const rig *r) { return r->servo.backend->state(r->servo.backend->self); }
static inline uint64_t object_hash(const rig *r) { return kn_state_hash(r->servo.model, object(r)); }

#endif
