// One client driven by a test, with invented answers of a server. Whole loops are tested in test_contact_link.c.
#include "core/contact_model.h"
#include "core/algebra/algebra.h"
#include "core/safety.h"
#include "tests/check.h"
#include "tests/dice.h"

typedef struct rig {
    kn_contact_model m;
    int64_t seq;
    double x[3], v[3], force_n[3];
} rig;

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

static kn_contact_unit wall(const rig *r, double z, int index, int count) // one of some walls, of no elasticity
{
    kn_contact_unit u = plane(r, z);
    u.contact_index = index, u.contact_count = count;
    u.a_n_s_per_m = 1e4, u.k1_n_per_m = 0;
    return u;
}

static kn_contact_take take(rig *r, kn_contact_unit u) { return kn_contact_model_take(&r->m, &u); }

// Return a client at full gain over a plane at z = 0. An answer follows every pose.
static rig rig_over(double x)
{
    rig r = {.x = {0, 0, 0.010}};
    kn_contact_model_init(
        &r.m, &(kn_contact_model_def){.session = 7, .stiffness_n_m = 800, .damping_n_s_m = 2, .force_limit_n = 12});
    tick(&r);
    for (int i = 0; i < 220; i++) take(&r, plane(&r, 0)), tick(&r);
    r.x[2] = x;
    take(&r, plane(&r, 0));
    return r;
}

static double length(const double v[3]) { return sqrt(kn_dot(v, v)); }

TEST("a plane ahead of the tool is felt in the tick that reaches it, without waiting for the server")
{
    rig r = rig_over(0.001);
    ticks(&r, 30);
    CHECK(r.force_n[2] == 0);
    r.x[2] = -0.001, r.v[2] = -2;
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
    a.v[2] = b.v[2] = -0.1;
    for (int i = 0; i < 40; i++) {
        a.x[2] = b.x[2] = 0.001 - 0.0001 * i;
        if (i == 20) CHECK(take(&a, u) == KN_CONTACT_LATE); // an answer to that pose was taken already
        if (i == 21) b.m.taken_seq = 0;
        if (i == 21) CHECK(take(&b, u) == KN_CONTACT_TAKEN);
        tick(&a), tick(&b);
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
    for (int i = 0; i < 150; i++, last_n = r.force_n[2]) {
        tick(&r);
        CHECK(fabs(r.force_n[2] - last_n) <= 0.031);
    }
    CHECK(kn_contact_model_stale(&r.m) && last_n < 0.1 * pressed_n);
    for (int i = 0; i < 200; i++, last_n = r.force_n[2]) {       // the way back of 3 mm takes 150 ms at 20 mm/s
        kn_contact_unit u = plane(&r, -0.003 + pressed_n / 800); // the height of the server's surface
        u.force_n = u.h_n = pressed_n;
        take(&r, u);
        tick(&r);
        // change by the springs; the dampers add once, at the start of the way back
        double springs = 0.020e-3 / (1.0 / 800 + 1.0 / 1000);
        CHECK(r.force_n[2] - last_n <= 1.1 * springs + (i == 0 ? 0.020 * 2.8 : 0));
    }
    CHECK_NEAR(last_n, pressed_n, 0.02);
    CHECK(!r.m.returning);
}

TEST("a refused message does not change the local model")
{
    rig clean = rig_over(-0.003), spoilt = rig_over(-0.003);
    ticks(&clean, 50), ticks(&spoilt, 50);
    for (int i = 0; i < 40; i++) {
        kn_contact_unit u = plane(&spoilt, 5.0); // a surface metres away
        u.utime = spoilt.seq - 1;
        u.force_n = u.h_n = 0.1 * (i + 1);
        u.c2_n_s_per_m = 10.0;
        CHECK(take(&spoilt, u) == KN_CONTACT_BAD);
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
            kn_contact_unit u = wall(&r, r.x[2] + (i == told ? 0.1 : 1) / 800, 0, 1);
            u.force_n = i == told ? 0.1 : 1;
            u.c2_n_s_per_m = i == told ? 1e4 : 10;
            if (i <= told) take(&r, u);
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
    r.x[2] = -0.002, r.v[2] = -0.5;
    ticks(&r, 5);
    CHECK(length(r.force_n) == 0);
}

TEST("a message is valid for 5 mm across the surface and for a force rise of 2 N")
{
    rig r = rig_over(-0.001);
    tick(&r);
    r.x[0] = 0.0049;
    ticks(&r, 2);
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

TEST("a contact that ends with a reset object or a restarted server fades within 20 ms; a contact with a new object "
     "starts without a jump")
{
    for (int again = 0; again < 2; again++) {
        rig r = rig_over(-0.002);
        ticks(&r, 10);
        double first_n = r.force_n[2], last_n = first_n;
        CHECK(first_n > 0.5);
        for (int i = 0; i < 20; i++, last_n = r.force_n[2]) { // the server repeats the same answer each tick
            kn_contact_unit u = plane(&r, 0);
            u.contact_count = 0, u.generation = 2, u.flags = again ? KN_CONTACT_RAMPING : 0;
            take(&r, u);
            tick(&r);
            CHECK(last_n - r.force_n[2] < 0.15 * first_n && r.force_n[2] <= last_n + 1e-9);
        }
        CHECK(last_n == 0);
        take(&r, plane(&r, 0)); // the surface comes back, and contact starts as after an outage
        r.m.gain = 1;
        tick(&r);
        CHECK(r.m.returning && r.force_n[2] < 0.05);
    }
    rig r = rig_over(0.001);
    tick(&r);
    kn_contact_unit u = plane(&r, 0.003); // the tool is 2 mm deep in a new object
    u.generation = 2;
    take(&r, u);
    tick(&r);
    CHECK(r.m.returning && r.force_n[2] < 0.05);
}

TEST("the force is zero 20 ms after a stop, a latch, the last own pose or the last finite pose")
{
    for (int why = 0; why < 4; why++) {
        rig r = rig_over(-0.002);
        ticks(&r, 10);
        CHECK(r.force_n[2] > 0.5);
        double last_n = r.force_n[2];
        for (int i = 0; i < 20; i++, last_n = r.force_n[2]) {
            kn_contact_unit u = plane(&r, 0);
            u.pose_seq = r.m.taken_seq; // nothing new about the contact
            u.flags |= why == 0 ? KN_CONTACT_STOPPING : why == 1 ? KN_CONTACT_LATCHED : 0;
            if (i == 0) take(&r, u);
            if (why == 3) r.x[2] = NAN;
            if (why != 2) kn_contact_model_pose(&r.m, r.seq++, r.x, r.v);
            kn_contact_model_render(&r.m, 1e-3, r.x, r.v, r.force_n);
            CHECK(fabs(r.force_n[2] - last_n) < 0.1);
        }
        CHECK(length(r.force_n) == 0);
    }
    CHECK((int)KN_CONTACT_ENGAGED == (int)KN_FLAG_ENGAGED && (int)KN_CONTACT_RAMPING == (int)KN_FLAG_RAMPING &&
          (int)KN_CONTACT_LATCHED == (int)KN_FLAG_LATCHED);
}

static kn_contact_unit of_two(const rig *r, int index)
{
    kn_contact_unit u = plane(r, 0);
    u.contact_index = index, u.contact_count = 2;
    return u;
}

TEST("the contacts of one tick apply together or not at all")
{
    rig r = rig_over(-0.001);
    ticks(&r, 3);
    int64_t before = r.m.taken;
    CHECK(take(&r, of_two(&r, 1)) == KN_CONTACT_WAITING);
    CHECK(r.m.taken == before && r.m.body.count == 1);
    CHECK(take(&r, of_two(&r, 0)) == KN_CONTACT_TAKEN && r.m.body.count == 2);
    tick(&r);
    CHECK(take(&r, of_two(&r, 0)) == KN_CONTACT_WAITING);
    tick(&r);
    CHECK(take(&r, of_two(&r, 0)) == KN_CONTACT_WAITING); // the second unit of the last tick was lost
    kn_contact_unit one = plane(&r, 0);
    one.utime++;
    CHECK(take(&r, one) == KN_CONTACT_TAKEN && r.m.body.count == 1);
}

TEST("two walls of a groove push along both normals; a wall sent twice is no stiffer than the coupling")
{
    double s = sqrt(0.5);
    for (int same = 0; same < 2; same++) {
        rig r = rig_over(-0.002);
        ticks(&r, 3);
        for (int i = 0; i < 2; i++) {
            kn_contact_unit u = wall(&r, 0, i, 2);
            if (!same) memcpy(u.normal, (double[]){i ? s : -s, 0, s}, sizeof u.normal);
            take(&r, u);
        }
        ticks(&r, 2);
        CHECK_NEAR(r.force_n[2], 800 * 0.002, 0.05); // the proxy stays at the bottom, so only the coupling gives way
        CHECK_NEAR(r.force_n[0], 0, 1e-3);
        r.x[0] = 0.001;
        ticks(&r, 3);
        CHECK_NEAR(r.force_n[0], same ? 0 : -800 * 0.001, 0.05);
    }
}

// Return a client that presses two walls from above, or only the one at +x. They lie 20 mm to either side of the tool.
static rig rig_over_walls(double x, int walls)
{
    rig r = rig_over(x);
    r.m.def.radius_m = 0.004; // half a radius is 2 mm
    ticks(&r, 3);
    for (int i = 0; i < walls; i++) {
        kn_contact_unit u = wall(&r, 0, i, walls);
        memcpy(u.friction_anchor_m, u.proxy_m, sizeof u.proxy_m);
        u.proxy_m[0] += i ? -0.020 : 0.020;
        take(&r, u);
    }
    ticks(&r, 3);
    return r;
}

static void turn(rig *r, double half) // about y
{
    kn_contact_model_turn(&r->m, (double[]){cos(half), 0, sin(half), 0});
    ticks(r, 3);
}

TEST("two walls share the force; a tool turned about y gets a torque from its lower side about its position")
{
    rig r = rig_over_walls(-0.002, 2), one = rig_over_walls(-0.002, 1);
    CHECK_NEAR(r.force_n[2], 1.6, 0.02);
    CHECK_NEAR(r.m.torque_n_m[1], 0, 1e-9);
    turn(&r, 0.01); // the side at +x goes down by 0.4 mm
    CHECK_NEAR(r.force_n[2], 1.6, 0.05);
    // both walls hold the proxy, so the torque is the coupling's
    CHECK_NEAR(r.m.torque_n_m[1], -800 * 0.030 * 0.030 * 0.02, 1e-3);
    CHECK_NEAR(one.force_n[2], 1.6 / (1 + 4.0 / 9), 0.02); // the single wall lets the tool turn too: (20 mm/30 mm)^2
    CHECK_NEAR(one.m.torque_n_m[1], -0.020 * one.force_n[2], 1e-6);
}

TEST("a message expires when a turn moves the contact points by half a radius; force and torque then decay")
{
    rig r = rig_over_walls(-0.0005, 2);
    turn(&r, 0.04); // moves the touching points by 1.6 mm
    CHECK(!kn_contact_model_stale(&r.m) && fabs(r.m.torque_n_m[1]) > 0.01);
    turn(&r, 0.06);
    CHECK(kn_contact_model_stale(&r.m));
    for (int i = 0; i < 300; i++) {
        double last_n = r.force_n[2], last_n_m = r.m.torque_n_m[1];
        tick(&r);
        CHECK(fabs(r.force_n[2] - last_n) <= 0.05 && fabs(r.m.torque_n_m[1] - last_n_m) <= 2e-3);
    }
    CHECK(r.force_n[2] < 0.1 && fabs(r.m.torque_n_m[1]) < 2e-3);
}

TEST("friction holds the proxy up to mu times the normal force and no further")
{
    rig r = rig_over(-0.002);
    tick(&r);
    kn_contact_unit u = wall(&r, 0, 0, 1);
    u.friction = 0.5;
    take(&r, u);
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

static const size_t numbers[] = {
    offsetof(kn_contact_unit, force_n),    offsetof(kn_contact_unit, a_n_s_per_m),
    offsetof(kn_contact_unit, h_n),        offsetof(kn_contact_unit, c2_n_s_per_m),
    offsetof(kn_contact_unit, k1_n_per_m), offsetof(kn_contact_unit, k_vc_n_per_m),
    offsetof(kn_contact_unit, friction),   offsetof(kn_contact_unit, b_vc_n_s_per_m),
    offsetof(kn_contact_unit, valid_ms),   offsetof(kn_contact_unit, friction_anchor_m),
    offsetof(kn_contact_unit, proxy_m[1]), offsetof(kn_contact_unit, normal[2])}; // the last two are within bounds

static void set_number(kn_contact_unit *u, int i, double value)
{
    memcpy((char *)u + numbers[i], &value, sizeof value);
}

TEST("a message is refused if a number is not finite, the unit is malformed or foreign, or the time is wrong")
{
    rig r = rig_over(-0.001);
    tick(&r);
    kn_contact_unit good = plane(&r, 0), u;
    static const double bad[] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 3 * COUNT(numbers); i++) {
        u = good;
        set_number(&u, i / 3, bad[i % 3]);
        CHECK(take(&r, u) == KN_CONTACT_BAD);
    }
#define GIVES(change, answer)                                                                                          \
    do {                                                                                                               \
        u = good, change;                                                                                              \
        CHECK(take(&r, u) == answer);                                                                                  \
    } while (0)
    GIVES(u.normal[2] = 0.9, KN_CONTACT_BAD);
    GIVES(u.contact_count = 9, KN_CONTACT_BAD);
    GIVES(u.contact_index = -1, KN_CONTACT_BAD);
    GIVES(u.proxy_m[2] = 0.5, KN_CONTACT_BAD);
    GIVES(u.pose_seq = r.seq + 1, KN_CONTACT_BAD);
    GIVES(u.session = 8, KN_CONTACT_FOREIGN);
    GIVES(u.utime -= 10, KN_CONTACT_LATE);
    r.m.taken_seq = 0;
    GIVES(u.pose_seq -= 70, KN_CONTACT_LATE);
    GIVES(u.valid_ms = 100, KN_CONTACT_TAKEN);
}

TEST("whatever a message contains, the force is finite and within the force limit")
{
    static const double wild[] = {0, 1e-300, 1e-6, 0.01, 1, 3, 100, 1e4, 1e9, 1e300, -1, -1e5};
    uint64_t seed = 1;
    int taken = 0;
    rig start = rig_over(-0.002);
    tick(&start);
    for (int n = 0; n < 1000; n++) {
        rig r = start;
        for (int k = 0; k < 3; k++) {
            kn_contact_unit u = plane(&r, 0);
            for (int i = 0; i < COUNT(numbers) - 2; i++)
                if (kn_dice(&seed) < 0.75) set_number(&u, i, wild[(int)(kn_dice(&seed) * COUNT(wild))]);
            taken += take(&r, u) == KN_CONTACT_TAKEN;
            for (int i = 0; i < 3; i++) {
                r.x[2] -= 0.001, r.v[2] = -1;
                tick(&r);
                CHECK(length(r.force_n) <= 12 * (1 + 1e-12));
            }
        }
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
