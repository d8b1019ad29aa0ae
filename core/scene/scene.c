#include "core/scene/scene.h"
#include "core/shape.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// --- scene ----------------------------------------------------------------------------------------------------------

void kn_scene_clear(kn_scene *scene)
{
    free(scene->text);
    kn_simplices_destroy(scene->mesh);
    for (int p = 0; p < KN_PROBES_MAX; p++) {
        if (scene->tool[p]) kn_shape_drop(scene->tool[p]);
        free(scene->tool[p]);
    }
}

void kn_scene_destroy(kn_scene *scene)
{
    if (!scene) return;
    kn_scene_clear(scene);
    free(scene);
}

static const char *const names[KN_QUALITIES] = {"fast", "balanced", "accurate", "own"};
static const char *const sets[KN_QUALITIES] = {"quality=fast", "quality=balanced", "quality=accurate", "quality=own"};
const char kn_quality_names[] = "fast, balanced, accurate or own";

const char *kn_quality_name(kn_quality quality) { return names[quality]; }

const char *kn_quality_set(const char *name)
{
    for (int q = 0; q < KN_QUALITIES; q++)
        if (strcmp(names[q], name) == 0) return sets[q];
    return NULL;
}

// --- library --------------------------------------------------------------------------------------------------------

static const char *const suffixes[] = {"-rheological", "-viscoelastic", "-plastic"};

const kn_library_entry *kn_library_find(const char *name, int *variant)
{
    // find the suffix of a variant and exclude it from the name
    size_t size = strlen(name);
    *variant = -1;
    for (int i = 0; i < 3; i++) {
        size_t end = strlen(suffixes[i]);
        if (size <= end || strcmp(name + size - end, suffixes[i]) != 0) continue;
        *variant = i;
        size -= end;
        break;
    }
    for (const kn_library_entry *e = kn_library; e->name; e++)
        if (strlen(e->name) == size && memcmp(e->name, name, size) == 0) return e;
    return NULL;
}

const char *kn_library_names(char text[256])
{
    size_t used = 0;
    *text = '\0';
    for (const kn_library_entry *e = kn_library; e->name && used < 256; e++)
        used += (size_t)snprintf(text + used, 256 - used, "%s%s", used ? ", " : "", e->name);
    return text;
}
