#include "clients/knead/like.h"
#include "clients/knead/commands.h"
#include "clients/knead/complain.h"
#include "clients/knead/felt.h"
#include "clients/knead/origin.h"
#include <math.h>
#include <stdio.h>

// Stop flag for kn_trace_play. This program has nothing to clean up, so signals keep their default action and the flag
// stays 0.
static const volatile sig_atomic_t never;

// Print the differences of force and shape between the scene and the scene with a uniform lattice. Return
// KN_EXIT_FAILED if the stated accuracy is missed.
static int say(const kn_trace *own, const kn_trace *uniform, const kn_scene *scene)
{
    const kn_replay_tally *t = &own->tally;
    double asked = scene->accuracy, force = kn_felt_force(own, uniform), shape = kn_felt_shape(own, uniform);
    bool keeps = force <= asked;
    if (own->diverged || uniform->diverged)
        return kn_complain("check", KN_EXIT_FAILED, "%s diverged: there is no force to compare",
                           own->diverged ? "the scene" : "its uniform lattice");
    if (isnan(force)) return kn_complain("check", KN_EXIT_USAGE, "the log contains no contact, expected a press");
    printf("accuracy  force %.2g %% off the uniform lattice, %g %% asked: %s; peak %.4g N, uniform %.4g N\n",
           100 * force, 100 * asked, keeps ? "kept" : "missed", kn_felt_peak(own), kn_felt_peak(uniform));
    printf("          shape %.2g %%; a tick takes %.0f us, uniform %.0f us, %.2f of it\n", 100 * shape, own->median_us,
           uniform->median_us, own->median_us / uniform->median_us);
    // If a tool outside the box of fine cells presses coarse cells, the log says little about the accuracy, so print a
    // warning.
    if (t->outside)
        printf("warning   %s pressed up to %.2g mm outside its reach, for %lld ms in all, where the cells are coarse\n",
               scene->model.probe[t->outside_probe].name, 1e3 * t->outside_m, (long long)t->outside);
    if (keeps) return KN_EXIT_OK;
    printf("          a larger object.margin, or the probes' whole reach, may help\n");
    return KN_EXIT_FAILED;
}

int kn_like_uniform(const char *path, const char *log, const char **sets, int count)
{
    char error[512], set[64];
    kn_trace own = {0}, uniform = {0};
    kn_replay_def def = {.log_path = log, .scene_path = path, .sets = sets, .set_count = count + 1, .afresh = true};
    kn_scene *scene = kn_scene_load(path, sets, count, error, sizeof error);
    if (!scene) return kn_complain("check", KN_EXIT_USAGE, "%s", error);
    // Replay the log twice: with the stated accuracy, and with a uniform lattice. The last entry of `sets` selects one
    // of the two.
    snprintf(set, sizeof set, "object.accuracy=%.17g", scene->accuracy);
    sets[count] = set;
    bool stated = scene->accuracy > 0;
    bool played = stated && kn_origin_check(&def, path, scene, error, sizeof error) &&
                  kn_trace_play(&own, &def, &never, error, sizeof error);
    sets[count] = "object.accuracy=0";
    played = played && kn_trace_play(&uniform, &def, &never, error, sizeof error);
    if (!stated) snprintf(error, sizeof error, "%s: has no object.accuracy, which --log needs", path);
    int code = played ? say(&own, &uniform, scene) : kn_complain("check", KN_EXIT_USAGE, "%s", error);
    kn_scene_destroy(scene);
    kn_trace_free(&own);
    kn_trace_free(&uniform);
    return code;
}
