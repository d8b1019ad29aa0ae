#ifndef KN_TESTS_CORE_FOLDER_H
#define KN_TESTS_CORE_FOLDER_H
// Create a folder for one test. At the end remove the files in it by name.
#include "tests/core/scene_text.h"

#include <sys/stat.h>
#include <unistd.h>

static char folder[64];

static const char *in_folder(const char *name)
{
    static char path[4][256];
    static int turn;
    if (!*folder) {
        snprintf(folder, sizeof folder, "%s", "/tmp/knead-test-XXXXXX");
        if (!mkdtemp(folder)) SKIP("no folder for files");
    }
    turn = (turn + 1) % 4;
    snprintf(path[turn], sizeof path[turn], "%s/%s", folder, name);
    return path[turn];
}

// Move a file that the scene names, let another take its place, and check that the scene's text refuses it, but finds
// the moved file beside a log. `write`: writes the other file. `lost` and `changed` are in the refusals.
static inline void check_moved(const kn_scene *scene, const char *file, void (*write)(const char *path),
                               const char *lost, const char *changed)
{
    char moved[200], error[1024];
    snprintf(moved, sizeof moved, "moved/%s", file);
    mkdir(in_folder("moved"), 0700);
    rename(in_folder(file), in_folder(moved));
    for (int other = 0; other < 2; other++) {
        CHECK(strstr(refusal("x.yaml", scene->text, NULL), other ? changed : lost));
        OWN(kn_scene) *beside = kn_scene_parse_beside(in_folder("moved/log"), "x.yaml", scene->text,
                                                      strlen(scene->text), NULL, 0, error, sizeof error);
        CHECK(beside && beside->text_hash == scene->text_hash);
        CHECK(beside && strcmp(beside->text, scene->text) != 0); // the text names the new place
        if (!other) write(in_folder(file));
    }
    unlink(in_folder(moved));
    rmdir(in_folder("moved"));
}

#endif
