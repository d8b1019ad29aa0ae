#include "clients/tactile/spacenav.h"
#include "tests/check.h"

static kn_puck puck;

static void steer(int ms, int x, int y, int z, int rx, int ry, int rz)
{
    for (int i = 0; i < ms; i++) kn_puck_tick(&puck, (int[]){x, y, z, rx, ry, rz}, 1);
}

static void begin(const kn_puck_def *def) { kn_puck_init(&puck, def ? def : &(kn_puck_def){.floor_m = -1}); }

TEST("full deflection gives full speed, and larger deflections give no more")
{
    begin(NULL);
    steer(500, KN_PUCK_FULL, 0, 0, 0, 0, 0);
    CHECK_NEAR(puck.pose.velocity_m_s[0], 0.05, 1e-5);
    steer(500, INT32_MAX, INT32_MIN, 0, 0, 0, 0);
    CHECK_NEAR(puck.pose.velocity_m_s[0], 0.05, 1e-5);
    CHECK_NEAR(puck.pose.velocity_m_s[1], -0.05, 1e-5);
    CHECK(puck.pose.velocity_m_s[2] == 0.0 && puck.pose.position_m[2] == 0.0);
}

TEST("deflections within the dead zone move nothing on any axis, and a released puck stops within 3 mm")
{
    begin(&(kn_puck_def){.turn_rad_s = 1, .floor_m = -1});
    steer(5000, 15, -15, 15, -15, 15, -15);
    CHECK(puck.pose.position_m[0] == 0.0 && puck.pose.position_m[2] == 0.0 && puck.pose.orientation_wxyz[0] == 1.0);
    steer(500, 0, 350, 0, 0, 0, 0);
    double y_m = puck.pose.position_m[1];
    steer(1000, 0, 0, 0, 0, 0, 0);
    CHECK(puck.pose.position_m[1] > y_m && puck.pose.position_m[1] < y_m + 3e-3);
    CHECK_NEAR(puck.pose.velocity_m_s[1], 0.0, 1e-9);
}

TEST("the velocity is the change of the position, and changes by at most 2 mm/s per ms")
{
    double last_m_s = 0.0, last_m = 0.0, most = 0.0;
    begin(NULL);
    for (int ms = 0; ms < 4000; ms++) {
        int push = ms % 1000 < 500 ? 350 : -350;
        steer(1, 0, 0, push, 0, 0, 0);
        double v = puck.pose.velocity_m_s[2];
        most = fmax(most, fabs(v - last_m_s));
        CHECK_NEAR(puck.pose.position_m[2] - last_m, 1e-3 * v, 1e-12);
        last_m = puck.pose.position_m[2];
        last_m_s = v;
    }
    CHECK(most > 0.0 && most <= 0.1 / 50 + 1e-12);
}

TEST("the position stays within the reach and above the floor, with zero velocity at the limit")
{
    begin(&(kn_puck_def){.floor_m = -0.03});
    steer(10000, 350, -350, -350, 0, 0, 0);
    CHECK(puck.pose.position_m[0] == 0.08 && puck.pose.position_m[1] == -0.08 && puck.pose.position_m[2] == -0.03);
    CHECK(puck.pose.velocity_m_s[0] == 0.0 && puck.pose.velocity_m_s[2] == 0.0);
    steer(100, 0, 0, 350, 0, 0, 0);
    CHECK(puck.pose.position_m[2] > -0.03);
}

TEST("a twist of 1 rad/s for pi seconds turns the tool by pi about the right-handed axis")
{
    for (int axis = 0; axis < 3; axis++) {
        int twist[3] = {0};
        begin(&(kn_puck_def){.turn_rad_s = 1, .floor_m = -1});
        twist[axis] = 350;
        steer(3142, 0, 0, 0, twist[0], twist[1], twist[2]);
        steer(1000, 0, 0, 0, 0, 0, 0);
        const double *q = puck.pose.orientation_wxyz;
        CHECK_NEAR(q[1 + axis], 1.0, 1e-3);
        CHECK_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1.0, 1e-12);
    }
}

TEST("after a stall of 1 s the position moves by less than 0.3 mm")
{
    begin(NULL);
    steer(500, 350, 0, 0, 0, 0, 0);
    double x_m = puck.pose.position_m[0];
    kn_puck_tick(&puck, (int[]){350, 0, 0, 0, 0, 0}, 1000);
    CHECK(puck.pose.position_m[0] - x_m < 3e-4);
}

TESTS_MAIN
