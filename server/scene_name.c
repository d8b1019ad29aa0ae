#include "server/scene_name.h"
#include "core/scene/keys.h"
#include "server/option_table.h"
#include <dirent.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool is_file(const char *path)
{
    struct stat there;
    return stat(path, &there) == 0 && !S_ISDIR(there.st_mode);
}

const char *kn_scene_folder(void)
{
    static const char *const places[] = {"../share/knead/scenes", "../../../core/scenes"};
    static char folder[PATH_MAX];
    char place[PATH_MAX];
    const char *given = getenv("KNEAD_SCENES");
    if (given && *given) return given;
    const ssize_t n = readlink("/proc/self/exe", place, PATH_MAX - 64);
    char *slash = n > 0 ? memrchr(place, '/', (size_t)n) : NULL;
    for (size_t i = 0; slash && i < sizeof places / sizeof *places; i++) {
        strcpy(slash + 1, places[i]);
        if (realpath(place, folder)) return folder;
    }
    return NULL;
}

static int is_scene(const struct dirent *e)
{
    const size_t size = strlen(e->d_name);
    return size > 5 && *e->d_name != '.' && !strcmp(e->d_name + size - 5, ".yaml");
}

// Return the text after "expected" in the message on an unknown name.
static const char *list_names(const char *folder, const char *wrong)
{
    static char text[2048], nearest[NAME_MAX + 1];
    struct dirent **found = NULL;
    const int count = folder ? scandir(folder, &found, is_scene, alphasort) : 0;
    int edits = 0, n = snprintf(text, sizeof text, "a scene file%s", count > 0 ? " or a scene's name:" : "");
    for (int i = 0; i < count; i++) {
        char *name = found[i]->d_name;
        name[strlen(name) - 5] = 0;
        if (kn_word_nearer(wrong, name, &edits)) strcpy(nearest, name);
        if (n < (int)sizeof text - 300) n += snprintf(text + n, sizeof text - (size_t)n, "%s %s", i ? "," : "", name);
        free(found[i]);
    }
    free(found);
    if (edits) snprintf(text + n, sizeof text - (size_t)n, "; did you mean %s?", nearest);
    return text;
}

const char *kn_scene_take(void *path, const char *text)
{
    static char found[8][PATH_MAX];
    static int next;
    *(const char **)path = text;
    if (!*text || strpbrk(text, "/.") || is_file(text)) return NULL;
    const char *folder = kn_scene_folder();
    char *file = found[next++ % 8];
    if (folder && snprintf(file, PATH_MAX, "%s/%s.yaml", folder, text) < PATH_MAX && is_file(file))
        return *(const char **)path = file, NULL;
    return list_names(folder, text);
}
