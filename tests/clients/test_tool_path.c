// A virtual hand moves smoothly, at the speed it states, through the phases it names.
#include "clients/hand/tool_path.h"
#include "tests/clients/heard.h"

OWNS(kn_tool_path, kn_tool_path_destroy)

static const kn_tool_path_def dough = {.touch_z_m = 0.03, .hold_s = 0.5};

static double speed(const kn_tool_path_point *p)
{
    return sqrt(p->velocity_m_s[0] * p->velocity_m_s[0] + p->velocity_m_s[1] * p->velocity_m_s[1] +
                p->velocity_m_s[2] * p->velocity_m_s[2]);
}

// Walk in steps of 1 ms. Check that position and velocity never jump, and that v is dx/dt by the central difference.
static void check_smooth(const kn_tool_path *path, double speed_limit_m_s, double acceleration_limit_m_s2)
{
    const double ms = 1e-3, tiny = 1e-6;
    kn_tool_path_point last, now, before, after;
    kn_tool_path_at(path, 0, &last);
    for (double t = ms; t < path->duration_s + 0.1; t += ms, last = now) {
        kn_tool_path_at(path, t, &now);
        kn_tool_path_at(path, t - tiny, &before);
        kn_tool_path_at(path, t + tiny, &after);
        CHECK(speed(&now) <= speed_limit_m_s * (1 + 1e-9));
        for (int i = 0; i < 3; i++) {
            double slope = (after.position_m[i] - before.position_m[i]) / (2 * tiny);
            CHECK_NEAR(slope, now.velocity_m_s[i], 1e-8 + acceleration_limit_m_s2 * tiny);
            CHECK_NEAR(now.velocity_m_s[i], last.velocity_m_s[i], acceleration_limit_m_s2 * ms * 1.001);
            CHECK_NEAR(now.position_m[i], last.position_m[i], speed_limit_m_s * ms * 1.001);
        }
    }
    CHECK(speed(&now) == 0);
}

static const kn_tool_path_piece *named(const kn_tool_path *path, const char *name)
{
    for (int i = 0; i < path->count; i++)
        if (!strcmp(path->piece[i].name, name)) return &path->piece[i];
    return NULL;
}

static double z_m(const kn_tool_path *path, double t)
{
    kn_tool_path_point p;
    kn_tool_path_at(path, t, &p);
    return p.position_m[2];
}

static double v_m_s(const kn_tool_path *path, double t)
{
    kn_tool_path_point p;
    kn_tool_path_at(path, t, &p);
    return p.velocity_m_s[2];
}

TEST("a press stops on the surface, goes 1 cm deep at 1 cm/s, holds, and ends clear of the object")
{
    OWN(kn_tool_path) *path = kn_tool_path_press(&dough);
    kn_tool_path_point p;
    check_smooth(path, KN_TOOL_PATH_AIR_M_S, KN_TOOL_PATH_AIR_M_S / KN_TOOL_PATH_RAMP_S);
    CHECK_STR(kn_tool_path_at(path, 0, &p)->name, "approach");
    const kn_tool_path_piece *press = named(path, "press");
    const double down_s = press->start_s;
    CHECK_NEAR(z_m(path, 0), 0.05, 1e-12);
    CHECK_NEAR(z_m(path, down_s - 0.01), 0.03, 1e-12);
    CHECK_NEAR(z_m(path, down_s), 0.03, 1e-12);
    CHECK_NEAR(v_m_s(path, down_s), 0, 1e-12);
    CHECK_NEAR(v_m_s(path, down_s + 0.025), -0.005, 1e-9); // 0 -> 1 cm/s in 50 ms
    CHECK_NEAR(v_m_s(path, down_s + 0.05), -0.01, 1e-9);
    CHECK_NEAR(press->duration_s, 1.05, 1e-9);
    CHECK_NEAR(z_m(path, path->hold_end_s), 0.02, 1e-12);
    CHECK_NEAR(named(path, "hold")->duration_s, 0.5, 1e-12);
    CHECK_NEAR(z_m(path, path->duration_s), 0.05, 1e-12);
    CHECK_NEAR(named(path, "rest")->duration_s, 1, 1e-12);
    double fastest_m_s = 0; // in the last half micrometre above the surface
    for (double t = 0; t < down_s; t += 1e-4) {
        kn_tool_path_at(path, t, &p);
        CHECK(p.position_m[2] >= 0.03 - 1e-12);
        if (p.position_m[2] < 0.03 + 5e-7) fastest_m_s = fmax(fastest_m_s, speed(&p));
    }
    CHECK(fastest_m_s > 0 && fastest_m_s < 1e-4);
}

TEST("a press has the requested depth, speed and clearance, holds 4 s by default, and travels a short distance slower")
{
    OWN(kn_tool_path) *path = kn_tool_path_press(
        &(kn_tool_path_def){.touch_z_m = 0.1, .clear_m = 0.01, .depth_m = 0.005, .speed_m_s = 0.02, .hold_s = -1});
    check_smooth(path, KN_TOOL_PATH_AIR_M_S, KN_TOOL_PATH_AIR_M_S / KN_TOOL_PATH_RAMP_S);
    CHECK_NEAR(z_m(path, path->hold_end_s), 0.095, 1e-12);
    CHECK_NEAR(named(path, "hold")->duration_s, 4, 1e-12);
    CHECK_NEAR(v_m_s(path, named(path, "press")->start_s + 0.1), -0.02, 1e-12);
    OWN(kn_tool_path) *near =
        kn_tool_path_press(&(kn_tool_path_def){.touch_z_m = 0.03, .depth_m = 1e-4, .speed_m_s = 0.02});
    check_smooth(near, KN_TOOL_PATH_AIR_M_S, KN_TOOL_PATH_AIR_M_S / KN_TOOL_PATH_RAMP_S);
    CHECK_NEAR(v_m_s(near, named(near, "press")->start_s + KN_TOOL_PATH_RAMP_S), -0.002, 1e-9);
}

TEST("a poke is a fast press without a hold")
{
    OWN(kn_tool_path) *path = kn_tool_path_poke(&dough);
    check_smooth(path, 0.05, 0.05 / KN_TOOL_PATH_RAMP_S);
    CHECK(path->hold_end_s == 0);
    CHECK_STR(path->piece[0].name, "poke");
}

TEST("a sine swings whole periods between the surface and its depth")
{
    OWN(kn_tool_path) *path =
        kn_tool_path_sine(&(kn_tool_path_def){.touch_z_m = 0.03, .depth_m = 0.002, .hold_s = 1.1, .frequency_hz = 4});
    const kn_tool_path_piece *swing = named(path, "swing");
    double lowest = 1, highest = 0, w = 2 * M_PI * 4;
    check_smooth(path, KN_TOOL_PATH_AIR_M_S, 0.001 * w * w);
    CHECK_NEAR(swing->duration_s, 1, 1e-12); // 4.4 periods were asked for
    for (double t = swing->start_s; t < swing->start_s + swing->duration_s; t += 1e-3) {
        lowest = fmin(lowest, z_m(path, t));
        highest = fmax(highest, z_m(path, t));
    }
    CHECK_NEAR(lowest, 0.028, 1e-7);
    CHECK_NEAR(highest, 0.03, 1e-7);
}

TEST("a retreat from a moving tool stops, lifts straight up and ends at its target")
{
    kn_tool_path path;
    kn_tool_path_piece piece[4];
    kn_tool_path_point from = {
        .position_m = {0.01, 0.02, 0.02}, .velocity_m_s = {0.05, 0, -0.1}, .orientation_wxyz = {1}};
    kn_tool_path_point home = {.position_m = {0, 0, 0.05}, .orientation_wxyz = {1}}, p, stopped;
    kn_tool_path_retreat(&path, piece, &from, 0.05, &home);
    check_smooth(&path, 0.12, 0.12 / KN_TOOL_PATH_RAMP_S);
    kn_tool_path_at(&path, 0, &p);
    CHECK_NEAR(p.velocity_m_s[2], -0.1, 1e-12);
    CHECK_STR(kn_tool_path_at(&path, KN_TOOL_PATH_RAMP_S, &stopped)->name, "lift");
    CHECK_NEAR(stopped.position_m[2], 0.02 - 0.0025, 1e-12);
    for (double t = KN_TOOL_PATH_RAMP_S; kn_tool_path_at(&path, t, &p) == &piece[1]; t += 1e-3)
        CHECK_NEAR(p.position_m[0], stopped.position_m[0], 1e-12);
    kn_tool_path_at(&path, path.duration_s, &p);
    for (int i = 0; i < 3; i++) CHECK_NEAR(p.position_m[i], home.position_m[i], 1e-12);
}

TEST("a retreat of a tool at its target does not move the tool")
{
    kn_tool_path path;
    kn_tool_path_piece piece[4];
    kn_tool_path_point home = {.position_m = {0, 0, 0.05}, .orientation_wxyz = {1}}, p;
    kn_tool_path_retreat(&path, piece, &home, 0.05, &home);
    for (double t = 0; t < 0.2; t += 1e-3) {
        kn_tool_path_at(&path, t, &p);
        CHECK(fabs(p.position_m[2] - 0.05) < 1e-12 && speed(&p) == 0);
    }
}

static char error[256];

static kn_tool_path *load(const char *text)
{
    kn_write("path.csv", text, strlen(text));
    *error = 0;
    return kn_tool_path_load("path.csv", error, sizeof error);
}

TEST("a CSV path passes smoothly through every row and is at rest at both ends")
{
    OWN(kn_tool_path) *path = load("time_s,x_m,y_m,z_m\n"
                                   "1,0,0,0.05\n1.5,0.01,0,0.04\r\n2.25, -0.01, 0.02, 0.03\n3,0,0,0.05\n");
    CHECK_STR(error, "");
    if (!path) return;
    kn_tool_path_point p;
    check_smooth(path, 0.2, 1.0);
    CHECK_NEAR(path->duration_s, 2, 1e-12);
    kn_tool_path_at(path, 1.25, &p);
    CHECK_NEAR(p.position_m[0], -0.01, 1e-12);
    CHECK_NEAR(p.position_m[1], 0.02, 1e-12);
    CHECK_NEAR(p.position_m[2], 0.03, 1e-12);
}

TEST("the orientation of a CSV path keeps length 1 and turns the short way")
{
    OWN(kn_tool_path) *path = load("time_s,x_m,y_m,z_m,qw,qx,qy,qz\n"
                                   "0,0,0,0.05,1,0,0,0\n1,0,0,0.05,-0.7071068,0,0,-0.7071068\n");
    CHECK_STR(error, "");
    if (!path) return;
    kn_tool_path_point p;
    for (double t = 0; t < 1.1; t += 0.05) {
        kn_tool_path_at(path, t, &p);
        double *q = p.orientation_wxyz;
        CHECK_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1, 1e-9);
    }
    kn_tool_path_at(path, 0.5, &p);
    CHECK_NEAR(p.orientation_wxyz[3], sin(M_PI / 8), 1e-6);
    CHECK(p.orientation_wxyz[0] > 0);
}

TEST("a bad CSV path is refused in one line that names file, line and column")
{
    static const struct {
        const char *text, *complaint;
    } bad[] = {
        {"", ":1:1: 0 rows, expected at least 2"},
        {"t,x,y,z\n", ":1:1: expected the header `time_s,x_m,y_m,z_m` or `time_s,x_m,y_m,z_m,qw,qx,qy,qz`"},
        {"time_s,x_m,y_m,z_m\n0,0,0,0\n", ":3:1: 1 rows, expected at least 2"},
        {"time_s,x_m,y_m,z_m\n0,0,0\n", ":2:6: 3 fields, expected 4"},
        {"time_s,x_m,y_m,z_m\n0,0,0,0,1\n", ":2:8: more than 4 fields"},
        {"time_s,x_m,y_m,z_m\n0,0,nan,0\n", ":2:5: expected a finite number"},
        {"time_s,x_m,y_m,z_m\n0,0,1e999,0\n", ":2:5: expected a finite number"},
        {"time_s,x_m,y_m,z_m\n0,0,,0\n", ":2:5: expected a finite number"},
        {"time_s,x_m,y_m,z_m\n0,0 cm,0,0\n", ":2:5: expected a comma after the number"},
        {"time_s,x_m,y_m,z_m\n0,0,0,0\n0,0,0,0\n", ":3:1: time does not increase"},
        {"time_s,x_m,y_m,z_m\n-1e308,0,0,0\n1e308,0,0,0\n", ":3:1: more than a day after the first row"},
        {"time_s,x_m,y_m,z_m\n0,0,0,0\n86401,0,0,0\n", ":3:1: more than a day after the first row"},
        {"time_s,x_m,y_m,z_m\n0,0,0,30\n", ":2:3: further than 1 m from the origin, expected coordinates in metres"},
        {"time_s,x_m,y_m,z_m\n0,0,0,0\n1e-3,0,0.1,0\n", ":3:6: 100 m/s since the previous row, expected at most 5"},
        {"time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,1,1,0,0\n",
         ":2:9: quaternion of length 1.414, expected 1 within 0.001"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        OWN(kn_tool_path) *path = load(bad[i].text);
        CHECK(!path && !strncmp(error, "path.csv", 8));
        CHECK_STR(error + 8, bad[i].complaint);
    }
    CHECK(!kn_tool_path_load("/nowhere/path.csv", error, sizeof error));
    CHECK_STR(error, "/nowhere/path.csv: No such file or directory");
}

TESTS_MAIN
