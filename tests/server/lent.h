#ifndef KN_TESTS_LENT_H
#define KN_TESTS_LENT_H
// The objects that kneadd lends a loop: small dough, the processor or a circuit, and a mesh bus that stays in memory.
#include "server/backend/fpga.h"
#include "server/loop.h"
#include "tests/built.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct kn_lent {
    kn_scene *scene;
    kn_model *model;
    kn_backend backend;
    kn_skin skin;
    kn_audit *audit;
    kn_loop loop;
} kn_lent;

// uri: address of a circuit, or NULL for the processor. End the program on failure.
static inline void kn_lent_open_on(kn_lent *l, const char *const *sets, int count, const char *uri)
{
    char error[KN_LINK_WHY] = "";
    bool device;
    memset(l, 0, sizeof *l);
    l->scene = load_scene("dough-small.yaml", sets, count);
    l->model = build(&l->scene->model);
    l->audit = kn_audit_create(l->model);
    if (kn_backend_place(&l->backend, l->model, uri, false, SIZE_MAX, error, &device) &&
        kn_skin_open(&l->skin, "memq://", l->scene, l->model, error, sizeof error) && (l->audit || uri) &&
        kn_loop_init(&l->loop, l->scene, l->model, &l->backend, &l->skin, l->audit))
        return;
    fprintf(stderr, "%s\n", error);
    exit(1);
}

// set: a setting of the scene, or NULL.
static inline void kn_lent_open(kn_lent *l, const char *set) { kn_lent_open_on(l, &set, set ? 1 : 0, NULL); }

static inline void kn_lent_close(kn_lent *l)
{
    kn_loop_free(&l->loop);
    kn_skin_close(&l->skin);
    l->backend.destroy(l->backend.self);
    kn_audit_destroy(l->audit);
    kn_model_destroy(l->model);
    kn_scene_destroy(l->scene);
}

#endif
