// gate in release: arithmetic, ten times slower with the sanitizers

#include "clients/hand/haptic_loop.h"
#include "tests/check.h"

static const char *const classes[] = {"touch", "falcon", "omega", "unknown"};

static kn_haptic_loop_result run(const char *name, int trip_ms, kn_grip grip, kn_haptic_loop_motion motion,
                                 const kn_lumped_object_def *pad, double stiffer, bool passivity)
{
    kn_device_def device;
    kn_lumped_object_contact c = {0};
    kn_lumped_object_init(&c.pad, pad);
    if (kn_device_profile_load(&device, "test", name, NULL, 0) != 0) KN_TEST_FAIL("no device %s", name);
    c.coupling = kn_coupling_default(device.mass_kg, device.damping_n_s_m, 1e-3, 1e-3 * trip_ms, device.hand);
    c.coupling.stiffness_n_m *= stiffer;
    kn_haptic_loop_def def = {.arm = kn_held_device_of(&device),
                              .coupling = c.coupling,
                              .trip_ms = trip_ms,
                              .passivity = passivity,
                              .motion = motion};
    def.arm.grip = grip;
    return kn_haptic_loop_run(&def, kn_lumped_object_touch, &c);
}

// Check that a device with its default coupling is calm on a pad, and returns no energy to a hand.
static void check_calm(const char *name, int trip_ms, kn_grip grip, kn_haptic_loop_motion motion,
                       const kn_lumped_object_def *pad)
{
    const kn_haptic_loop_result r = run(name, trip_ms, grip, motion, pad, 1.0, true);
    if (r.buzzes || (grip != KN_GRIP_NONE && r.returned_j > 1e-3))
        KN_TEST_FAIL("%s, %s on %s, motion %d, %d ms: %.3f N above 10 Hz, %.1f turns, %.2f mJ", name,
                     kn_grip_name(grip), pad->name, (int)motion, trip_ms, r.force_rms_n, r.turns, 1e3 * r.returned_j);
    CHECK(grip == KN_GRIP_NONE || (r.strokes > 0 && r.peak_n > 0.05)); // the device did touch
}

TEST("no default coupling buzzes without a hand on a wall at round trips of 0 to 20 ms, or buzzes or returns 1 mJ in a "
     "stroke in any grip on any pad at 0 and 1 ms")
{
    static const int trips[] = {0, 1, 2, 5, 10, 20};
    for (int i = 0; i < 6; i++)
        for (int d = 0; d < 4; d++) {
            check_calm(classes[d], trips[i], KN_GRIP_NONE, KN_HAPTIC_LOOP_LEAN, &kn_lumped_objects[0]);
            for (int g = KN_GRIP_LIGHT; g <= KN_GRIP_FIRM && trips[i] <= 1; g++)
                for (int p = 0; p < KN_LUMPED_OBJECTS; p++)
                    for (int m = KN_HAPTIC_LOOP_PRESS; m <= KN_HAPTIC_LOOP_SLIDE; m++)
                        check_calm(classes[d], trips[i], (kn_grip)g, (kn_haptic_loop_motion)m, &kn_lumped_objects[p]);
        }
}

static kn_haptic_loop_result on_lattice(const char *class, const char *material, kn_grip grip,
                                        kn_haptic_loop_motion motion)
{
    char set[64], error[300];
    kn_device_def device;
    snprintf(set, sizeof set, "material=%s", material);
    const char *const sets[] = {set};
    OWN(kn_scene) *scene = kn_scene_load(KN_SOURCE_DIR "/core/scenes/dough-small.yaml", sets, 1, error, sizeof error);
    AT_END(kn_lattice_object_close) kn_lattice_object slab = {0};
    if (!scene || kn_device_profile_load(&device, "test", class, NULL, 0) != 0) fprintf(stderr, "%s\n", error), exit(1);
    kn_coupling coupling = kn_coupling_default(device.mass_kg, device.damping_n_s_m, 1e-3, 1e-3, device.hand);
    kn_haptic_loop_def def = {
        .arm = kn_held_device_of(&device), .coupling = coupling, .trip_ms = 1, .passivity = true, .motion = motion};
    def.arm.grip = grip;
    if (!kn_lattice_object_open(&slab, scene, "finger", &coupling, error, sizeof error))
        fprintf(stderr, "%s\n", error), exit(1);
    kn_haptic_loop_result r = kn_haptic_loop_run(&def, kn_lattice_object_touch, &slab);
    CHECK(!slab.diverged);
    return r;
}

TEST("no default coupling buzzes or returns 1 mJ on the lattice under a ball, without a hand or in a light grip")
{
    static const char *const materials[] = {"dough", "clay", "jelly"};
    for (int c = 0; c < 4; c += 2) // touch, omega; bench/loop runs all of them
        for (int m = 0; m < 3; m++)
            for (int motion = KN_HAPTIC_LOOP_LEAN; motion <= KN_HAPTIC_LOOP_SLIDE; motion++) {
                kn_grip grip = motion == KN_HAPTIC_LOOP_LEAN ? KN_GRIP_NONE : KN_GRIP_LIGHT;
                kn_haptic_loop_result r = on_lattice(classes[c], materials[m], grip, (kn_haptic_loop_motion)motion);
                if (r.buzzes || r.returned_j > 1e-3)
                    KN_TEST_FAIL("%s on %s, motion %d: %.3f N above 10 Hz, %.1f turns, %.2f mJ", classes[c],
                                 materials[m], motion, r.force_rms_n, r.turns, 1e3 * r.returned_j);
                CHECK(r.peak_n > 0.05);
            }
}

TEST("a coupling far above the stability bound buzzes, and the passivity controller more than halves the returned "
     "energy")
{
    kn_haptic_loop_result off = run("touch", 10, KN_GRIP_LIGHT, KN_HAPTIC_LOOP_TAP, &kn_lumped_objects[0], 5.0, false);
    kn_haptic_loop_result on = run("touch", 10, KN_GRIP_LIGHT, KN_HAPTIC_LOOP_TAP, &kn_lumped_objects[0], 5.0, true);
    kn_haptic_loop_result lean = run("touch", 10, KN_GRIP_NONE, KN_HAPTIC_LOOP_LEAN, &kn_lumped_objects[0], 3.4, false);
    CHECK(lean.buzzes);
    CHECK(off.returned_j > 1e-3);
    CHECK(on.returned_j < 0.5 * off.returned_j);
    CHECK(on.acted > 0);
}

TEST("at a round trip of 1 ms the passivity controller never acts")
{
    int64_t acted = 0;
    for (int p = 0; p < KN_LUMPED_OBJECTS; p++)
        for (int g = KN_GRIP_LIGHT; g <= KN_GRIP_FIRM; g++)
            acted += run("touch", 1, (kn_grip)g, KN_HAPTIC_LOOP_TAP, &kn_lumped_objects[p], 1.0, true).acted;
    CHECK(acted == 0);
}

TEST("under a constant force the pad creeps and recovers by the springs and dampers of its definition")
{
    kn_lumped_object_def def = {
        .name = "x", .k1_n_m = 200.0, .c1_n_s_m = 20.0, .c2_n_s_m = 5000.0, .c2_least_n_s_m = 5000.0, .to_n = 1.0};
    kn_coupling stiff = {1e6, 0.0};
    kn_lumped_object pad;
    kn_lumped_object_init(&pad, &def);
    double depth = 0.0, dt = 1e-4; // depth that holds the force at 1 N
    for (int n = 0; n < 10000; n++) {
        depth = pad.voigt_m + pad.flow_m + 1e-6;
        for (int i = 0; i < 20; i++) { // by secants on a copy of the pad
            kn_lumped_object trial = pad;
            double force = kn_lumped_object_tick(&trial, &stiff, dt, depth, 0.0);
            depth += (1.0 - force) / 1e6 + (1.0 - force) * dt * (1 / 20.0 + 1 / 5000.0);
        }
        kn_lumped_object_tick(&pad, &stiff, dt, depth, 0.0);
    }
    CHECK_NEAR(pad.force_n, 1.0, 1e-6);
    CHECK_NEAR(pad.voigt_m, 1.0 / 200.0 * (1.0 - exp(-1.0 / 0.1)), 1e-6);
    CHECK_NEAR(pad.flow_m, 1.0 / 5000.0, 1e-7);
    CHECK_NEAR(kn_lumped_object_stored_j(&pad), 0.5 * 200.0 * pad.voigt_m * pad.voigt_m, 1e-15);
    for (int n = 0; n < 20000; n++) kn_lumped_object_tick(&pad, &stiff, dt, -0.01, 0.0);
    CHECK_NEAR(pad.voigt_m, 0.0, 1e-6); // the elastic part returns
    CHECK_NEAR(pad.flow_m, 2e-4, 1e-7); // the plastic part stays
}

TEST("a pad never pulls, and a wall never yields")
{
    kn_coupling coupling = {600.0, 1.5};
    for (int p = 0; p < KN_LUMPED_OBJECTS; p++) {
        kn_lumped_object pad;
        kn_lumped_object_init(&pad, &kn_lumped_objects[p]);
        for (int n = 0; n < 3000; n++) {
            double w = 0.0125 * n,
                   force = kn_lumped_object_tick(&pad, &coupling, 1e-3, 0.005 * sin(w), 0.0625 * cos(w));
            CHECK(force >= 0.0 && isfinite(force));
            if (p == 0 && n > 0 && sin(w) > 0.1 && cos(w) > 0.1)
                CHECK_NEAR(force, 600.0 * 0.005 * sin(w) + 1.5 * 0.0625 * cos(w), 1e-12);
        }
        CHECK(p > 0 || pad.voigt_m + pad.flow_m == 0.0);
    }
}

TESTS_MAIN
