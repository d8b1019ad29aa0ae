#ifndef KN_TESTS_LOOP_FIXTURE_H
#define KN_TESTS_LOOP_FIXTURE_H
// A loop with the objects that kneadd gives it: small dough, the processor or a circuit, and a mesh bus that stays in memory.
#include "proto/knead_event_t.h"
#include "server/backend/fpga.h"
#include "server/loop.h"
#include "tests/check.h"

typedef struct kn_loop_fixture {
    kn_scene *scene;
    kn_model *model;
    kn_backend backend;
    kn_skin skin;
    kn_audit *audit;
    kn_loop loop;
    int64_t tick, took_ns; // number of the next tick; apparent duration of a tick
    kn_tick_out out;       // of the last tick
    // events seen so far, and the last event of each kind
    int kinds[KNEAD_EVENT_T_KIND_OVERLOAD + 1];
    kn_event last[KNEAD_EVENT_T_KIND_OVERLOAD + 1];
} kn_loop_fixture;

// uri: address of a circuit, or NULL for the processor. End the program on failure.
static inline void kn_loop_fixture_open_on(kn_loop_fixture *f, const char *const *sets, int count, const char *uri)
{
    char error[KN_LINK_WHY] = "";
    bool device;
    memset(f, 0, sizeof *f);
    f->scene = load_scene("dough-small.yaml", sets, count);
    f->model = build(&f->scene->model);
    f->audit = kn_audit_create(f->model);
    if (kn_backend_place(&f->backend, f->model, uri, false, SIZE_MAX, error, &device) &&
        kn_skin_open(&f->skin, "memq://", f->scene, f->model, error, sizeof error) && (f->audit || uri) &&
        kn_loop_init(&f->loop, f->scene, f->model, &f->backend, &f->skin, f->audit))
        return;
    fprintf(stderr, "%s\n", error);
    exit(1);
}

// set: a setting of the scene, or NULL.
static inline void kn_loop_fixture_open(kn_loop_fixture *f, const char *set)
{
    kn_loop_fixture_open_on(f, &set, set ? 1 : 0, NULL);
}

static inline void kn_loop_fixture_close(kn_loop_fixture *f)
{
    kn_loop_free(&f->loop);
    kn_skin_close(&f->skin);
    f->backend.destroy(f->backend.self);
    kn_audit_destroy(f->audit);
    kn_model_destroy(f->model);
    kn_scene_destroy(f->scene);
}

static inline const kn_state *kn_loop_fixture_state(const kn_loop_fixture *f)
{
    return f->backend.state(f->backend.self);
}

static inline uint64_t kn_loop_fixture_hash(const kn_loop_fixture *f)
{
    return kn_state_hash(f->model, kn_loop_fixture_state(f));
}

// Run a tick with this pose of a probe, moved to z_m, and take its record.
static inline void kn_loop_fixture_tick(kn_loop_fixture *f, int probe, kn_pose *pose, double z_m)
{
    pose->seq++;
    pose->velocity_m_s[2] = (z_m - pose->position_m[2]) / 1e-3;
    pose->position_m[2] = z_m;
    kn_loop_post(&f->loop, probe, pose);
    kn_wake wake = {.tick = f->tick++, .now_ns = kn_now_ns() - f->took_ns};
    kn_loop_tick(&f->loop, &wake);
    f->loop.execution_ns = 0; // a slow machine would report an overload
    for (const kn_tick_record *record; (record = kn_ring_front(&f->loop.records)); kn_ring_pop(&f->loop.records)) {
        f->out = record->out;
        for (int i = 0; i < f->out.event_count; i++) {
            f->kinds[f->out.event[i].kind]++;
            f->last[f->out.event[i].kind] = f->out.event[i];
        }
    }
}

#endif
