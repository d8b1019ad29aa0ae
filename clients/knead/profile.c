#include "clients/knead/profile.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "core/scene/scene.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// The smallest valid scene. It is parsed only to read its device; its model is never built.
static const char scene_text[] = "version: 1\nobject: {size: [1 cm, 1 cm, 1 cm], spacing: 1 cm}\nmaterial: jelly\n"
                                 "support: bonded\n";

int kn_profile_load(kn_device_def *device, const char *subcommand, const char *name, const char *const *sets,
                    int set_count)
{
    char profile[128], error[512] = "out of memory";
    const char **all = calloc((size_t)set_count + 1, sizeof *all);
    kn_scene *scene = NULL;
    // The profile becomes the first set of the small scene, and the user's sets follow.
    snprintf(profile, sizeof profile, "device=%s", name);
    if (all) {
        all[0] = profile;
        for (int i = 0; i < set_count; i++) all[i + 1] = sets[i];
        scene = kn_scene_parse("device", scene_text, sizeof scene_text - 1, all, set_count + 1, error, sizeof error);
    }
    free(all);
    // The user did not write the first set, so the prefix that names this set is cut from the error message.
    const char *own = "--set device: ";
    bool ours = strncmp(error, own, strlen(own)) == 0;
    if (!scene) return kn_complain(subcommand, KN_EXIT_USAGE, "%s", error + (ours ? strlen(own) : 0));
    *device = scene->device;
    kn_scene_destroy(scene);
    return KN_EXIT_OK;
}
