#include "clients/hand/haptic_render.h"
#include "tests/check.h"

static kn_haptic_render render;
static const double still[3];
static int64_t seq;

static void begin(kn_haptic_render_def def)
{
    def.device.force_limit_n = 8.0;
    def.device.force_scale = def.device.scale = 1.0;
    memcpy(def.device.basis, (double[]){1, 2, 3}, sizeof def.device.basis);
    def.device.rotation_wxyz[0] = 1.0;
    kn_haptic_render_init(&render, &def);
    kn_haptic_render_begin(&render, 7);
    seq = 0;
}

// Run for a time with a force upwards. Return the force given to the motors.
static double after_ms(double ms, double force_n)
{
    kn_haptic_render_force(&render, (double[]){0, 0, force_n}, 1e-3);
    kn_haptic_render_give(&render, 1e-3 * ms, still, still, 1.0);
    return render.given_n[2];
}
static double ms(double force_n) { return after_ms(1, force_n); }

static void rest(int count, double force_n)
{
    for (int i = 0; i < count; i++) ms(force_n);
}

TEST("a single wild force moves the output by 4 N and is counted, and the next good force is given")
{
    begin((kn_haptic_render_def){0});
    rest(50, 1.0);
    CHECK_NEAR(ms(8.0), 5.0, 1e-12);
    CHECK_NEAR(ms(1.1), 1.1, 1e-12);
    CHECK(render.guards == 1 && !render.stop);
}

TEST("a jump above 8 N, two opposite jumps or three in 20 ms trip the reflex guard, and the force fades to 0")
{
    static const double wild[3][8] = {{50}, {7, -4}, {7, 7, 11, 11, 15.5}};
    for (int kind = 0; kind < 3; kind++) {
        begin((kn_haptic_render_def){0});
        rest(50, 2.0);
        double last_n = 2.0, largest_step_n = 0.0;
        for (int i = 0; i < 8 && !render.stop; i++) {
            ms(wild[kind][i] != 0.0 ? wild[kind][i] : last_n);
            largest_step_n = fmax(largest_step_n, fabs(render.given_n[2] - last_n));
            last_n = render.given_n[2];
        }
        CHECK(render.stop == KN_HAPTIC_RENDER_REFLEX && render.reflexes == 1 && largest_step_n <= 4.0 + 1e-9);
        rest(1000, 2.0);
        CHECK(render.given_n[2] == 0.0 && render.reflexes == 1);
        kn_haptic_render_begin(&render, 8);
        CHECK(ms(2.0) == 2.0);
    }
}

TEST("at any call rate the guard allows 4 N per ms and a proportional part in between")
{
    begin((kn_haptic_render_def){0});
    rest(50, 0.0);
    CHECK_NEAR(after_ms(1.0, 7.9), 4.0, 1e-12);
    CHECK_NEAR(after_ms(0.05, 7.9), 4.2, 1e-12);
    CHECK_NEAR(after_ms(0.05, 7.9), 4.4, 1e-12);
    CHECK(render.guards == 1 && !render.stop);
    CHECK_NEAR(after_ms(0.875, 7.9), 7.9, 1e-12); // the ms is over then
    CHECK(!render.stop);
    begin((kn_haptic_render_def){0});
    rest(50, 0.0);
    double most_n = 0.0;
    for (int i = 1; i <= 10; i++) most_n = fmax(most_n, after_ms(0.1, 3.9 * i)); // 39 N in a ms
    CHECK(render.stop == KN_HAPTIC_RENDER_REFLEX && most_n < 4.0 + 0.4 * 3);
    begin((kn_haptic_render_def){0});
    rest(50, 0.0);
    for (int i = 1; i <= 8; i++) CHECK_NEAR(after_ms(0.25, 0.95 * i), 0.95 * i, 1e-12); // 3.8 N in a ms
    CHECK(render.guards == 0);
}

TEST("the guard uses the limit of the device definition instead of 4 N per ms, and allows a larger step after a gap of "
     "3 ms without messages")
{
    begin((kn_haptic_render_def){.guard_n_per_ms = 2.0});
    rest(50, 1.0);
    CHECK_NEAR(ms(4.0), 3.0, 1e-12);
    begin((kn_haptic_render_def){0});
    rest(50, 1.0);
    for (int i = 0; i < 2; i++) kn_haptic_render_give(&render, 1e-3, still, still, 1.0);
    CHECK(ms(8.0) == 8.0 && render.guards == 0);
}

static const kn_contact_unit wall = {.utime = 1,
                                     .session = 7,
                                     .pose_seq = 1,
                                     .flags = KN_CONTACT_ENGAGED,
                                     .contact_count = 1,
                                     .normal = {0, 0, 1},
                                     .a_n_s_per_m = 1e4,
                                     .c2_n_s_per_m = 1e5,
                                     .k_vc_n_per_m = 500.0,
                                     .b_vc_n_s_per_m = 1.5,
                                     .valid_ms = 100};

// Hold the device 1 mm deep in a wall at z = 0, with messages at 1 kHz.
static void press(double turned_z, int count)
{
    const double x[3] = {0, 0, -1e-3 * turned_z};
    kn_contact_unit unit = wall;
    for (int i = 0; i < count; i++) {
        unit.utime = unit.pose_seq = ++seq;
        unit.force_n = 0.5;
        kn_haptic_render_pose(&render, seq, x, still);
        kn_haptic_render_contact(&render, &unit);
        kn_haptic_render_give(&render, 1e-3, x, still, 1.0);
    }
}

static const kn_haptic_render_def local = {.local = true, .coupling_n_m = 500.0, .coupling_n_s_m = 1.5};

TEST("with the local model kneadd's forces are ignored, and contacts are rendered in the device's axes and clamped")
{
    begin(local);
    rest(50, 2.0);
    CHECK(render.given_n[2] == 0.0);
    press(1.0, 400);
    CHECK_NEAR(render.given_n[2], 0.5, 0.05);
    render.def.device.force_limit_n = 0.3;
    press(1.0, 1);
    CHECK_NEAR(render.given_n[2], 0.3, 1e-12);
    begin(local);
    render.def.device.basis[1] = -2, render.def.device.basis[2] = -3; // upside down
    press(-1.0, 400);
    CHECK_NEAR(render.given_n[2], -0.5, 0.05);
}

TEST("a wild contact stops the device by the reflex guard")
{
    begin(local);
    press(1.0, 400);
    kn_contact_unit unit = wall;
    unit.utime = unit.pose_seq = 401;
    unit.proxy_m[2] = 0.05; // 25 N
    double before_n = render.given_n[2];
    kn_haptic_render_pose(&render, 401, (double[]){0, 0, -1e-3}, still);
    kn_haptic_render_contact(&render, &unit);
    kn_haptic_render_give(&render, 1e-3, (double[]){0, 0, -1e-3}, still, 1.0);
    CHECK(render.stop == KN_HAPTIC_RENDER_REFLEX && render.given_n[2] <= before_n);
}

TESTS_MAIN
