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
    kn_device_session_force f = {
        .session = session, .seq = tested.seq, .tick = ++ticks, .flags = flags, .fault = fault, .age_s = age_s};
    memcpy(f.force_n, force_n, sizeof f.force_n);
    bool ours = kn_device_session_take(&tested, &f);
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

TEST("a force above the device's limit is cut to the limit and keeps its direction")
{
    begin();
    live(10, true, true);
    for (int i = 1; i <= 20; i++) { // in steps below the impulse guard's 4 N per ms
        kn_device_session_pose(&tested, here, here);
        force(100, (double[]){1.5 * i, 2.0 * i, 0}, 0, 0);
        tick(1);
    }
    CHECK_NEAR(hypot(given()[0], given()[1]), 3.3, 1e-12);
    CHECK_NEAR(given()[0] / given()[1], 0.75, 1e-12);
    CHECK(tested.render.clamped == 19 && tested.render.guards == 0);
}

TEST("if kneadd falls silent the force stays for 3 ms and is 0 N by 20 ms")
{
    begin();
    live(100, true, true);
    double last_n = given()[2];
    for (int ms = 1; ms <= 20; ms++) {
        live(1, true, false);
        if (ms <= 3) CHECK(given()[2] == 2.0);
        CHECK(given()[2] <= last_n);
        last_n = given()[2];
    }
    CHECK(given()[2] == 0.0 && tested.mode == KN_SESSION_SILENT);
    CHECK(tested.forces.trips == 1 && !kn_device_session_live(&tested));
}

TEST("if the device falls silent the force is 0 N by 20 ms, even while forces arrive")
{
    begin();
    live(100, true, true);
    live(19, false, true);
    CHECK(given()[2] > 0.0 && given()[2] < 2.0);
    live(1, false, true);
    CHECK(given()[2] == 0.0 && tested.mode == KN_SESSION_SILENT && tested.poses.trips == 1);
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

TEST("an object that gives out energy is damped by the passivity controller, and an object at rest is not")
{
    kn_haptic_render_def def = upright(3.3);
    def.device.mass_kg = 0.05;
    def.device.hand.stiffness_n_m = 500.0;
    kn_device_session_init(&tested, 100, &def);
    double x_m[3] = {0}, v_m_s[3] = {0};
    for (int ms = 0; ms < 2000; ms++) { // pushed along all the time, which no passive object does
        v_m_s[2] = 0.1;
        x_m[2] += 1e-3 * v_m_s[2];
        kn_device_session_pose(&tested, x_m, v_m_s);
        force(100, push_n, KN_FLAG_ENGAGED, 0);
        tick(1);
    }
    CHECK(tested.render.passivity.acted > 1000 && given()[2] < 2.0);
    CHECK(tested.render.passivity.given_j < 0.25); // without damping it would give 0.4 J
    kn_device_session_init(&tested, 100, &def);
    live(1000, true, true);
    CHECK(tested.render.passivity.acted == 0 && given()[2] == 2.0); // at rest no energy is given
}

TEST("after a stall of 25 ms the force is 0 N")
{
    begin();
    live(100, true, true);
    kn_device_session_pose(&tested, here, here);
    force(100, push_n, 0, 0);
    tick(25);
    CHECK(given()[2] == 0.0 && tested.mode == KN_SESSION_SILENT);
}

TEST("a jumping force trips the reflex guard: the last force fades, and a new session begins")
{
    begin();
    live(100, true, true);
    force(100, (double[]){0, 0, -50}, KN_FLAG_ENGAGED, 0);
    CHECK(given()[2] == 2.0 || tested.render.gain < 1.0);
    double last_n = given()[2];
    for (int ms = 1; ms <= 20; ms++) {
        live(1, true, true); // later valid forces are ignored
        CHECK(given()[2] <= last_n && given()[2] >= last_n - 2.0 / 17 - 1e-9);
        last_n = given()[2];
    }
    CHECK(last_n == 0.0 && tested.mode == KN_SESSION_SILENT && tested.render.reflexes == 1 &&
          !kn_device_session_live(&tested));
    live(1200, true, false);
    CHECK(tested.session == 101 && tested.mode == KN_SESSION_HELD);
    live(2, true, true);
    CHECK(given()[2] == 2.0);
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

static double deep_m; // depth of the device in a wall at z = 0

// The same with the local model: contacts come with the forces.
static void live_local(int ms, bool poses, bool forces)
{
    kn_contact_unit unit = {.flags = KN_CONTACT_ENGAGED,
                            .contact_count = 1,
                            .normal = {0, 0, 1},
                            .a_n_s_per_m = 1e4,
                            .c2_n_s_per_m = 1e5,
                            .k_vc_n_per_m = 500.0,
                            .b_vc_n_s_per_m = 1.5,
                            .valid_ms = 100};
    const double x[3] = {0, 0, -deep_m};
    for (int i = 0; i < ms; i++) {
        bool sent = poses && kn_device_session_pose(&tested, x, here);
        if (sent && forces) {
            unit.session = tested.session;
            unit.pose_seq = tested.seq;
            unit.utime = (int64_t)(1e6 * now_s);
            unit.force_n = 500.0 * deep_m;
            kn_haptic_render_contact(&tested.render, &unit);
        }
        if (forces) force(tested.session, push_n, KN_FLAG_ENGAGED, 0);
        tick(1);
    }
}

static void begin_local(void)
{
    kn_haptic_render_def def = upright(3.3);
    def.local = true;
    def.coupling_n_m = 500.0;
    def.coupling_n_s_m = 1.5;
    kn_device_session_init(&tested, 100, &def);
    deep_m = 0.0;
    live_local(400, true, true);
    for (deep_m = 0.0; deep_m < 1e-3; deep_m += 1e-5) live_local(1, true, true);
    live_local(100, true, true);
}

TEST("with the local model the force outlasts 20 ms of silence and is 0 N by 300 ms")
{
    begin_local();
    double pressed_n = given()[2], last_n = pressed_n;
    CHECK(pressed_n > 0.3 && pressed_n < 0.6);
    for (int ms = 1; ms <= 300; ms++) {
        live_local(1, true, false);
        CHECK(given()[2] <= last_n + 0.01 && given()[2] >= last_n - 0.05);
        if (ms == 20) CHECK(given()[2] > 0.9 * pressed_n);
        last_n = given()[2];
    }
    CHECK(last_n == 0.0 && tested.mode == KN_SESSION_SILENT && tested.forces.trips == 1);
}

TEST("with the local model a link outage of 200 ms causes no force step above 0.05 N")
{
    begin_local();
    double pressed_n = given()[2], last_n = pressed_n, largest_n = 0.0;
    for (int ms = 0; ms < 1000; ms++) {
        live_local(1, true, ms >= 200);
        largest_n = fmax(largest_n, fabs(given()[2] - last_n));
        last_n = given()[2];
        if (ms == 199) CHECK(last_n < 0.5 * pressed_n);
    }
    CHECK(largest_n <= 0.05); // N/ms
    CHECK_NEAR(last_n, pressed_n, 0.1 * pressed_n);
    CHECK(tested.forces.trips == 0 && tested.render.guards == 0 && tested.session == 100);
}

TEST("with the local model a silent device still gives 0 N by 20 ms")
{
    begin_local();
    live_local(20, false, true);
    CHECK(given()[2] == 0.0 && tested.mode == KN_SESSION_SILENT && tested.poses.trips == 1);
}

TEST("a force older than the last one is not given")
{
    begin();
    live(100, true, true);
    kn_device_session_force old = {
        .session = 100, .seq = 98, .tick = ticks - 2, .force_n = {0, 0, 1}, .flags = KN_FLAG_ENGAGED, .age_s = age_s};
    CHECK(!kn_device_session_take(&tested, &old) && tested.late == 1);
    tick(1);
    CHECK(given()[2] == 2.0 && tested.heard == 100);
}

TEST("repeated or older forces do not feed the watchdog: 0 N by 20 ms, then a new session")
{
    for (int back = 0; back < 3; back++) { // the newest force, one before it, one of the first tick
        begin();
        ticks += INT64_C(86400000); // a day of ticks
        live(100, true, true);
        kn_device_session_force again = {.session = 100,
                                         .seq = tested.seq,
                                         .tick = back == 2 ? 0 : ticks - back,
                                         .force_n = {0, 0, 2},
                                         .flags = KN_FLAG_ENGAGED,
                                         .age_s = age_s};
        for (int ms = 1; ms <= 20; ms++) {
            kn_device_session_pose(&tested, here, here);
            for (int n = 0; n < 3; n++) CHECK(!kn_device_session_take(&tested, &again));
            tick(1);
        }
        CHECK(given()[2] == 0.0 && tested.mode == KN_SESSION_SILENT && tested.forces.trips == 1 && tested.late == 60);
        live(1200, true, false);
        CHECK(tested.mode == KN_SESSION_HELD && tested.session == 101);
        again.session = 101, again.seq = 0;
        CHECK(kn_device_session_take(&tested, &again)); // from a kneadd that started anew, at any tick
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
