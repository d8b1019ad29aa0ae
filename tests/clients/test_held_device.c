#include "clients/hand/haptic_loop.h"
#include "tests/check.h"

static const double origin[3] = {0.0, 0.0, 0.0};

static kn_held_device arm;

// Begin with an arm of 0.1 kg, which nobody holds unless `def` says so.
static void begin(kn_held_device_def def)
{
    def.mass_kg = 0.1;
    kn_held_device_init(&arm, &def, origin);
}

static void run(int ticks, const double force_n[3], const double path_m[3])
{
    for (int i = 0; i < ticks; i++) kn_held_device_tick(&arm, force_n, path_m, origin);
}

TEST("a free mass under a constant force moves by F t^2 / (2 m)")
{
    begin((kn_held_device_def){0});
    run(100, (double[3]){0.0, 0.3, -0.4}, origin);
    CHECK_NEAR(arm.x_m[1], 0.3 * 0.01 / 0.2, 1e-5);
    CHECK_NEAR(arm.x_m[2], -0.4 * 0.01 / 0.2, 1e-5);
    CHECK_NEAR(arm.v_m_s[2], -0.4, 1e-12);
}

TEST("under viscous friction a constant force brings the arm to the speed F / b")
{
    begin((kn_held_device_def){.damping_n_s_m = 2.0});
    run(1000, (double[3]){0.5, 0.0, 0.0}, origin);
    CHECK_NEAR(arm.v_m_s[0], 0.25, 1e-6);
}

TEST("dry friction holds the arm against a weaker force and subtracts its limit from a stronger one, in any direction")
{
    begin((kn_held_device_def){.coulomb_n = 0.5});
    run(500, (double[3]){0.3, 0.3, 0.0}, origin); // 0.42 N
    CHECK(arm.x_m[0] == 0.0 && arm.x_m[1] == 0.0);
    run(100, (double[3]){0.6, 0.8, 0.0}, origin);
    CHECK_NEAR(arm.v_m_s[0], 0.6 * 0.5 / 0.1 * 0.1, 1e-9);
    CHECK_NEAR(arm.v_m_s[1], 0.8 * 0.5 / 0.1 * 0.1, 1e-9);
}

TEST("a force above the limit is cut to the limit and keeps its direction")
{
    begin((kn_held_device_def){.force_limit_n = 3.3});
    run(1, (double[3]){6.0, 0.0, -8.0}, origin);
    CHECK_NEAR(arm.force_n[0], 0.6 * 3.3, 1e-12);
    CHECK_NEAR(arm.force_n[2], -0.8 * 3.3, 1e-12);
}

TEST("measured positions are whole encoder steps and at most half a step from the true position")
{
    double worst = 0.0;
    begin((kn_held_device_def){.encoder_m = 40e-6});
    for (int i = 0; i < 200; i++) {
        run(1, (double[3]){0.01, 0.02, 0.03}, origin);
        for (int k = 0; k < 3; k++) {
            double steps = arm.position_m[k] / 40e-6;
            CHECK_NEAR(steps, round(steps), 1e-9);
            worst = fmax(worst, fabs(arm.position_m[k] - arm.x_m[k]));
        }
    }
    CHECK(worst <= 20e-6 * (1 + 1e-9));
    CHECK(worst > 10e-6);
}

TEST("the measured velocity reaches 63 % of a step after one time constant of its filter")
{
    begin((kn_held_device_def){.velocity_hz = 80.0}); // time constant 2 ms
    arm.v_m_s[0] = 1.0;
    run(2, origin, origin);
    CHECK_NEAR(arm.velocity_m_s[0], 1.0 - exp(-1.0), 0.01);
    run(20, origin, origin);
    CHECK_NEAR(arm.velocity_m_s[0], 1.0, 1e-4);
}

TEST("a hand moves the device along its path, and its springs in series yield to a force")
{
    const double stiffness[KN_GRIPS] = {0, 1 / (1 / 300.0 + 1 / 100.0), 1 / (1 / 800.0 + 1 / 300.0),
                                        1 / (1 / 2500.0 + 1 / 800.0)};
    for (int g = KN_GRIP_LIGHT; g <= KN_GRIP_FIRM; g++) {
        begin((kn_held_device_def){.damping_n_s_m = 0.2, .grip = (kn_grip)g});
        run(3000, (double[3]){0.0, 0.0, 1.0}, (double[3]){0.0, 0.0, -0.02});
        CHECK_NEAR(arm.x_m[2], -0.02 + 1.0 / stiffness[g], 1e-6);
    }
}

TEST("a device of one axis moves freely along z and follows the path exactly along x and y")
{
    begin((kn_held_device_def){.axes = 1});
    for (int i = 0; i < 100; i++)
        kn_held_device_tick(&arm, (double[3]){5.0, 5.0, 0.1}, (double[3]){i * 1e-4, 0.0, 0.0},
                            (double[3]){0.1, 0.0, 0.0});
    CHECK_NEAR(arm.x_m[0], 0.01, 1e-12);
    CHECK(arm.x_m[1] == 0.0);
    CHECK(arm.x_m[2] > 4e-3);
}

TEST("each grip is found by its name, and an unknown name is refused")
{
    kn_grip grip;
    for (int g = 0; g < KN_GRIPS; g++) {
        CHECK(kn_grip_find(kn_grip_name((kn_grip)g), &grip) && (int)grip == g);
        CHECK(strstr(kn_grip_names, kn_grip_name((kn_grip)g)) != NULL);
    }
    CHECK(!kn_grip_find("tight", &grip));
}

TEST("the buzz filter passes all of 100 Hz, 0.71 of 10 Hz, 0.01 of 1 Hz and nothing of a constant")
{
    const double hz[4] = {100.0, 10.0, 1.0, 0.0}, expected[4] = {1.0, sqrt(0.5), 0.01, 0.0};
    for (int i = 0; i < 4; i++) {
        kn_buzz buzz;
        kn_buzz_init(&buzz, 1e-3, hz[i] > 0.0 ? 0.0 : 3.0);
        for (int n = 0; n < 3000; n++) {
            if (n == 1000) kn_buzz_reset(&buzz);
            kn_buzz_add(&buzz, hz[i] > 0.0 ? sqrt(2.0) * sin(6.283185307179586 * hz[i] * n * 1e-3) : 3.0);
        }
        CHECK_NEAR(kn_buzz_rms(&buzz), expected[i], 0.003);
    }
}

TEST("a signal's turn is counted only when the signal comes back by more than the hysteresis")
{
    const double values[] = {0.0, 0.5, 2.0, 1.5, 3.0, 1.0, 1.4, 0.5, 2.0};
    const int turns[] = {0, 0, 0, 0, 0, 1, 1, 1, 2};
    kn_turns t = {.hysteresis = 1.0};
    for (int i = 0; i < 9; i++) {
        kn_turns_add(&t, values[i]);
        CHECK(t.count == turns[i]);
    }
    kn_turns swing = {.hysteresis = 0.1};
    for (int n = 0; n < 1000; n++) kn_turns_add(&swing, sin(6.283185307179586 * 10.0 * n * 1e-3));
    CHECK(swing.count == 20);
}

TESTS_MAIN
