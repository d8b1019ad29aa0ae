#include "core/device.h"
#include "core/scene/scene.h"
#include "core/scene/keys.h"
#include "tests/check.h"
#include <unistd.h>

#define DOUGH KN_SOURCE_DIR "/core/scenes/dough-small.yaml"
static char error[512];

static kn_scene *with(const char *device)
{
    char set[256];
    const char *sets[] = {set};
    snprintf(set, sizeof set, "device=%s", device);
    snprintf(error, sizeof error, "%s", "");
    return kn_scene_load(DOUGH, sets, 1, error, sizeof error);
}

TEST("every word of device.profile has a profile file, and every file has a word")
{
    bool is_group;
    const char *words = kn_key_find("device.profile", &is_group)->unit;
    int files = 0, count = 1;
    for (const char *w = words; *w; w++) count += *w == '|';
    for (const kn_library_entry *e = kn_devices; e->name; e++, files++) {
        OWN(kn_scene) *scene = with(e->name);
        CHECK(strstr(words, e->name) != NULL);
        if (!scene) KN_TEST_FAIL("%s", error);
        if (!scene) continue;
        const kn_device_def *d = &scene->device;
        CHECK_STR(d->name, e->name);
        CHECK(d->mass_kg > 0 && d->damping_n_s_m > 0 && d->force_limit_n == scene->limits.clamp_n);
        CHECK(d->workspace_m[0] > 0 && d->force_axes == 3 && d->round_trip_s == 1e-3);
        CHECK(d->hand.stiffness_n_m > 0 && d->hand.stiffness_n_m == d->coupling_n_m);
        CHECK(d->coupling_n_m <= d->stiffness_limit_n_m);
        CHECK(kn_device_check(d) == NULL);
    }
    CHECK(files == count);
}

TEST("a scene that only names a bench stores nothing more; the text of a scene with a device holds the whole profile")
{
    OWN(kn_scene) *bench = with("bench"), *touch = with("touch");
    CHECK(bench && !strstr(bench->text, "mass:") && !strstr(bench->text, "force_scale"));
    CHECK(bench && bench->limits.clamp_n == 40.0 && bench->limits.force_scale == 1.0);
    CHECK(touch && touch->limits.clamp_n == 3.3 && touch->limits.force_scale == 1.0);
    CHECK(touch && strstr(touch->text, "mass: 0.08 kg\n") && strstr(touch->text, "coupling: 600 N/m\n"));
    OWN(kn_scene) *again = kn_scene_parse("x", touch->text, strlen(touch->text), NULL, 0, error, sizeof error);
    CHECK(again && memcmp(&again->device, &touch->device, sizeof touch->device) == 0);
    CHECK(again && again->text_hash == touch->text_hash);
}

TEST("the text of a scene with device settings holds the whole device, and reading the text gives the same device")
{
    OWN(kn_scene) *scene = with("{profile: touch, force_scale: 0.25, round_trip: 3 ms, basis: [2, -1, 3], clamp: 3 N}");
    if (!scene) KN_TEST_FAIL("%s", error);
    if (!scene) return;
    CHECK(strstr(scene->text, "force_scale: 0.25\n") && strstr(scene->text, "mass: 0.08 kg\n"));
    CHECK(strstr(scene->text, "basis: [2, -1, 3]\n") && strstr(scene->text, "encoder: 4e-05 m\n"));
    OWN(kn_scene) *again = kn_scene_parse("x", scene->text, strlen(scene->text), NULL, 0, error, sizeof error);
    CHECK(again && memcmp(&again->device, &scene->device, sizeof scene->device) == 0);
    CHECK(again && strcmp(again->text, scene->text) == 0 && again->text_hash == scene->text_hash);
}

TEST("the coupling is the profile's, lowered by the round trip and converted to the scene by the force and length "
     "scales")
{
    const struct {
        const char *device;
        double hand_n_m, scene_n_m;
    } row[] = {
        {"touch", 600, 600},
        {"{profile: touch, round_trip: 2 ms}", 384, 384}, // 0.6 (0.1 + 1.5) / 2.5 ms
        {"{profile: touch, force_scale: 0.25}", 600, 2400},
        {"{profile: touch, force_scale: 0.25, scale: 2}", 600, 1200},
        {"{profile: touch, round_trip: 2 ms, coupling: 700 N/m}", 700, 700},
    };
    for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
        OWN(kn_scene) *scene = with(row[i].device);
        if (!scene) KN_TEST_FAIL("%s", error);
        if (!scene) continue;
        CHECK_NEAR(scene->device.hand.stiffness_n_m, row[i].hand_n_m, 1e-9);
        CHECK_NEAR(scene->device.coupling_n_m, row[i].scene_n_m, 1e-9);
    }
}

TEST("a user's device file starts from a profile and changes it; an error in it is reported")
{
    char path[] = "/tmp/kn_device_XXXXXX.yaml", set[64];
    int fd = mkstemps(path, 5);
    const char *text = "device:\n  profile: falcon\n  mass: 0.3 kg\n";
    const char *wrong = "device: {profile: falcon}\ngravity: 1 m/s^2\n";
    CHECK(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    snprintf(set, sizeof set, "%s", path);
    OWN(kn_scene) *scene = with(set);
    if (!scene) KN_TEST_FAIL("%s", error);
    CHECK(scene && scene->device.mass_kg == 0.3 && scene->device.force_limit_n == 8.0);
    CHECK(scene && strstr(scene->text, "profile: falcon\n"));
    CHECK(ftruncate(fd, 0) == 0 && pwrite(fd, wrong, strlen(wrong), 0) == (ssize_t)strlen(wrong));
    CHECK(!with(set) && strstr(error, "gravity is in"));
    close(fd);
    unlink(path);
}

TEST("a basis that is not a permutation or is left-handed, and an invalid rotation, are refused")
{
    CHECK(!with("{profile: touch, basis: [1, 1, 3]}") && strstr(error, "not a permutation"));
    CHECK(!with("{profile: touch, basis: [1, 2.5, 3]}") && strstr(error, "not a permutation"));
    CHECK(!with("{profile: touch, basis: [2, 1, 3]}") && strstr(error, "left-handed"));
    CHECK(!with("{profile: touch, rotation: [1, 0, 0, 1]}") && strstr(error, "unit quaternion"));
}

TEST("the work on the device is the work in the scene divided by the length scale")
{
    kn_device_def d = {
        .basis = {2, 3, 1}, .position_m = {0.1, -0.2, 0.3}, .rotation_wxyz = {0.5, 0.5, -0.5, 0.5}, .scale = 2.5};
    const double from_m[3] = {0.01, 0.02, -0.03}, to_m[3] = {0.012, 0.015, -0.02}, force_n[3] = {1.0, -2.0, 0.5};
    double a[3], b[3], f[3], scene_j = 0.0, device_j = 0.0, size = 0.0;
    kn_device_position(&d, from_m, a);
    kn_device_position(&d, to_m, b);
    kn_device_force(&d, force_n, f);
    for (int k = 0; k < 3; k++) {
        scene_j += force_n[k] * (b[k] - a[k]);
        device_j += f[k] * (to_m[k] - from_m[k]);
        size += f[k] * f[k];
    }
    CHECK(kn_device_check(&d) == NULL);
    CHECK_NEAR(device_j, scene_j / 2.5, 1e-15);
    CHECK_NEAR(size, 1.0 + 4.0 + 0.25, 1e-12);
    double axes[3][3]; // right-handed
    kn_device_axes(&d, axes);
    CHECK_NEAR(axes[0][0] * (axes[1][1] * axes[2][2] - axes[1][2] * axes[2][1]) -
                   axes[0][1] * (axes[1][0] * axes[2][2] - axes[1][2] * axes[2][0]) +
                   axes[0][2] * (axes[1][0] * axes[2][1] - axes[1][1] * axes[2][0]),
               1.0, 1e-12);
}

TESTS_MAIN
