#ifndef KN_TESTS_BUILT_H
#define KN_TESTS_BUILT_H
// Build the model of a definition, and load a scene of core/scenes. On failure print the reason and end the program.
#include "core/model.h"
#include "core/scene/scene.h"
#include <stdio.h>
#include <stdlib.h>

static inline kn_model *build(const kn_model_def *def)
{
    char error[256];
    kn_model *model = kn_model_build(def, error, sizeof error);
    if (!model) {
        fprintf(stderr, "cannot build the model: %s\n", error);
        exit(1);
    }
    return model;
}

static inline kn_scene *load_scene(const char *file, const char *const *sets, int count)
{
    char path[512], error[512];
    const char *source = getenv("KN_SOURCE"); // ctest and tests/one set it
    snprintf(path, sizeof path, "%s/core/scenes/%s", source ? source : ".", file);
    kn_scene *scene = kn_scene_load(path, sets, count, error, sizeof error);
    if (!scene) {
        fprintf(stderr, "%s\n", error);
        exit(1);
    }
    return scene;
}

#endif
