#include "core/touch.h"
#include "core/model.h"
#include "core/step.h"
#include "tests/check.h"

#include <string.h>

typedef struct rig { // 5 x 5 x 3 cm of dough, 5 mm spacing, and one tool
    kn_model *model;
    kn_state *state;
    kn_input input;
    kn_output output;
    kn_touch touch;
} rig;

static const kn_probe_def ball = {.shape = KN_PROBE_SPHERE, .radius_m = 0.012};
static const kn_probe_def held = {
    .shape = KN_PROBE_SPHERE, .radius_m = 0.012, .coupling_n_m = 600, .coupling_n_s_m = 1.5};
static const kn_probe_def box = {.shape = KN_PROBE_BOX, .size_m = {0.02, 0.015, 0.01}, .edge_m = 0.001};
static const kn_probe_def finger = {.shape = KN_PROBE_CAPSULE, .radius_m = 0.008, .length_m = 0.016};
static const kn_probe_def pillar = {.shape = KN_PROBE_CYLINDER, .radius_m = 0.01, .length_m = 0.02};
static const kn_probe_def star = {.shape = KN_PROBE_CROSS, .size_m = {0.03, 0.01, 0.01}};
static const kn_probe_def plate = {.shape = KN_PROBE_PLATE, .size_m = {0.02, 0.02}};

static rig rig_open(kn_probe_def tool)
{
    kn_model_def def = kn_model_def_default();
    rig r = {0};
    def.nodes[0] = def.nodes[1] = 11, def.nodes[2] = 7, def.spacing_m = 0.005;
    def.probe_count = 1;
    def.probe[0] = tool;
    strcpy(def.probe[0].name, "tool");
    r.model = build(&def);
    r.state = kn_state_create(r.model);
    r.input.probe[0] = (kn_probe_input){.attached = true, .orientation_wxyz = {1}};
    return r;
}

static void rig_close(rig *r)
{
    kn_state_destroy(r->state);
    kn_model_destroy(r->model);
}

static void put(rig *r, double x, double y, double z)
{
    double *at = r->input.probe[0].position_m;
    at[0] = x, at[1] = y, at[2] = z;
}

static void turn(rig *r, double degrees, double x, double y, double z)
{
    double half = degrees * acos(-1.0) / 360, *q = r->input.probe[0].orientation_wxyz;
    q[0] = cos(half), q[1] = x * sin(half), q[2] = y * sin(half), q[3] = z * sin(half);
}

// Move the tool with that velocity for so many ms.
static void go(rig *r, double vx, double vy, double vz, int steps)
{
    kn_probe_input *in = &r->input.probe[0];
    double v[3] = {vx, vy, vz};
    memcpy(in->velocity_m_s, v, sizeof v);
    for (int i = 0; i < steps; i++) {
        for (int k = 0; k < 3; k++) in->position_m[k] += 1e-3 * v[k];
        CHECK(kn_step(r->model, r->state, &r->input, &r->output) == KN_OK);
    }
    kn_touch_read(r->model, r->state, 0, &r->touch);
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static double integral(const rig *r)
{
    kn_touch_face face;
    double sum = 0;
    kn_touch_face_of(r->model, 0, r->touch.normal, &face);
    for (int i = 0; i < 64; i++) sum += r->touch.pressure_pa[i / 8][i % 8];
    return sum * face.size_m[0] * face.size_m[1] / 64;
}

static double peak(const rig *r)
{
    double most = 0;
    for (int i = 0; i < 64; i++) most = fmax(most, r->touch.pressure_pa[i / 8][i % 8]);
    return most;
}

// Press the tool down at 1 cm/s for 2 mm, from 0.1 mm above the top. low_m: height of the tool's origin in contact.
static rig pressed(kn_probe_def tool, double low_m, double degrees, double ax, double ay, double az)
{
    rig r = rig_open(tool);
    put(&r, 0.0012, -0.0007, 0.03 + low_m + 1e-4);
    turn(&r, degrees, ax, ay, az);
    go(&r, 0, 0, -0.01, 200);
    return r;
}

TEST("the pressure map integrates to the contact force for ball, coupled ball, box, cross, cylinder and finger in "
     "several poses")
{
    const struct {
        kn_probe_def tool;
        double low_m, degrees, axis[3];
    } it[] = {{ball, 0.012, 0, {0, 0, 1}},        {box, 0, 0, {0, 0, 1}},         {star, 0, 0, {0, 0, 1}},
              {pillar, 0, 0, {0, 0, 1}},          {finger, 0.008, 0, {0, 0, 1}},  {finger, 0.008, 90, {0, 1, 0}},
              {finger, 0.008, 90, {0.6, 0.8, 0}}, {finger, 0.008, 50, {1, 0, 0}}, {box, 0.003, 15, {0, 1, 0}},
              {box, 0.003, 25, {0.8, 0.6, 0}},    {held, 0.012, 0, {0, 0, 1}}};
    for (int i = 0; i < (int)(sizeof it / sizeof *it); i++) {
        const double *axis = it[i].axis;
        AT_END(rig_close) rig r = pressed(it[i].tool, it[i].low_m, it[i].degrees, axis[0], axis[1], axis[2]);
        double *f = r.output.probe[0].force_n, force = sqrt(dot(f, f));
        CHECK(force > 0.05);
        CHECK_NEAR(integral(&r), force, 1e-9 * force);
        CHECK(r.touch.area_m2 > 1e-5 && r.touch.peak_pressure_pa * r.touch.area_m2 > force);
        CHECK(peak(&r) > 0 && peak(&r) < 1.2 * r.touch.peak_pressure_pa);
    }
}

TEST("with friction the pressure map integrates to the force along the normal")
{
    kn_probe_def rough = ball;
    rough.friction = 0.5;
    AT_END(rig_close) rig r = pressed(rough, 0.012, 0, 0, 0, 1);
    go(&r, 0.02, 0.01, 0, 150);
    CHECK(fabs(r.output.probe[0].force_n[0]) > 0.1 * r.output.probe[0].force_n[2]);
    double along = dot(r.output.probe[0].force_n, r.touch.normal); // the tool is not turned against the scene
    CHECK_NEAR(integral(&r), along, 1e-9 * along);
}

TEST("the pressure map of a plate is the force on its nodes, and a plate does not slip")
{
    AT_END(rig_close) rig r = rig_open(plate);
    put(&r, 0, 0, 0.0301);
    go(&r, 0, 0, -0.01, 200);
    double up = r.output.probe[0].force_n[2];
    CHECK(up > 1 && r.touch.normal[2] == 1);
    CHECK_NEAR(integral(&r), up, 1e-9 * up);
    CHECK_NEAR(r.touch.area_m2, 0.02 * 0.02, 1e-9);
    for (int k = 0; k < 3; k++) CHECK_NEAR(r.touch.centre_m[k], 0, k < 2 ? 1e-5 : 1e-4);
    for (int k = 0; k < 3; k++) CHECK(r.touch.slip_velocity_m_s[k] == 0);
    CHECK(r.touch.pressure_pa[0][0] > r.touch.pressure_pa[3][3]); // a rigid edge concentrates the pressure
}

TEST("the forces on the nodes add up to the opposite of the tool's force for a plate, a rough ball and a lying finger")
{
    kn_probe_def rough = ball, tool[] = {plate, rough, finger};
    tool[1].friction = 0.5;
    const double low_m[] = {0, 0.012, 0.008}, degrees[] = {0, 0, 90};
    for (int i = 0; i < 3; i++) {
        AT_END(rig_close) rig r = pressed(tool[i], low_m[i], degrees[i], 0, 1, 0);
        if (i == 1) go(&r, 0.02, 0.01, 0, 50);
        double(*node)[3] = calloc((size_t)r.model->node_count, sizeof *node), sum[3] = {0};
        const double *f = r.output.probe[0].force_n;
        int loaded = 0, below = 0;
        kn_touch_nodes(r.model, r.state, node);
        for (int n = 0; n < r.model->node_count; n++) {
            for (int k = 0; k < 3; k++) sum[k] += node[n][k];
            loaded += node[n][2] != 0;
            below += node[n][2] != 0 && r.model->rest_m[n][2] < 0.0299;
        }
        for (int k = 0; k < 3; k++) CHECK_NEAR(sum[k], -f[k], 1e-9 * fabs(f[2]));
        CHECK(f[2] > 0.05 && loaded >= 4 && below == 0);
        r.input.probe[0].attached = false;
        go(&r, 0, 0, 0, 1);
        kn_touch_nodes(r.model, r.state, node);
        for (int n = 0; n < r.model->node_count; n++) CHECK(dot(node[n], node[n]) == 0);
        free(node);
    }
}

TEST("a centred press has its centre of pressure and the middle of its map under the tool")
{
    AT_END(rig_close) rig r = rig_open(ball);
    put(&r, 0, 0, 0.0421);
    go(&r, 0, 0, -0.01, 200);
    CHECK_NEAR(r.touch.centre_m[0], 0, 1e-6);
    CHECK_NEAR(r.touch.centre_m[1], 0, 1e-6);
    CHECK(r.touch.centre_m[2] < -0.009 && r.touch.centre_m[2] > -0.012); // on the ball's lower side
    CHECK(r.touch.normal[2] > 1 - 1e-9);
    for (int i = 0; i < 64; i++) { // the map is symmetric
        double here = r.touch.pressure_pa[i / 8][i % 8], p = 1e-3 * peak(&r);
        CHECK_NEAR(here, r.touch.pressure_pa[i / 8][7 - i % 8], p);
        CHECK_NEAR(here, r.touch.pressure_pa[7 - i / 8][i % 8], p);
        CHECK_NEAR(here, r.touch.pressure_pa[i % 8][i / 8], p);
    }
    CHECK(r.touch.pressure_pa[3][3] > r.touch.pressure_pa[1][3] && r.touch.pressure_pa[0][0] == 0);
}

TEST("a tilted tool has its centre of pressure and its pressure map on the lower side")
{
    // Turn about y by the right-hand rule: the side at -x is lifted, the side at +x goes down.
    AT_END(rig_close) rig r = pressed(box, 0.0008, 8, 0, 1, 0);
    double column[8] = {0};
    for (int i = 0; i < 64; i++) column[i % 8] += r.touch.pressure_pa[i / 8][i % 8];
    CHECK(r.touch.centre_m[0] > 0.003);
    CHECK(column[7] + column[6] > column[0] + column[1]);
    AT_END(rig_close) rig other = pressed(box, 0.0008, 8, 1, 0, 0); // about x: +y is lifted
    double row[8] = {0};
    for (int i = 0; i < 64; i++) row[i / 8] += other.touch.pressure_pa[i / 8][i % 8];
    CHECK(other.touch.centre_m[1] < -0.0015);
    CHECK(row[0] + row[1] + row[2] + row[3] > row[4] + row[5] + row[6] + row[7]);
}

TEST("a finger on its side has a map as long as the finger and touches along its whole length")
{
    AT_END(rig_close) rig r = rig_open(finger);
    kn_touch_face face;
    turn(&r, 90, 0, 1, 0); // the finger's axis lies along x
    put(&r, -0.008, 0, 0.0381);
    go(&r, 0, 0, -0.01, 200);
    CHECK_NEAR(r.touch.normal[0], -1, 1e-3); // up in the scene
    CHECK_NEAR(r.touch.centre_m[2], 0.008, 1e-4);
    CHECK(r.touch.centre_m[0] > 0.005);
    kn_touch_face_of(r.model, 0, r.touch.normal, &face);
    CHECK_NEAR(face.u[2], 1, 1e-3); // the tool's x has turned into the map's u axis
    CHECK_NEAR(face.size_m[0], 0.032, 1e-4);
    CHECK_NEAR(face.size_m[1], 0.016, 1e-4);
    for (int j = 2; j < 6; j++) CHECK(r.touch.pressure_pa[3][j] > 0.5 * r.touch.pressure_pa[3][3]);
    CHECK(r.touch.pressure_pa[0][3] == 0 && r.touch.pressure_pa[7][3] == 0);
}

TEST("the slip is the velocity of the skin: along -x in the tool's frame for a tool drawn along x")
{
    AT_END(rig_close) rig r = pressed(ball, 0.012, 0, 0, 0, 1);
    CHECK(fabs(r.touch.slip_velocity_m_s[0]) < 1e-3 && fabs(r.touch.slip_velocity_m_s[2]) < 1e-4); // a pure press
    go(&r, 0.05, 0, 0, 100);
    CHECK(r.touch.slip_velocity_m_s[0] < -0.02 && r.touch.slip_velocity_m_s[0] > -0.06);
    CHECK(fabs(r.touch.slip_velocity_m_s[1]) < 1e-3);
    AT_END(rig_close) rig across = pressed(box, 0, 90, 0, 0, 1); // the tool's y is the scene's -x
    go(&across, 0.05, 0, 0, 100);
    CHECK(across.touch.slip_velocity_m_s[1] > 0.02 && fabs(across.touch.slip_velocity_m_s[0]) < 5e-3);
    kn_probe_def glued = ball;
    glued.friction = 3;
    AT_END(rig_close) rig stuck = pressed(glued, 0.012, 0, 0, 0, 1);
    go(&stuck, 0.0005, 0, 0, 1500); // the contact sticks: the rest is the foundation giving way
    CHECK(fabs(stuck.touch.slip_velocity_m_s[0]) < 0.0004);
}

TEST("the same press by a turned tool gives the same map, area, centre and peak")
{
    AT_END(rig_close) rig a = rig_open(box), b = rig_open(box);
    put(&a, 0.003, 0.001, 0.0304);
    turn(&a, 5, 0, 1, 0);
    put(&b, -0.001, 0.003, 0.0304); // everything turned by 90 degrees about z, on a block that looks the same then
    double q = sqrt(0.5), lean = 5 * acos(-1.0) / 360;
    double both[4] = {q * cos(lean), -q * sin(lean), q * sin(lean), q * cos(lean)};
    memcpy(b.input.probe[0].orientation_wxyz, both, sizeof both);
    go(&a, 0, 0, -0.01, 200);
    go(&b, 0, 0, -0.01, 200);
    for (int i = 0; i < 64; i++)
        CHECK_NEAR(a.touch.pressure_pa[i / 8][i % 8], b.touch.pressure_pa[i / 8][i % 8], 5e-3 * peak(&a));
    CHECK(a.touch.centre_m[0] > 0.0005);
    for (int k = 0; k < 3; k++) CHECK_NEAR(a.touch.centre_m[k], b.touch.centre_m[k], 2e-5);
    for (int k = 0; k < 3; k++) CHECK_NEAR(a.touch.normal[k], b.touch.normal[k], 1e-3);
    CHECK_NEAR(a.touch.peak_pressure_pa, b.touch.peak_pressure_pa, 5e-3 * a.touch.peak_pressure_pa);
    CHECK_NEAR(a.touch.area_m2, b.touch.area_m2, 0.02 * a.touch.area_m2);
}

TEST("the face of the pressure map is right-handed and perpendicular to its normal, for all normals")
{
    AT_END(rig_close) rig r = rig_open(box);
    const double normals[][3] = {{0, 0, 1}, {0.6, 0, 0.8}, {0, -1, 0}, {0.48, 0.64, -0.6}, {0, 0, -1}};
    for (int i = 0; i < 5; i++) {
        kn_touch_face f;
        kn_touch_face_of(r.model, 0, normals[i], &f);
        const double *u = f.u, *v = f.v;
        double n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
        for (int k = 0; k < 3; k++) CHECK_NEAR(n[k], normals[i][k], 1e-12);
        CHECK_NEAR(dot(u, u), 1, 1e-12);
        CHECK_NEAR(dot(v, v), 1, 1e-12);
    }
    kn_touch_face f;
    kn_touch_face_of(r.model, 0, normals[0], &f);
    CHECK_NEAR(f.low_m[0], -0.01, 1e-12);
    CHECK_NEAR(f.size_m[1], 0.015, 1e-12);
}

TEST("a tool without contact, or a detached tool, has an empty contact patch")
{
    const kn_touch nothing = {0};
    AT_END(rig_close) rig r = rig_open(ball);
    put(&r, 0, 0, 0.06);
    go(&r, 0, 0, 0, 1);
    CHECK(memcmp(&r.touch, &nothing, sizeof nothing) == 0);
    put(&r, 0, 0, 0.0419);
    go(&r, 0, 0, 0, 20);
    r.input.probe[0].attached = false;
    go(&r, 0, 0, 0, 1);
    CHECK(memcmp(&r.touch, &nothing, sizeof nothing) == 0);
}

TESTS_MAIN
