#ifndef KN_TESTS_CORE_SCENE_TEXT_H
#define KN_TESTS_CORE_SCENE_TEXT_H
// Scenes as text, with any --set: scene_of for those that can be read, refusal for the others.
#include "tests/check.h"

#define SETS(...) ((const char *const[]){__VA_ARGS__, NULL})

static inline kn_scene *try_scene(const char *path, const char *text, const char *const *sets, char error[1024])
{
    int count = 0;
    while (sets && sets[count]) count++;
    error[0] = '\0';
    return kn_scene_parse(path, text, strlen(text), sets, count, error, 1024);
}

// Return the scene. If it is refused, print the reason and end the program. sets: NULL: none.
static inline kn_scene *scene_of(const char *path, const char *text, const char *const *sets)
{
    char error[1024];
    kn_scene *scene = try_scene(path, text, sets, error);
    if (!scene) fprintf(stderr, "%s\n", error), exit(1);
    return scene;
}

// Return the reason why the scene is refused, valid until the next call; "" if it can be read.
static inline const char *refusal(const char *path, const char *text, const char *const *sets)
{
    static char error[1024];
    kn_scene_destroy(try_scene(path, text, sets, error));
    return error;
}

static inline kn_scene *read_again(const kn_scene *scene) { return scene_of("nowhere/x", scene->text, NULL); }

static inline bool has(const kn_scene *scene, const char *part) { return strstr(scene->text, part) != NULL; }

#endif
