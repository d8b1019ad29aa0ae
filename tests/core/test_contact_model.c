#include "core/contact_model.h"
#include "core/safety.h"
#include "tests/check.h"
#include <stdbool.h>

// One client driven by a test, with invented answers of a server. Whole loops are tested in test_contact_link.c.

typedef struct rig {
    kn_contact_model m;
    int64_t seq;
    double x[3], v[3], force_n[3];
} rig;

static rig rig_make(void)
{
    rig r = {0};
    kn_contact_model_init(
        &r.m, &(kn_contact_model_def){.session = 7, .stiffness_n_m = 800, .damping_n_s_m = 2, .force_limit_n = 12});
    return r;
}

static void tick(rig *r)
{
    kn_contact_model_pose(&r->m, r->seq++, r->x, r->v);
    kn_contact_model_render(&r->m, 1e-3, r->x, r->v, r->force_n);
}

static void ticks(rig *r, int n)
{
    for (int i = 0; i < n; i++) tick(r);
}

// Return an answer to the newest pose: an unpressed level plane of stiff jelly at height z.
static kn_contact_unit plane(const rig *r, double z)
{
    return (kn_contact_unit){.utime = r->seq,
                             .session = 7,
                             .pose_seq = r->seq - 1,
                             .generation = 1,
                             .flags = KN_CONTACT_ENGAGED,
                             .contact_count = 1,
                             .proxy_m = {r->x[0], r->x[1], z},
                             .normal = {0, 0, 1},
                             .a_n_s_per_m = 3,
                             .c2_n_s_per_m = 1e5,
                             .k1_n_per_m = 1000,
                             .k_vc_n_per_m = 800,
                             .b_vc_n_s_per_m = 2,
                             .valid_ms = 100};
}

static void hear(rig *r, double z)
{
    kn_contact_unit u = plane(r, z);
    kn_contact_model_take(&r->m, &u);
}

// Return a client at full gain over a plane at z = 0. An answer follows every pose.
static rig rig_over(double x)
{
    rig r = rig_make();
    r.x[2] = 0.010;
    tick(&r);
    for (int i = 0; i < 220; i++) {
        hear(&r, 0);
        tick(&r);
    }
    r.x[2] = x;
    hear(&r, 0);
    return r;
}

static double length(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

TEST("a plane ahead of the tool is felt in the tick that reaches it, without waiting for the server")
{
    rig r = rig_over(0.001);
    ticks(&r, 30);
    CHECK(r.force_n[2] == 0);
    r.x[2] = -0.001;
    r.v[2] = -2;
    tick(&r);
    CHECK(r.force_n[2] > 0.1);
    r.v[2] = 0;
    ticks(&r, 40); // jelly of 1000 N/m in series with a coupling of 800 N/m, pressed 1 mm
    CHECK_NEAR(r.force_n[2], 1e-3 / (1.0 / 800 + 1.0 / 1000), 0.02);
    r.x[2] = 0.001;
    tick(&r);
    CHECK(r.force_n[2] == 0);
}

TEST("a message that arrives 20 ms late is replayed to the same force as without the delay")
{
    rig a = rig_over(0.001), b = a;
    kn_contact_unit u = plane(&a, 0);
    for (int i = 0; i < 40; i++) {
        a.x[2] = b.x[2] = 0.001 - 0.0001 * i;
        a.v[2] = b.v[2] = -0.1;
        // an answer to that pose was taken already
        if (i == 20) CHECK(kn_contact_model_take(&a.m, &u) == KN_CONTACT_LATE);
        if (i == 21) {
            b.m.taken_seq = 0;
            CHECK(kn_contact_model_take(&b.m, &u) == KN_CONTACT_TAKEN);
        }
        tick(&a);
        tick(&b);
    }
    CHECK(a.force_n[2] > 0.5);
    CHECK_NEAR(b.force_n[2], a.force_n[2], 1e-9);
}

TEST("after 100 ms without messages the surface yields gently; with messages it returns at 20 mm/s")
{
    rig r = rig_over(-0.003);
    ticks(&r, 97);
    double pressed_n = r.force_n[2], last_n = pressed_n;
    CHECK_NEAR(pressed_n, 1.33, 0.05);
    CHECK(!kn_contact_model_stale(&r.m));
    for (int i = 0; i < 150; i++) {
        tick(&r);
        CHECK(fabs(r.force_n[2] - last_n) <= 0.031);
        last_n = r.force_n[2];
    }
    CHECK(kn_contact_model_stale(&r.m));
    CHECK(r.force_n[2] < 0.1 * pressed_n);
    kn_contact_unit u = plane(&r, -0.003 + pressed_n / 800); // the height of the server's surface
    for (int i = 0; i < 200; i++) {                          // the way back of 3 mm takes 150 ms at 20 mm/s
        u.utime = r.seq;
        u.pose_seq = r.seq - 1;
        u.force_n = u.h_n = pressed_n;
        kn_contact_model_take(&r.m, &u);
        tick(&r);
        // change by the springs; the dampers add once, at the start of the way back
        double springs = 0.020e-3 / (1.0 / 800 + 1.0 / 1000);
        CHECK(r.force_n[2] - last_n <= 1.1 * springs + (i == 0 ? 0.020 * 2.8 : 0));
        last_n = r.force_n[2];
    }
    CHECK_NEAR(r.force_n[2], pressed_n, 0.02);
    CHECK(!r.m.returning);
}

TEST("a refused message does not change the local model")
{
    rig clean = rig_over(-0.003), spoilt = rig_over(-0.003);
    ticks(&clean, 50), ticks(&spoilt, 50);
    for (int i = 0; i < 40; i++) {
        double force_n = 0.1 * (i + 1);
        kn_contact_unit u = plane(&spoilt, -0.003);
        u.utime = u.pose_seq = spoilt.seq - 1;
        u.force_n = u.h_n = force_n;
        u.c2_n_s_per_m = 10.0;
        u.proxy_m[2] = 5.0; // a surface metres away
        CHECK(kn_contact_model_take(&spoilt.m, &u) == KN_CONTACT_BAD);
    }
    CHECK(memcmp(&clean.m.c2, &spoilt.m.c2, sizeof clean.m.c2) == 0);
    CHECK(memcmp(&clean.m.body, &spoilt.m.body, sizeof clean.m.body) == 0);
    for (int i = 0; i < 30; i++) {
        tick(&clean), tick(&spoilt);
        CHECK(clean.force_n[2] == spoilt.force_n[2]);
    }
}

TEST("the model remembers c2 at each force: dough holds at a small force and flows at a large one")
{
    for (int told = 0; told < 2; told++) {
        rig r = rig_over(0.001);
        tick(&r);
        for (int i = 0; i < 2; i++) { // c2 of 1e4 N s/m at 0.1 N; in the second round, c2 of 10 at 1 N is told before
            kn_contact_unit u = plane(&r, r.x[2] + (i == told ? 0.1 : 1) / 800);
            u.a_n_s_per_m = 1e4;
            u.k1_n_per_m = 0;
            u.force_n = i == told ? 0.1 : 1;
            u.c2_n_s_per_m = i == told ? 1e4 : 10;
            if (i <= told) kn_contact_model_take(&r.m, &u);
            tick(&r);
        }
        CHECK_NEAR(r.force_n[2], 0.1, 0.01);
        r.x[2] -= 0.9 / 800;
        ticks(&r, 30);
        CHECK(told ? r.force_n[2] < 0.7 && r.force_n[2] > 0.1 : r.force_n[2] > 0.95);
    }
}

TEST("in free air a surface without messages for 700 ms gives no force")
{
    rig r = rig_over(0.002);
    ticks(&r, 700);
    r.x[2] = -0.002;
    r.v[2] = -0.5;
    ticks(&r, 5);
    CHECK(length(r.force_n) == 0);
}

TEST("a message is valid for 5 mm across the surface and for a force rise of 2 N")
{
    rig r = rig_over(-0.001);
    tick(&r);
    r.x[0] = 0.0049;
    tick(&r);
    tick(&r);
    CHECK(!kn_contact_model_stale(&r.m));
    r.x[0] = 0.0051;
    tick(&r);
    CHECK(kn_contact_model_stale(&r.m));
    r = rig_over(-0.008);
    ticks(&r, 20); // the depth would give 3.6 N
    CHECK(kn_contact_model_stale(&r.m));
    ticks(&r, 70);
    CHECK(r.force_n[2] < 2.2);
}

TEST("after a reset the contact with the new object starts without a force jump")
{
    rig r = rig_over(0.001);
    kn_contact_unit u = plane(&r, 0.003); // the tool is 2 mm deep in the new object
    u.generation = 2;
    tick(&r);
    u.utime = r.seq;
    u.pose_seq = r.seq - 1;
    kn_contact_model_take(&r.m, &u);
    tick(&r);
    CHECK(r.m.returning && r.force_n[2] < 0.05);
}

TEST("a contact that ends with a reset object or a restarted server fades within 20 ms and returns without a jump")
{
    for (int again = 0; again < 2; again++) {
        rig r = rig_over(-0.002);
        ticks(&r, 10);
        double first_n = r.force_n[2], last_n = first_n;
        CHECK(first_n > 0.5);
        for (int i = 0; i < 20; i++) { // the server repeats the same answer each tick
            kn_contact_unit u = plane(&r, 0);
            u.contact_count = 0, u.generation = 2, u.flags = again ? KN_CONTACT_RAMPING : 0;
            kn_contact_model_take(&r.m, &u);
            tick(&r);
            CHECK(last_n - r.force_n[2] < 0.15 * first_n && r.force_n[2] <= last_n + 1e-9);
            last_n = r.force_n[2];
        }
        CHECK(last_n == 0);
        hear(&r, 0); // the surface comes back, and contact starts as after an outage
        r.m.gain = 1;
        tick(&r);
        CHECK(r.m.returning && r.force_n[2] < 0.05);
    }
}

TEST("the force is zero 20 ms after a stop, a latch, the last own pose or the last finite pose")
{
    for (int why = 0; why < 4; why++) {
        rig r = rig_over(-0.002);
        ticks(&r, 10);
        CHECK(r.force_n[2] > 0.5);
        double last_n = r.force_n[2];
        for (int i = 0; i < 20; i++) {
            kn_contact_unit u = plane(&r, 0);
            u.pose_seq = r.m.taken_seq; // nothing new about the contact
            if (why == 0) u.flags |= KN_CONTACT_STOPPING;
            if (why == 1) u.flags |= KN_CONTACT_LATCHED;
            if (i == 0) kn_contact_model_take(&r.m, &u);
            if (why == 3) r.x[2] = NAN;
            if (why != 2) kn_contact_model_pose(&r.m, r.seq++, r.x, r.v);
            kn_contact_model_render(&r.m, 1e-3, r.x, r.v, r.force_n);
            CHECK(fabs(r.force_n[2] - last_n) < 0.1);
            last_n = r.force_n[2];
        }
        CHECK(length(r.force_n) == 0);
    }
    CHECK((int)KN_CONTACT_ENGAGED == (int)KN_FLAG_ENGAGED && (int)KN_CONTACT_RAMPING == (int)KN_FLAG_RAMPING &&
          (int)KN_CONTACT_LATCHED == (int)KN_FLAG_LATCHED);
}

TEST("the contacts of one tick apply together or not at all")
{
    rig r = rig_over(-0.001);
    ticks(&r, 3);
    kn_contact_unit a = plane(&r, 0), b = a;
    a.contact_count = b.contact_count = 2;
    b.contact_index = 1;
    int64_t before = r.m.taken;
    CHECK(kn_contact_model_take(&r.m, &b) == KN_CONTACT_WAITING);
    CHECK(r.m.taken == before && r.m.body.count == 1);
    CHECK(kn_contact_model_take(&r.m, &a) == KN_CONTACT_TAKEN);
    CHECK(r.m.body.count == 2);
    tick(&r);
    a.utime = b.utime = r.seq;
    a.pose_seq = b.pose_seq = r.seq - 1;
    CHECK(kn_contact_model_take(&r.m, &a) == KN_CONTACT_WAITING);
    tick(&r);
    a.utime = r.seq; // the second unit of the last tick was lost
    a.pose_seq = r.seq - 1;
    CHECK(kn_contact_model_take(&r.m, &a) == KN_CONTACT_WAITING);
    a.contact_count = 1;
    a.utime++;
    CHECK(kn_contact_model_take(&r.m, &a) == KN_CONTACT_TAKEN);
    CHECK(r.m.body.count == 1);
}

TEST("two walls of a groove push along both normals; a wall sent twice is no stiffer than the coupling")
{
    double s = sqrt(0.5);
    for (int same = 0; same < 2; same++) {
        rig r = rig_over(-0.002);
        ticks(&r, 3);
        for (int i = 0; i < 2; i++) {
            kn_contact_unit u = plane(&r, 0);
            u.contact_count = 2;
            u.contact_index = i;
            u.a_n_s_per_m = 1e4; // as stiff as a wall
            u.k1_n_per_m = 0;
            if (!same) memcpy(u.normal, (double[]){i ? s : -s, 0, s}, sizeof u.normal);
            kn_contact_model_take(&r.m, &u);
        }
        ticks(&r, 2);
        CHECK_NEAR(r.force_n[2], 800 * 0.002, 0.05); // the proxy stays at the bottom, so only the coupling gives way
        CHECK_NEAR(r.force_n[0], 0, 1e-3);
        r.x[0] = 0.001;
        ticks(&r, 3);
        CHECK_NEAR(r.force_n[0], same ? 0 : -800 * 0.001, 0.05);
    }
}

// Tell the client two walls, or only the one at +x. They lie 20 mm to either side of the tool, which presses them
// from above.
static void hear_walls(rig *r, double z, int walls)
{
    for (int i = 0; i < walls; i++) {
        kn_contact_unit u = plane(r, z);
        u.contact_count = walls;
        u.contact_index = i;
        u.a_n_s_per_m = 1e4;
        u.k1_n_per_m = 0;
        memcpy(u.friction_anchor_m, u.proxy_m, sizeof u.proxy_m);
        u.proxy_m[0] += i ? -0.020 : 0.020;
        kn_contact_model_take(&r->m, &u);
    }
}

TEST("two walls share the force; a tool turned about y gets a torque from its lower side about its position")
{
    rig r = rig_over(-0.002);
    ticks(&r, 3);
    hear_walls(&r, 0, 2);
    ticks(&r, 3);
    CHECK_NEAR(r.force_n[2], 1.6, 0.02);
    CHECK_NEAR(r.m.torque_n_m[1], 0, 1e-9);
    kn_contact_model_turn(&r.m, (double[]){cos(0.01), 0, sin(0.01), 0}); // the side at +x goes down by 0.4 mm
    ticks(&r, 3);
    CHECK_NEAR(r.force_n[2], 1.6, 0.05);
    // both walls hold the proxy, so the torque is the coupling's
    CHECK_NEAR(r.m.torque_n_m[1], -800 * 0.030 * 0.030 * 0.02, 1e-3);
    rig one = rig_over(-0.002);
    ticks(&one, 3);
    hear_walls(&one, 0, 1);
    ticks(&one, 3);
    CHECK_NEAR(one.force_n[2], 1.6 / (1 + 4.0 / 9), 0.02); // the single wall lets the tool turn too: (20 mm/30 mm)^2
    CHECK_NEAR(one.m.torque_n_m[1], -0.020 * one.force_n[2], 1e-6);
}

TEST("a message expires when a turn moves the contact points by half a radius; force and torque then decay")
{
    rig r = rig_over(-0.0005);
    r.m.def.radius_m = 0.004;
    ticks(&r, 3);
    hear_walls(&r, 0, 2);
    kn_contact_model_turn(&r.m, (double[]){cos(0.04), 0, sin(0.04), 0}); // moves the touching points by 1.6 mm
    ticks(&r, 3);
    CHECK(!kn_contact_model_stale(&r.m) && fabs(r.m.torque_n_m[1]) > 0.01);
    kn_contact_model_turn(&r.m, (double[]){cos(0.06), 0, sin(0.06), 0});
    ticks(&r, 3);
    CHECK(kn_contact_model_stale(&r.m));
    double last_n = r.force_n[2], last_n_m = r.m.torque_n_m[1];
    for (int i = 0; i < 300; i++) {
        tick(&r);
        CHECK(fabs(r.force_n[2] - last_n) <= 0.05 && fabs(r.m.torque_n_m[1] - last_n_m) <= 2e-3);
        last_n = r.force_n[2];
        last_n_m = r.m.torque_n_m[1];
    }
    CHECK(last_n < 0.1 && fabs(last_n_m) < 2e-3);
}

TEST("friction holds the proxy up to mu times the normal force and no further")
{
    rig r = rig_over(-0.002);
    kn_contact_unit u = plane(&r, 0);
    u.friction = 0.5;
    u.a_n_s_per_m = 1e4;
    u.k1_n_per_m = 0;
    tick(&r);
    u.utime = r.seq;
    u.pose_seq = r.seq - 1;
    kn_contact_model_take(&r.m, &u);
    r.x[0] = 0.0005;
    ticks(&r, 2);
    CHECK_NEAR(r.force_n[0], -0.4, 0.02);
    r.x[0] = 0.004;
    ticks(&r, 30);
    CHECK_NEAR(r.force_n[0], -0.5 * r.force_n[2], 1e-6);
    r.x[0] = 0.0035; // the tool moves back and sticks at once
    ticks(&r, 3);
    CHECK_NEAR(r.force_n[0], -0.5 * r.force_n[2] + 0.4, 0.03);
}

TEST("a message is refused if a number is not finite, the unit is malformed or foreign, or the time is wrong")
{
    rig r = rig_over(-0.001);
    tick(&r);
    kn_contact_unit good = plane(&r, 0), u = good;
    double *number[] = {&u.force_n,      &u.a_n_s_per_m,         &u.h_n,      &u.c2_n_s_per_m, &u.k1_n_per_m,
                        &u.k_vc_n_per_m, &u.b_vc_n_s_per_m,      &u.friction, &u.valid_ms,     &u.proxy_m[1],
                        &u.normal[2],    &u.friction_anchor_m[0]};
    for (size_t i = 0; i < sizeof number / sizeof *number; i++)
        for (int sign = 0; sign < 3; sign++) {
            u = good;
            *number[i] = sign == 0 ? NAN : sign == 1 ? INFINITY : -INFINITY;
            CHECK(kn_contact_model_take(&r.m, &u) == KN_CONTACT_BAD);
        }
    u = good, u.normal[2] = 0.9;
    CHECK(kn_contact_model_take(&r.m, &u) == KN_CONTACT_BAD);
    u = good, u.contact_count = 9;
    CHECK(kn_contact_model_take(&r.m, &u) == KN_CONTACT_BAD);
    u = good, u.contact_index = -1;
    CHECK(kn_contact_model_take(&r.m, &u) == KN_CONTACT_BAD);
    u = good, u.proxy_m[2] = 0.5;
    CHECK(kn_contact_model_take(&r.m, &u) == KN_CONTACT_BAD);
    u = good, u.pose_seq = r.seq + 1;
    CHECK(kn_contact_model_take(&r.m, &u) == KN_CONTACT_BAD);
    u = good, u.session = 8;
    CHECK(kn_contact_model_take(&r.m, &u) == KN_CONTACT_FOREIGN);
    u = good, u.utime -= 10;
    CHECK(kn_contact_model_take(&r.m, &u) == KN_CONTACT_LATE);
    u = good, u.pose_seq -= 70, r.m.taken_seq = 0;
    CHECK(kn_contact_model_take(&r.m, &u) == KN_CONTACT_LATE);
    CHECK(kn_contact_model_take(&r.m, &good) == KN_CONTACT_TAKEN);
}

TEST("whatever a message contains, the force is finite and within the force limit")
{
    static const double wild[] = {0, 1e-300, 1e-6, 0.01, 1, 3, 100, 1e4, 1e9, 1e300, -1, -1e5};
    uint64_t random = 1;
    int taken = 0;
    for (int n = 0; n < 20000; n++) {
        rig r = rig_over(-0.002);
        tick(&r);
        for (int k = 0; k < 3; k++) {
            kn_contact_unit u = plane(&r, 0);
            double *number[] = {
                &u.force_n,      &u.a_n_s_per_m,    &u.h_n,      &u.c2_n_s_per_m, &u.k1_n_per_m,
                &u.k_vc_n_per_m, &u.b_vc_n_s_per_m, &u.friction, &u.valid_ms,     &u.friction_anchor_m[0]};
            for (size_t i = 0; i < sizeof number / sizeof *number; i++) {
                random = random * 6364136223846793005u + 1442695040888963407u;
                if (random >> 62) *number[i] = wild[(random >> 33) % (sizeof wild / sizeof *wild)];
            }
            taken += kn_contact_model_take(&r.m, &u) == KN_CONTACT_TAKEN;
            for (int i = 0; i < 3; i++) {
                r.x[2] -= 0.001;
                r.v[2] = -1;
                tick(&r);
                if (!(length(r.force_n) <= 12 * (1 + 1e-12))) KN_TEST_FAIL("%g N", length(r.force_n));
            }
        }
        if (n == 50) n = 19000; // skip most cases: each case starts with 220 ticks
    }
    CHECK(taken > 1000);
}

TEST("the energy of the model is that of the coupling's spring and of k1")
{
    rig r = rig_over(-0.002);
    ticks(&r, 60);
    double f = r.force_n[2];
    CHECK_NEAR(kn_contact_model_energy(&r.m, r.x), f * f / 2 * (1.0 / 800 + 1.0 / 1000), 2e-5);
}
TESTS_MAIN
