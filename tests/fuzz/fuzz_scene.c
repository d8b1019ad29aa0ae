// libFuzzer target: any bytes give either one line of error, or a scene whose text parses to the same scene. The
// bytes after the first NUL are a --set.
#include "core/scene/scene.h"
#include "tests/fuzz/fuzz.h"
#include <string.h>

// Check for one line, "f.yaml:line:col: ...", "--set key: ..." or "--quality name: ...", all printable: no bytes of
// the file are quoted.
static void check_complaint(const char *error)
{
    require(strncmp(error, "f.yaml:", 7) == 0 || strncmp(error, "--set ", 6) == 0 ||
            strncmp(error, "--quality ", 10) == 0);
    require(strstr(error, ": ") != NULL);
    for (; *error; error++) require(*error >= ' ' && *error <= '~');
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char error[512] = "";
    const uint8_t *nul = size > 0 ? memchr(data, 0, size) : NULL;
    size_t text = nul ? (size_t)(nul - data) : size;
    char *set = nul ? strndup((const char *)nul + 1, size - text - 1) : NULL;
    kn_scene *scene =
        kn_scene_parse("f.yaml", (const char *)data, text, (const char *const *)&set, set != NULL, error, sizeof error);
    free(set);
    if (!scene) {
        check_complaint(error);
        return 0;
    }
    kn_scene *again = kn_scene_parse("f.yaml", scene->text, strlen(scene->text), NULL, 0, error, sizeof error);
    require(again && strcmp(again->text, scene->text) == 0 && again->text_hash == scene->text_hash);
    kn_model_def def = again->model;
    def.mesh = scene->model.mesh; // each parse has its own mesh
    for (int p = 0; p < KN_PROBES_MAX; p++) def.probe[p].parts = scene->model.probe[p].parts;
    require(memcmp(&def, &scene->model, sizeof def) == 0);
    kn_scene_destroy(again);
    kn_scene_destroy(scene);
    return 0;
}
