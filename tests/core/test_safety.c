#include "core/safety.h"
#include "core/algebra/algebra.h"
#include "tests/check.h"
#include "tests/dice.h"

typedef struct rig { // a probe driven by a test: one call is one tick
    kn_safety s;
    kn_safety_in in;
    double contact_n[3], torque_n_m[3];
    double out_n[3], out_n_m[3];
    int flags;
} rig;

static rig rig_make(double clamp_n)
{
    rig r = {.in = {.live = true, .fresh = true, .clear = true, .elapsed_ms = 1}};
    kn_safety_limits limits = {.clamp_n = clamp_n};
    kn_safety_init(&r.s, &limits);
    return r;
}

static void tick(rig *r)
{
    kn_safety_watch(&r->s, &r->in);
    r->flags = kn_safety_filter(&r->s, &r->in, r->contact_n, r->torque_n_m, r->out_n, r->out_n_m);
}

static void ticks(rig *r, int n)
{
    for (int i = 0; i < n; i++) tick(r);
}

static void during(rig *r, bool *input, bool value, int n) // an input that has this value for n ticks
{
    *input = value;
    ticks(r, n);
    *input = !value;
}

static void pulse(rig *r, bool *input) { during(r, input, true, 1); }

static double length(const double v[3]) { return sqrt(kn_dot(v, v)); }

// Run a tick and check the vertical force.
#define TICK_GIVES(r, force)                                                                                           \
    do {                                                                                                               \
        tick(r);                                                                                                       \
        CHECK_NEAR((r)->out_n[2], force, 1e-9);                                                                        \
    } while (0)

static rig rig_in_air(double clamp_n) // at full gain
{
    rig r = rig_make(clamp_n);
    ticks(&r, 401);
    return r;
}

// Return a probe in contact with full gain, under a force along z that was reached in small steps.
static rig rig_pressing(double clamp_n, double force_n)
{
    rig r = rig_in_air(clamp_n);
    for (int i = 1; i <= 20; i++) {
        r.contact_n[2] = force_n * i / 20.0;
        tick(&r);
    }
    return r;
}

TEST("a probe engages after 200 ms of poses in free air, and its gain reaches 1 in another 200 ms")
{
    rig r = rig_make(40.0);
    ticks(&r, 199);
    CHECK(!r.s.attached && r.s.gain == 0.0);
    tick(&r);
    CHECK(r.s.attached);
    r.contact_n[2] = 3.0; // no real contact could start here; this test looks at the gain only
    for (int i = 1; i <= 200; i++) {
        TICK_GIVES(&r, 3.0 * i / 200.0);
        CHECK(!(r.flags & KN_FLAG_ENGAGED) == (i < 200));
    }
}

TEST("a tool that starts inside the object gets no force until it is lifted")
{
    rig r = rig_make(40.0);
    r.in.clear = false;
    r.contact_n[2] = 2.0;
    ticks(&r, 1000);
    CHECK(!r.s.attached && length(r.out_n) == 0.0);
    CHECK(r.flags & KN_FLAG_REENGAGE_LIFT);
    pulse(&r, &r.in.clear);
    CHECK(r.s.attached && !(r.flags & KN_FLAG_REENGAGE_LIFT));
}

TEST("without poses the force holds for 3 ms, falls linearly to zero at 20 ms and stays zero")
{
    rig r = rig_pressing(40.0, 8.5);
    r.in.fresh = false;
    for (int ms = 1; ms <= 100; ms++) {
        r.contact_n[2] = 8.5 + ms; // the model's force during the silence is ignored
        TICK_GIVES(&r, 8.5 * (ms <= 3 ? 1.0 : ms >= 20 ? 0.0 : (20 - ms) / 17.0));
        CHECK(r.flags & KN_FLAG_STALE);
        if (ms > 3) CHECK(r.s.fault == KN_FAULT_POSE_SILENCE);
        CHECK(!(r.flags & KN_FLAG_LATCHED) == (ms < 20));
        if (ms >= 20) CHECK(r.out_n[2] == 0.0 && !r.s.attached);
    }
    CHECK(r.s.faults == 1);
}

TEST("a silence that ends before the deadline fades the force and ramps it in again without a latch")
{
    rig r = rig_pressing(3.3, 3.0);
    during(&r, &r.in.fresh, false, 10);
    CHECK_NEAR(r.s.gain, 10.0 / 17.0, 1e-12);
    double before = r.out_n[2];
    r.contact_n[2] = 1.0; // the contact changed meanwhile: the force must approach the new value without a jump
    tick(&r);
    CHECK(r.s.fault == KN_FAULT_NONE && r.s.faults == 0);
    CHECK(fabs(r.out_n[2] - before) <= kn_safety_slope(&r.s.limits));
    ticks(&r, 199);
    TICK_GIVES(&r, 1.0);
}

TEST("a latched silence clears by lifting the tool while poses flow, not by poses alone")
{
    rig r = rig_pressing(40.0, 5.0);
    during(&r, &r.in.fresh, false, 50);
    during(&r, &r.in.clear, false, 1000);
    CHECK((r.flags & KN_FLAG_LATCHED) && (r.flags & KN_FLAG_REENGAGE_LIFT) && length(r.out_n) == 0.0);
    r.contact_n[2] = 0.0;
    ticks(&r, 201);
    CHECK(r.s.fault == KN_FAULT_NONE && (r.flags & KN_FLAG_ENGAGED));
}

TEST("cycles that the server missed count as silence, and a stall beyond the deadline latches")
{
    rig r = rig_pressing(40.0, 5.0), q = r;
    // The fresh pose may have come at the end of these 9 ms. Then 8 ms were silent, 5 of them past the hold.
    r.in.elapsed_ms = 9;
    tick(&r);
    CHECK_NEAR(r.s.gain, 1.0 - 5.0 / 17.0, 1e-12);
    q.in.elapsed_ms = 50;
    tick(&q);
    // not a pose silence: the hand was not silent
    CHECK(q.s.fault == KN_FAULT_OVERLOAD && q.s.latched && length(q.out_n) == 0.0);
    q.in.elapsed_ms = 1;
    ticks(&q, 201);
    CHECK(q.s.fault == KN_FAULT_NONE && (q.flags & KN_FLAG_ENGAGED) == 0 && q.s.attached);
}

TEST("an overload never hides a fault that needs more than lifting") // its fade and its end: server.servo
{
    rig r = rig_pressing(40.0, 5.0);
    kn_safety_trip(&r.s, KN_FAULT_IMPULSE);
    kn_safety_trip(&r.s, KN_FAULT_OVERLOAD);
    CHECK(r.s.fault == KN_FAULT_IMPULSE && r.s.tripped[KN_FAULT_OVERLOAD] == 0);
}

TEST("a first contact of 1.2 N/ms, steeper than a press into dough, does not trigger the impulse guard")
{
    rig r = rig_in_air(40.0);
    for (int i = 0; i < 30; i++) {
        r.contact_n[2] += 1.2;
        tick(&r);
    }
    CHECK(r.s.guards == 0 && r.s.fault == KN_FAULT_NONE);
    CHECK_NEAR(r.out_n[2], 36.0, 1e-12);
}

TEST("the impulse guard limits a single outlier to 4 N/ms and counts it; hits more than 20 ticks apart are no fault")
{
    rig r = rig_pressing(40.0, 5.0);
    r.contact_n[2] = 11.0;
    TICK_GIVES(&r, 9.0);
    CHECK((r.flags & KN_FLAG_GUARD) && r.s.guards == 1 && r.s.fault == KN_FAULT_NONE);
    TICK_GIVES(&r, 11.0);
    CHECK(!(r.flags & KN_FLAG_GUARD));
    r = rig_pressing(40.0, 0.0);
    for (int i = 0; i < 100; i++) {
        r.contact_n[0] += 5.0; // 5 N in one ms, then 25 ms of rest
        ticks(&r, 25);
    }
    CHECK(r.s.guards == 100 && r.s.fault == KN_FAULT_NONE);
}

TEST("three guard hits in 20 ticks, an alternating pair or one request above twice the guard latch and fade in 17 ms")
{
    static const double patterns[3][4] = {{6.0, 6.0, 6.0, 6.0}, {6.0, -6.0, 0.0, 0.0}, {8.5, 0.0, 0.0, 0.0}};
    for (int p = 0; p < 3; p++) {
        rig r = rig_pressing(40.0, 5.0);
        for (int i = 0; i < 3 && !r.s.latched; i++) {
            r.contact_n[2] = r.s.force_n[2] + patterns[p][i];
            double before = r.out_n[2];
            tick(&r);
            if (r.s.latched) CHECK(r.out_n[2] == before); // the tick that trips leaves the output unchanged
        }
        CHECK(r.s.fault == KN_FAULT_IMPULSE && r.s.latched && r.s.guards == 3 - p);
        double from = r.out_n[2];
        r.contact_n[2] = 1e9;
        for (int i = 1; i <= 17; i++) TICK_GIVES(&r, from * (17 - i) / 17.0);
        CHECK(length(r.out_n) == 0.0 && !r.s.attached);
    }
}

TEST("an impulse fault survives lifting and is cleared by a new session or by recover")
{
    for (int way = 0; way < 2; way++) {
        rig r = rig_pressing(40.0, 5.0);
        r.contact_n[2] = 100.0;
        tick(&r);
        r.contact_n[2] = 0.0;
        ticks(&r, 1000);
        CHECK(r.s.fault == KN_FAULT_IMPULSE && !r.s.attached);
        pulse(&r, way ? &r.in.recover : &r.in.opened);
        ticks(&r, 400);
        CHECK(r.s.fault == KN_FAULT_NONE && (r.flags & KN_FLAG_ENGAGED));
    }
}

TEST("a non-finite force is never sent; the last good force fades, and only a reset clears the fault")
{
    rig r = rig_pressing(40.0, 5.0);
    r.contact_n[1] = NAN;
    tick(&r);
    CHECK(r.out_n[2] == 5.0 && r.s.fault == KN_FAULT_NONFINITE);
    ticks(&r, 17);
    CHECK(length(r.out_n) == 0.0);
    r.contact_n[1] = r.contact_n[2] = 0.0;
    during(&r, &r.in.recover, true, 500);
    CHECK(r.s.fault == KN_FAULT_NONFINITE && !r.s.attached);
    for (int later = 0; later < 2; later++) { // an emergency stop after the fault, then one before it
        pulse(&r, &r.in.estop);
        r.contact_n[1] = later ? NAN : 0.0;
        tick(&r);
        r.contact_n[1] = 0.0;
        CHECK(r.s.fault == KN_FAULT_ESTOP && r.s.tripped[KN_FAULT_NONFINITE] == 1 + later);
        pulse(&r, &r.in.recover);
        ticks(&r, 300);
        CHECK(r.s.fault == KN_FAULT_NONFINITE && r.s.latched && !r.s.attached);
        pulse(&r, &r.in.reset);
    }
    ticks(&r, 300);
    CHECK(r.s.fault == KN_FAULT_NONE && r.s.attached);
}

TEST("a change of the physics fades the force in 17 ms and restores it in 200 ms with the probe attached")
{
    rig r = rig_pressing(40.0, 8.0);
    double slope = kn_safety_slope(&r.s.limits);
    r.in.change = true;
    r.contact_n[2] = 9.0; // the force of the other physics
    for (int ms = 1; ms <= 217; ms++) {
        double before = r.out_n[2];
        tick(&r);
        r.in.change = false;
        CHECK(r.s.attached && fabs(r.out_n[2] - before) <= slope);
        if (ms <= 17) CHECK_NEAR(r.out_n[2], 8.0 * (17 - ms) / 17.0, 1e-12);
        if (ms == 17) CHECK(r.out_n[2] == 0.0);
        CHECK(!(r.flags & KN_FLAG_RAMPING) == (ms == 217));
    }
    CHECK_NEAR(r.out_n[2], 9.0, 1e-12);
    CHECK(r.s.faults == 0 && r.s.guards == 0);
}

TEST("stopping ramps the force to zero in 17 ms, and nothing brings it back")
{
    rig r = rig_pressing(40.0, 8.5);
    r.in.stop = true;
    for (int i = 1; i <= 17; i++) TICK_GIVES(&r, 8.5 * (17 - i) / 17.0);
    r.in.stop = false;
    r.in.recover = r.in.reset = true;
    ticks(&r, 500);
    CHECK(r.s.fault == KN_FAULT_STOPPING && length(r.out_n) == 0.0 && r.s.faults == 0);
}

TEST("above 1.2 m/s the hand is only damped; contact force returns in free air through the ramp")
{
    rig r = rig_pressing(3.3, 3.0);
    r.in.velocity_m_s[0] = 2.0;
    r.in.clear = false;
    ticks(&r, 40);
    CHECK((r.flags & KN_FLAG_BRAKE) && r.s.fault == KN_FAULT_NONE && !r.s.attached);
    CHECK_NEAR(r.out_n[0], -3.0, 1e-12);
    CHECK_NEAR(r.out_n[2], 0.0, 0.0);
    r.in.velocity_m_s[0] = 1.1; // still braking: noise around the limit must not toggle the brake
    ticks(&r, 40);
    CHECK((r.flags & KN_FLAG_BRAKE) && r.s.brakes == 80);
    r.in.velocity_m_s[0] = 0.5;
    ticks(&r, 40);
    CHECK(!(r.flags & KN_FLAG_BRAKE) && (r.flags & KN_FLAG_REENGAGE_LIFT) && length(r.out_n) == 0.0);
    r.in.clear = true;
    ticks(&r, 100);
    CHECK(r.s.gain < 1.0 && r.s.gain > 0.0);
    ticks(&r, 101);
    CHECK(r.s.gain == 1.0);
}

TEST("force and torque are clamped by their norm and share one gain")
{
    rig r = rig_make(3.3);
    ticks(&r, 300);
    r.contact_n[0] = r.contact_n[1] = r.contact_n[2] = 2.2;
    r.torque_n_m[0] = 1.0;
    tick(&r);
    CHECK_NEAR(length(r.out_n), 3.3 * r.s.gain, 1e-12);
    CHECK_NEAR(r.out_n[0], r.out_n[2], 1e-12);
    CHECK_NEAR(r.out_n_m[0], 0.165 * r.s.gain, 1e-12);
    CHECK((r.flags & KN_FLAG_CLAMPED) && r.s.clamps == 1);
}

TEST("the force scale applies before the guard and the clamp: at scale 0.25, 13 N pass the guard and a clamp of 3.3 N")
{
    rig r = rig_in_air(3.3);
    r.s.limits.force_scale = 0.25;
    r.contact_n[2] = 13.0;
    r.torque_n_m[0] = 0.4;
    TICK_GIVES(&r, 3.25); // at once
    CHECK_NEAR(r.out_n_m[0], 0.1, 1e-12);
    CHECK(r.s.guards == 0 && r.s.clamps == 0 && (r.flags & KN_FLAG_ENGAGED));
    r.contact_n[2] = 14.0;
    TICK_GIVES(&r, 3.3);
    CHECK(r.s.clamps == 1 && r.s.guards == 0);
    r.contact_n[2] = INFINITY;
    tick(&r);
    CHECK(r.s.fault == KN_FAULT_NONFINITE && isfinite(r.out_n[2]));
}

static uint64_t seed = 1;

static bool chance(double share) { return kn_dice(&seed) < share; }

// Run a tick with random inputs: bursts of lost poses, missed cycles, extreme forces, fast hands, commands.
static void random_input(rig *r, int *burst)
{
    if (*burst > 0) (*burst)--;
    else if (chance(0.003)) *burst = (int)(kn_dice(&seed) * kn_dice(&seed) * 60.0);
    r->in.fresh = *burst == 0;
    r->in.clear = chance(0.5);
    r->in.elapsed_ms = chance(0.001) ? 1 + (int)(kn_dice(&seed) * 30.0) : 1;
    r->in.reset = chance(0.0005);
    r->in.recover = chance(0.01);
    r->in.opened = r->in.fresh && chance(0.0002);
    double walk = chance(0.0002) ? 20.0 : 0.5;
    for (int i = 0; i < 3; i++) {
        if (!isfinite(r->contact_n[i])) r->contact_n[i] = 0.0;
        r->contact_n[i] = 0.999 * r->contact_n[i] + kn_dice_in(&seed, -walk, walk);
        r->in.velocity_m_s[i] = 0.998 * r->in.velocity_m_s[i] + kn_dice_in(&seed, -0.04, 0.04);
    }
    if (chance(0.0001)) r->contact_n[1] = chance(0.5) ? (double)NAN : 1e300;
}

TEST("under random input |force| <= clamp, zero 20 ms after silence, transitions within the slope, for 3.3 and 40 N")
{
    for (int bench = 0; bench < 2; bench++) {
        rig r = rig_make(bench ? 40.0 : 3.3);
        const kn_safety_limits *l = &r.s.limits;
        const double slope = kn_safety_slope(l);
        long contact = 0, other = 0, silent = 0, over_clamp = 0, over_slope = 0, over_guard = 0, after_deadline = 0;
        int burst = 0, since_pose = 0;
        seed = bench ? 7 : 20261121;
        for (long n = 0; n < 500000; n++) {
            double change[3];
            memcpy(change, r.out_n, sizeof change);
            random_input(&r, &burst);
            r.in.change = n % 997 == 0;
            kn_safety_watch(&r.s, &r.in);
            bool live_contact = r.s.attached && !r.s.latched && !r.s.braking && length(r.s.brake_n) == 0.0 &&
                                r.in.fresh && !r.s.rejoining && !r.s.yielding;
            int gap = r.s.gap_ms < 1 ? 1 : r.s.gap_ms < l->hold_ms ? r.s.gap_ms : l->hold_ms;
            r.flags = kn_safety_filter(&r.s, &r.in, r.contact_n, r.torque_n_m, r.out_n, r.out_n_m);

            for (int i = 0; i < 3; i++) change[i] = r.out_n[i] - change[i];
            double given = length(r.out_n), step = length(change) / r.in.elapsed_ms;
            over_clamp += !(given <= l->clamp_n); // a NaN counts as over the clamp
            since_pose = r.in.fresh ? 0 : since_pose + r.in.elapsed_ms;
            silent += since_pose >= l->zero_ms;
            after_deadline += since_pose >= l->zero_ms && given != 0.0;
            bool forced = since_pose >= l->zero_ms || r.in.elapsed_ms > 1; // a skipped cycle gave the hand no force
            contact += live_contact;
            other += !live_contact && !forced;
            over_guard += live_contact && step > l->guard_n_per_ms * gap + l->clamp_n / l->ramp_up_ms + 1e-9;
            over_slope += !live_contact && !forced && step > slope + 1e-9;
        }
        CHECK(over_clamp == 0 && over_slope == 0 && over_guard == 0 && after_deadline == 0);
        // Check that the run covered enough cases.
        CHECK(contact > 50000 && other > 50000 && silent > 500);
        CHECK(r.s.guards > 100 && r.s.faults > 100);
    }
}

TEST(
    "the device's watchdog holds the force for 3 ms, is at zero by 20 ms or after a stall, and stays there until it is "
    "rearmed; after a short gap the force ramps in again")
{
    kn_watchdog w;
    kn_watchdog_init(&w, 0, 0);
    CHECK(kn_watchdog_tick(&w, false, 1) == 0.0); // no pose has come yet: no force, no trip
    for (int i = 0; i < 100; i++) CHECK(kn_watchdog_tick(&w, true, 1) == 1.0);
    for (int ms = 1; ms <= 100; ms++)
        CHECK_NEAR(kn_watchdog_tick(&w, false, 1), ms <= 3 ? 1.0 : ms >= 20 ? 0.0 : (20 - ms) / 17.0, 1e-12);
    CHECK(w.tripped && w.trips == 1 && kn_watchdog_tick(&w, true, 1) == 0.0);
    kn_watchdog_rearm(&w);
    CHECK(kn_watchdog_tick(&w, true, 1) == 1.0);
    for (int i = 0; i < 10; i++) kn_watchdog_tick(&w, false, 1);
    double faded = w.factor;
    CHECK(faded < 0.6);
    CHECK_NEAR(kn_watchdog_tick(&w, true, 1), faded + 1.0 / 200.0, 1e-12);
    CHECK(kn_watchdog_tick(&w, true, 25) == 0.0 && w.tripped);
}

TEST("every fault has a name and a remedy")
{
    for (int f = KN_FAULT_NONE; f <= KN_FAULT_STOPPING; f++)
        CHECK(strlen(kn_fault_name((kn_fault)f)) > 3 && strlen(kn_fault_remedy((kn_fault)f)) > 3);
}

TEST("a limit that allows more force, slope or time is named, and lower limits are accepted")
{
    static const struct {
        kn_safety_limits limits;
        const char *raised;
    } table[] = {{{.clamp_n = 3}, "nothing"},
                 {{.clamp_n = 3.4}, "device.clamp"},
                 {{.torque_clamp_n_m = 1}, "device.torque_clamp"},
                 {{.guard_n_per_ms = 5}, "device.guard"},
                 {{.brake_m_s = 2}, "device.brake_speed"},
                 {{.brake_n_s_per_m = 2}, "device.brake_damping"},
                 {{.force_scale = 2}, "device.force_scale"},
                 {{.zero_ms = 5}, "device.zero"}, // the same force falls to zero in 2 ms
                 {{.clamp_n = 0.9, .zero_ms = 18}, "device.zero"},
                 {{.zero_ms = 21}, "device.zero"},
                 {{.hold_ms = 4, .zero_ms = 21}, "device.hold"},
                 {{.hold_ms = 2, .zero_ms = 20}, "nothing"},
                 {{.ramp_up_ms = 300, .flow_ms = 300}, "nothing"}};
    kn_safety_limits scene = {0}, slow = {.ramp_up_ms = 400, .flow_ms = 400};
    for (int t = 0; t < COUNT(table); t++) {
        const char *raised = kn_safety_raised(&table[t].limits, &scene);
        CHECK_STR(raised ? raised : "nothing", table[t].raised);
    }
    CHECK_STR(kn_safety_raised(&scene, &slow), "device.ramp");
}

TEST("faults are counted by name; ticks in which a ramp or a slope holds the force back are counted, too")
{
    rig r = rig_make(40.0);
    ticks(&r, 400);
    CHECK(r.s.attached && r.s.slewed == 0); // a ramp in air limits no force
    for (int i = 1; i <= 20; i++) r.contact_n[2] = 0.25 * i, tick(&r);
    CHECK(r.s.gain == 1.0 && r.s.slewed == 0);
    pulse(&r, &r.in.change); // 17 ticks down, the last of which has no force left; 200 up, the last with full gain
    ticks(&r, 300);
    CHECK(r.s.gain == 1.0 && r.s.slewed == 16 + 199);
    r.in.fresh = false;
    ticks(&r, 30);
    CHECK(r.s.slewed == 16 + 199 + 16 && r.s.tripped[KN_FAULT_POSE_SILENCE] == 1);
    kn_safety_trip(&r.s, KN_FAULT_ESTOP);
    kn_safety_trip(&r.s, KN_FAULT_ESTOP);
    kn_safety_trip(&r.s, KN_FAULT_STOPPING);
    CHECK(r.s.tripped[KN_FAULT_ESTOP] == 1 && r.s.tripped[KN_FAULT_IMPULSE] == 0 && r.s.faults == 2);
}
