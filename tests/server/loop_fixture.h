#ifndef KN_TESTS_LOOP_FIXTURE_H
#define KN_TESTS_LOOP_FIXTURE_H
// A loop with the objects that kneadd gives it: small dough, the processor or a circuit, and a mesh bus that stays in memory.
#include "server/backend/fpga.h"
#include "server/loop.h"
#include "tests/built.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct kn_loop_fixture {
    kn_scene *scene;
    kn_model *model;
    kn_backend backend;
    kn_skin skin;
    kn_audit *audit;
    kn_loop loop;
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

#endif
