#include "core/device.h"
#include "core/algebra/algebra.h"
#include "core/scene/keys.h"
#include "tests/core/folder.h"

static kn_scene *with(const char *device)
{
    char set[256];
    snprintf(set, sizeof set, "device=%s", device);
    return load_scene("dough-small.yaml", SETS(set), 1);
}

TEST("every word of device.profile has a profile file, and every file has a word")
{
    bool is_group;
    const char *words = kn_key_find("device.profile", &is_group)->unit;
    int files = 0, count = 1;
    for (const char *w = words; *w; w++) count += *w == '|';
    for (const kn_library_entry *e = kn_devices; e->name; e++, files++) {
        OWN(kn_scene) *scene = with(e->name);
        const kn_device_def *d = &scene->device;
        CHECK(strstr(words, e->name) != NULL);
        CHECK_STR(d->name, e->name);
        CHECK(d->mass_kg > 0 && d->damping_n_s_m > 0 && d->force_limit_n == scene->limits.clamp_n);
        CHECK(d->workspace_m[0] > 0 && d->force_axes == 3 && d->round_trip_s == 1e-3);
        CHECK(d->hand.stiffness_n_m > 0 && d->hand.stiffness_n_m == d->coupling_n_m);
        CHECK(d->coupling_n_m <= d->stiffness_limit_n_m);
        CHECK(kn_device_check(d) == NULL);
    }
    CHECK(files == count);
}

TEST("the text of a scene that only names a bench stores nothing more; otherwise it holds the whole device, and gives "
     "the same device")
{
    static const struct {
        const char *device, *parts[4];
    } table[] = {{"touch", {"mass: 0.08 kg\n", "coupling: 600 N/m\n"}},
                 {"{profile: touch, force_scale: 0.25, round_trip: 3 ms, basis: [2, -1, 3], clamp: 3 N}",
                  {"force_scale: 0.25\n", "mass: 0.08 kg\n", "basis: [2, -1, 3]\n", "encoder: 4e-05 m\n"}}};
    OWN(kn_scene) *bench = with("bench"), *touch = with("touch");
    CHECK(!has(bench, "mass:") && !has(bench, "force_scale"));
    CHECK(bench->limits.clamp_n == 40.0 && bench->limits.force_scale == 1.0);
    CHECK(touch->limits.clamp_n == 3.3 && touch->limits.force_scale == 1.0);
    for (int t = 0; t < COUNT(table); t++) {
        OWN(kn_scene) *scene = with(table[t].device), *again = read_again(scene);
        for (int i = 0; i < 4 && table[t].parts[i]; i++) CHECK(has(scene, table[t].parts[i]));
        CHECK(memcmp(&again->device, &scene->device, sizeof scene->device) == 0);
        CHECK(strcmp(again->text, scene->text) == 0 && again->text_hash == scene->text_hash);
    }
}

TEST("the coupling is the profile's, lowered by the round trip and converted to the scene by the force and length "
     "scales")
{
    static const struct {
        const char *device;
        double hand_n_m, scene_n_m;
    } row[] = {
        {"touch", 600, 600},
        {"{profile: touch, round_trip: 2 ms}", 384, 384}, // 0.6 (0.1 + 1.5) / 2.5 ms
        {"{profile: touch, force_scale: 0.25}", 600, 2400},
        {"{profile: touch, force_scale: 0.25, scale: 2}", 600, 1200},
        {"{profile: touch, round_trip: 2 ms, coupling: 700 N/m}", 700, 700},
    };
    for (int i = 0; i < COUNT(row); i++) {
        OWN(kn_scene) *scene = with(row[i].device);
        CHECK_NEAR(scene->device.hand.stiffness_n_m, row[i].hand_n_m, 1e-9);
        CHECK_NEAR(scene->device.coupling_n_m, row[i].scene_n_m, 1e-9);
    }
}

static const char *write_device(const char *text)
{
    const char *path = in_folder("device.yaml");
    FILE *file = fopen(path, "w");
    CHECK(file && fputs(text, file) >= 0 && fclose(file) == 0);
    return path;
}

TEST("a user's device file starts from a profile and changes it; an error in it is reported")
{
    OWN(kn_scene) *scene = with(write_device("device:\n  profile: falcon\n  mass: 0.3 kg\n"));
    CHECK(scene->device.mass_kg == 0.3 && scene->device.force_limit_n == 8.0 && has(scene, "profile: falcon\n"));
    char set[256];
    snprintf(set, sizeof set, "device=%s", write_device("device: {profile: falcon}\ngravity: 1 m/s^2\n"));
    CHECK(strstr(refusal("x", scene->text, SETS(set)), "gravity is in"));
    unlink(in_folder("device.yaml"));
    rmdir(folder);
}

TEST("the work on the device is the work in the scene divided by the length scale")
{
    kn_device_def d = {
        .basis = {2, 3, 1}, .position_m = {0.1, -0.2, 0.3}, .rotation_wxyz = {0.5, 0.5, -0.5, 0.5}, .scale = 2.5};
    const double from_m[3] = {0.01, 0.02, -0.03}, to_m[3] = {0.012, 0.015, -0.02}, force_n[3] = {1.0, -2.0, 0.5};
    double a[3], b[3], f[3], axes[3][3], third[3], scene_j = 0.0, device_j = 0.0;
    kn_device_position(&d, from_m, a);
    kn_device_position(&d, to_m, b);
    kn_device_force(&d, force_n, f);
    for (int k = 0; k < 3; k++) {
        scene_j += force_n[k] * (b[k] - a[k]);
        device_j += f[k] * (to_m[k] - from_m[k]);
    }
    CHECK(kn_device_check(&d) == NULL);
    CHECK_NEAR(device_j, scene_j / 2.5, 1e-15);
    CHECK_NEAR(kn_dot(f, f), 1.0 + 4.0 + 0.25, 1e-12);
    kn_device_axes(&d, axes);
    kn_cross(axes[1], axes[2], third);
    CHECK_NEAR(kn_dot(axes[0], third), 1.0, 1e-12); // right-handed
}
