#include "clients/tactile/bridge.h"
#include "clients/tactile/device_session.h"
#include "tests/check.h"
#include <string.h>

static kn_device_session tested;
static double now_s, age_s = 1e-3; // age of every force's pose
static const double here[3], push_n[3] = {0, 0, 2};
static int64_t ticks; // ticks of kneadd

static kn_haptic_render_def upright(double force_limit_n)
{
    kn_haptic_render_def def = {0};
    kn_mount_init(&def.device);
    def.device.force_limit_n = force_limit_n;
    return def;
}

static void begin(void)
{
    kn_haptic_render_def def = upright(3.3);
    kn_device_session_init(&tested, 100, &def);
    now_s = tested.given_s;
}

static bool force(int64_t session, const double force_n[3], int32_t flags, int32_t fault)
{
    knead_contact_force_t f = {.session = session, .seq = tested.seq, .tick = ++ticks, .flags = flags, .fault = fault};
    memcpy(f.force_n, force_n, sizeof f.force_n);
    bool ours = kn_device_session_take(&tested, &f, age_s);
    if (ours) kn_device_session_give(&tested, now_s);
    return ours;
}

static const double *given(void) { return tested.render.given_n; }

static void tick(int ms)
{
    now_s += 1e-3 * ms;
    kn_device_session_tick(&tested, now_s, ms);
}

// Run so many ms of a device and of kneadd. Either may be silent.
static void live(int ms, bool poses, bool forces)
{
    for (int i = 0; i < ms; i++) {
        if (poses) kn_device_session_pose(&tested, here, here);
        if (forces) force(tested.session, push_n, KN_FLAG_ENGAGED, 0);
        tick(1);
    }
}

TEST("a force is given as received, and pose numbers rise by one")
{
    begin();
    live(100, true, true);
    CHECK(given()[2] == 2.0 && kn_device_session_live(&tested));
    CHECK(tested.seq == 100 && tested.sent == 100 && tested.heard == 100);
    CHECK(kn_device_session_pose(&tested, here, here) && tested.seq == 101);
    CHECK(force(100, (double[]){0, 1, 0}, 0, 0));
    CHECK(given()[1] == 1.0 && given()[2] == 0.0);
}

TEST("after a trip no pose is sent for 1.2 s, then a new session begins and ignores forces of the old one")
{
    begin();
    live(100, true, true);
    live(20, true, false);
    int64_t sent = tested.sent;
    live(1199, true, true);
    CHECK(tested.sent == sent && tested.session == 100 && given()[2] == 0.0);
    live(1, true, true);
    CHECK(tested.mode == KN_SESSION_HELD && tested.session == 101 && tested.seq == 0 && given()[2] == 0.0);
    CHECK(!force(100, push_n, 0, 0) && tested.foreign == 1 && given()[2] == 0.0);
    live(2, true, true);
    CHECK(given()[2] == 2.0);
}

TEST("a silent device opens no new session until its poses return")
{
    begin();
    live(100, true, true);
    live(5000, false, false);
    CHECK(tested.mode == KN_SESSION_SILENT && tested.session == 100);
    live(1, true, false);
    CHECK(tested.mode == KN_SESSION_HELD && tested.session == 101);
}

TEST("waiting for a kneadd that never ran causes no trip")
{
    begin();
    live(5000, true, false);
    CHECK(tested.mode == KN_SESSION_HELD && tested.forces.trips == 0 && tested.sent == 5000);
    live(1, true, true);
    CHECK(given()[2] == 2.0);
}

TEST("NaN and infinite values are counted, are not given, and do not feed the watchdog")
{
    begin();
    live(100, true, true);
    CHECK(!kn_device_session_pose(&tested, (double[]){0, NAN, 0}, here));
    CHECK(!kn_device_session_pose(&tested, here, (double[]){0, 0, INFINITY}));
    CHECK(!force(100, (double[]){NAN, 0, 0}, 0, 0) && given()[0] == 0.0);
    CHECK(tested.refused == 3 && tested.sent == 100);
    for (int ms = 0; ms < 20; ms++) {
        kn_device_session_pose(&tested, here, here);
        force(100, (double[]){0, INFINITY, 0}, 0, 0);
        tick(1);
    }
    CHECK(tested.forces.trips == 1 && given()[2] == 0.0);
}

TEST("the impulse guard's latch begins a new session, and a latch that lifting clears does not")
{
    begin();
    live(100, true, true);
    force(100, (double[3]){0}, KN_FLAG_LATCHED, KN_FAULT_POSE_SILENCE);
    live(1, true, false);
    CHECK(tested.mode == KN_SESSION_HELD && tested.faults == 0);
    force(100, (double[3]){0}, KN_FLAG_LATCHED, KN_FAULT_IMPULSE);
    live(1, true, false);
    CHECK(tested.mode == KN_SESSION_SILENT && tested.faults == 1);
    live(1200, true, false);
    CHECK(tested.session == 101 && tested.faults == 1);
}

TEST("forces that answer old poses are refused within the session, and a new session begins when the delay is gone")
{
    begin();
    age_s = 20e-3;
    live(200, true, true);
    CHECK(tested.render.refusals == 1 && given()[2] == 0.0 && !kn_device_session_live(&tested));
    CHECK(tested.mode == KN_SESSION_HELD && tested.sent == 200);
    age_s = 1e-3;
    live(200, true, true);
    CHECK(tested.mode == KN_SESSION_SILENT);
    live(1200, true, false);
    live(2, true, true);
    CHECK(tested.session == 101 && given()[2] == 2.0 && tested.render.refusals == 1);
}

TEST("if the device or kneadd falls silent, or the device stalls, the force is 0 N by 20 ms")
{
    static const struct {
        const char *name;
        bool poses, forces;
        int elapsed_ms; // of each tick
    } rows[] = {{"kneadd is silent", true, false, 1},
                {"the device is silent, forces arrive", false, true, 1},
                {"the device stalls for 25 ms", false, false, 25}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        begin();
        live(100, true, true);
        double last_n = given()[2];
        for (int ms = rows[i].elapsed_ms; ms <= 25; ms += rows[i].elapsed_ms) {
            if (rows[i].elapsed_ms > 1) tick(rows[i].elapsed_ms);
            else live(1, rows[i].poses, rows[i].forces);
            if (given()[2] > last_n || (ms <= 3 && given()[2] != 2.0) || (ms >= 20 && given()[2] != 0))
                KN_TEST_FAIL("%s: %g N after %d ms", rows[i].name, given()[2], ms);
            last_n = given()[2];
        }
        CHECK(tested.mode == KN_SESSION_SILENT && !kn_device_session_live(&tested));
        CHECK(tested.forces.trips == !rows[i].forces && tested.poses.trips == !rows[i].poses);
    }
}

TEST("repeated or older forces do not feed the watchdog: 0 N by 20 ms, then a new session")
{
    for (int back = 0; back < 3; back++) { // the newest force, one before it, one of the first tick
        begin();
        ticks += INT64_C(86400000); // a day of ticks
        live(100, true, true);
        knead_contact_force_t again = {.session = 100,
                                       .seq = tested.seq,
                                       .tick = back == 2 ? 0 : ticks - back,
                                       .force_n = {0, 0, 2},
                                       .flags = KN_FLAG_ENGAGED};
        for (int ms = 1; ms <= 20; ms++) {
            kn_device_session_pose(&tested, here, here);
            for (int n = 0; n < 3; n++) CHECK(!kn_device_session_take(&tested, &again, age_s));
            tick(1);
        }
        CHECK(given()[2] == 0.0 && tested.mode == KN_SESSION_SILENT && tested.forces.trips == 1 && tested.late == 60);
        live(1200, true, false);
        CHECK(tested.mode == KN_SESSION_HELD && tested.session == 101);
        again.session = 101, again.seq = 0;
        CHECK(kn_device_session_take(&tested, &again, age_s)); // from a kneadd that started anew, at any tick
    }
}

TEST("a fading force changes by at most 0.5 N per ms, even if the hand shakes and is damped")
{
    kn_haptic_render_def def = upright(3.3);
    def.device.mass_kg = 0.08;
    def.device.hand.stiffness_n_m = 600.0;
    for (double shake_m_s = 0.05; shake_m_s < 0.5; shake_m_s += 0.05) {
        kn_device_session_init(&tested, 100, &def);
        double x_m[3] = {0}, v_m_s[3] = {0}, last_n = 0, steepest_n = 0;
        for (int ms = 0; ms < 320; ms++) {
            v_m_s[2] = ms < 300 ? 0.1 : ms % 2 ? shake_m_s : 0; // pushed along, then silence and a shaking hand
            x_m[2] += 1e-3 * v_m_s[2];
            kn_device_session_pose(&tested, x_m, v_m_s);
            if (ms < 300) force(100, push_n, KN_FLAG_ENGAGED, 0);
            tick(1);
            if (ms > 303) steepest_n = fmax(steepest_n, fabs(given()[2] - last_n));
            last_n = given()[2];
        }
        CHECK(tested.render.passivity.acted > 200);
        if (steepest_n > 0.5) KN_TEST_FAIL("%g m/s: %.2f N in a ms", shake_m_s, steepest_n);
    }
}

TEST("a single stall of 20 ms does not count as a distant link")
{
    begin();
    live(100, true, true);
    for (int i = 0; i < 20; i++) {
        age_s = 1e-3 * (21 - i);
        live(1, true, true);
    }
    age_s = 1e-3;
    live(100, true, true);
    CHECK(tested.render.refusals == 0 && given()[2] == 2.0);
}

TESTS_MAIN
