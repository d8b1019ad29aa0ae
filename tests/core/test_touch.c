#include "core/touch.h"
#include "core/algebra/algebra.h"
#include "tests/lattice.h"

// 5 x 5 x 3 cm of dough, 5 mm spacing, and one tool.
static const kn_probe_def ball = {.shape = KN_PROBE_SPHERE, .radius_m = 0.012};
static const kn_probe_def rough = {.shape = KN_PROBE_SPHERE, .radius_m = 0.012, .friction = 0.5};
static const kn_probe_def held = {
    .shape = KN_PROBE_SPHERE, .radius_m = 0.012, .coupling_n_m = 600, .coupling_n_s_m = 1.5};
static const kn_probe_def box = {.shape = KN_PROBE_BOX, .size_m = {0.02, 0.015, 0.01}, .edge_m = 0.001};
static const kn_probe_def finger = {.shape = KN_PROBE_CAPSULE, .radius_m = 0.008, .length_m = 0.016};
static const kn_probe_def pillar = {.shape = KN_PROBE_CYLINDER, .radius_m = 0.01, .length_m = 0.02};
static const kn_probe_def star = {.shape = KN_PROBE_CROSS, .size_m = {0.03, 0.01, 0.01}};
static const kn_probe_def plate = {.shape = KN_PROBE_PLATE, .size_m = {0.02, 0.02}};

static lattice under(kn_probe_def tool)
{
    kn_model_def def = press_def(2);
    strcpy(tool.name, "tool");
    def.probe[0] = tool;
    return lattice_of(def);
}

static kn_touch touch_of(const lattice *l)
{
    kn_touch touch;
    kn_touch_read(l->model, l->state, l->scratch, 0, &touch);
    return touch;
}

// Press the tool down at 1 cm/s for 2 mm, from 0.1 mm above the top. at: the tool's origin, whose height counts from the
// top. axis: of a turn.
static lattice pressed(kn_probe_def tool, const double at[3], double degrees, const double axis[3])
{
    lattice l = under(tool);
    double half = degrees * acos(-1.0) / 360, *q = l.in.probe[0].orientation_wxyz;
    put(&l, 0, at[0], at[1], 0.03 + at[2] + 1e-4);
    q[0] = cos(half);
    for (int k = 0; k < 3; k++) q[1 + k] = axis[k] * sin(half);
    move(&l, 0, 0, 0, -0.01, 200);
    return l;
}

static const double along_x[3] = {1, 0, 0}, along_y[3] = {0, 1, 0}, along_z[3] = {0, 0, 1};

// Press near the middle, level.
static lattice pressed_flat(kn_probe_def tool, double low_m)
{
    return pressed(tool, (double[]){0.0012, -0.0007, low_m}, 0, along_z);
}

static double integral(const lattice *l, const kn_touch *touch)
{
    kn_touch_face face;
    double sum = 0;
    kn_touch_face_of(l->model, 0, touch->normal, &face);
    for (int i = 0; i < 64; i++) sum += touch->pressure_pa[i / 8][i % 8];
    return sum * face.size_m[0] * face.size_m[1] / 64;
}

static double peak(const kn_touch *touch)
{
    double most = 0;
    for (int i = 0; i < 64; i++) most = fmax(most, touch->pressure_pa[i / 8][i % 8]);
    return most;
}

TEST(
    "the pressure map integrates to the force along the normal for ball, coupled ball, box, cross, cylinder and finger "
    "in several poses, and for a ball that slides with friction")
{
    const struct {
        kn_probe_def tool;
        double low_m, degrees, axis[3];
    } it[] = {{ball, 0.012, 0, {0, 0, 1}},        {box, 0, 0, {0, 0, 1}},         {star, 0, 0, {0, 0, 1}},
              {pillar, 0, 0, {0, 0, 1}},          {finger, 0.008, 0, {0, 0, 1}},  {finger, 0.008, 90, {0, 1, 0}},
              {finger, 0.008, 90, {0.6, 0.8, 0}}, {finger, 0.008, 50, {1, 0, 0}}, {box, 0.003, 15, {0, 1, 0}},
              {box, 0.003, 25, {0.8, 0.6, 0}},    {held, 0.012, 0, {0, 0, 1}},    {rough, 0.012, 0, {0, 0, 1}}};
    for (int i = 0; i < COUNT(it); i++) {
        const bool slides = it[i].tool.friction > 0;
        LATTICE l = pressed(it[i].tool, (double[]){0.0012, -0.0007, it[i].low_m}, it[i].degrees, it[i].axis);
        if (slides) move(&l, 0, 0.02, 0.01, 0, 150);
        kn_touch touch = touch_of(&l);
        const double *f = l.out.probe[0].force_n, all = sqrt(kn_dot(f, f));
        double force = slides ? kn_dot(f, touch.normal) : all; // this tool is not turned in the scene
        CHECK(force > 0.05 && (!slides || fabs(f[0]) > 0.1 * f[2]));
        CHECK_NEAR(integral(&l, &touch), force, 1e-9 * force);
        CHECK(touch.area_m2 > 1e-5 && touch.peak_pressure_pa * touch.area_m2 > force);
        CHECK(peak(&touch) > 0 && peak(&touch) < 1.2 * touch.peak_pressure_pa);
    }
}

TEST("the pressure map of a plate is the force on its nodes, and a plate does not slip")
{
    LATTICE l = pressed(plate, (double[]){0, 0, 0}, 0, along_z);
    kn_touch touch = touch_of(&l);
    double up = l.out.probe[0].force_n[2];
    CHECK(up > 1 && touch.normal[2] == 1);
    CHECK_NEAR(integral(&l, &touch), up, 1e-9 * up);
    CHECK_NEAR(touch.area_m2, 0.02 * 0.02, 1e-9);
    for (int k = 0; k < 3; k++) CHECK_NEAR(touch.centre_m[k], 0, k < 2 ? 1e-5 : 1e-4);
    for (int k = 0; k < 3; k++) CHECK(touch.slip_velocity_m_s[k] == 0);
    CHECK(touch.pressure_pa[0][0] > touch.pressure_pa[3][3]); // a rigid edge concentrates the pressure
}

TEST("the forces on the nodes add up to the opposite of the tool's force for a plate, a rough ball and a lying finger")
{
    for (int i = 0; i < 3; i++) {
        LATTICE l = i == 0   ? pressed_flat(plate, 0)
                    : i == 1 ? pressed_flat(rough, 0.012)
                             : pressed(finger, (double[]){0.0012, -0.0007, 0.008}, 90, along_y);
        if (i == 1) move(&l, 0, 0.02, 0, 0, 50);
        double(*node)[3] = calloc((size_t)l.model->node_count, sizeof *node), sum[3] = {0};
        const double *f = l.out.probe[0].force_n;
        int loaded = 0;
        kn_touch_nodes(l.model, l.state, l.scratch, node);
        for (int n = 0; n < l.model->node_count; n++) {
            for (int k = 0; k < 3; k++) sum[k] += node[n][k];
            loaded += node[n][2] != 0;
            CHECK(node[n][2] == 0 || l.model->rest_m[n][2] >= 0.0299);
        }
        for (int k = 0; k < 3; k++) CHECK_NEAR(sum[k], -f[k], 1e-9 * fabs(f[2]));
        CHECK(f[2] > 0.05 && loaded >= 4);
        l.in.probe[0].attached = false;
        step(&l);
        kn_touch_nodes(l.model, l.state, l.scratch, node);
        for (int n = 0; n < l.model->node_count; n++) CHECK(kn_dot(node[n], node[n]) == 0);
        free(node);
    }
}

TEST("a centred press has its centre of pressure and the middle of its map under the tool")
{
    LATTICE l = pressed(ball, (double[]){0, 0, 0.012}, 0, along_z);
    kn_touch touch = touch_of(&l);
    CHECK_NEAR(touch.centre_m[0], 0, 1e-6);
    CHECK_NEAR(touch.centre_m[1], 0, 1e-6);
    CHECK(touch.centre_m[2] < -0.009 && touch.centre_m[2] > -0.012); // on the ball's lower side
    CHECK(touch.normal[2] > 1 - 1e-9);
    for (int i = 0; i < 64; i++) { // the map is symmetric
        double here = touch.pressure_pa[i / 8][i % 8], p = 1e-3 * peak(&touch);
        CHECK_NEAR(here, touch.pressure_pa[i / 8][7 - i % 8], p);
        CHECK_NEAR(here, touch.pressure_pa[7 - i / 8][i % 8], p);
        CHECK_NEAR(here, touch.pressure_pa[i % 8][i / 8], p);
    }
    CHECK(touch.pressure_pa[3][3] > touch.pressure_pa[1][3] && touch.pressure_pa[0][0] == 0);
}

TEST("a tilted tool has its centre of pressure and its pressure map on the lower side")
{
    const double at[3] = {0.0012, -0.0007, 0.0008};
    // Turn about y by the right-hand rule: the side at -x is lifted, the side at +x goes down. About x: +y is lifted.
    LATTICE a = pressed(box, at, 8, along_y), b = pressed(box, at, 8, along_x);
    kn_touch to_x = touch_of(&a), to_y = touch_of(&b);
    double column[8] = {0}, row[8] = {0};
    for (int i = 0; i < 64; i++) {
        column[i % 8] += to_x.pressure_pa[i / 8][i % 8];
        row[i / 8] += to_y.pressure_pa[i / 8][i % 8];
    }
    CHECK(to_x.centre_m[0] > 0.003 && column[7] + column[6] > column[0] + column[1]);
    CHECK(to_y.centre_m[1] < -0.0015 && row[0] + row[1] + row[2] + row[3] > row[4] + row[5] + row[6] + row[7]);
}

TEST("a finger on its side has a map as long as the finger and touches along its whole length")
{
    LATTICE l = pressed(finger, (double[]){-0.008, 0, 0.008}, 90, along_y); // the finger's axis lies along x
    kn_touch touch = touch_of(&l);
    kn_touch_face face;
    CHECK_NEAR(touch.normal[0], -1, 1e-3); // up in the scene
    CHECK_NEAR(touch.centre_m[2], 0.008, 1e-4);
    CHECK(touch.centre_m[0] > 0.005);
    kn_touch_face_of(l.model, 0, touch.normal, &face);
    CHECK_NEAR(face.u[2], 1, 1e-3); // the tool's x has turned into the map's u axis
    CHECK_NEAR(face.size_m[0], 0.032, 1e-4);
    CHECK_NEAR(face.size_m[1], 0.016, 1e-4);
    for (int j = 2; j < 6; j++) CHECK(touch.pressure_pa[3][j] > 0.5 * touch.pressure_pa[3][3]);
    CHECK(touch.pressure_pa[0][3] == 0 && touch.pressure_pa[7][3] == 0);
}

TEST("the slip is the velocity of the skin: along -x in the tool's frame for a tool drawn along x")
{
    LATTICE l = pressed_flat(ball, 0.012), across = pressed(box, (double[]){0.0012, -0.0007, 0}, 90, along_z);
    kn_probe_def sticky = ball;
    sticky.friction = 3;
    LATTICE stuck = pressed_flat(sticky, 0.012);
    kn_touch touch = touch_of(&l);
    CHECK(fabs(touch.slip_velocity_m_s[0]) < 1e-3 && fabs(touch.slip_velocity_m_s[2]) < 1e-4); // a pure press
    move(&l, 0, 0.05, 0, 0, 100), move(&across, 0, 0.05, 0, 0, 100), move(&stuck, 0, 0.0005, 0, 0, 1500);
    touch = touch_of(&l);
    CHECK(touch.slip_velocity_m_s[0] < -0.02 && touch.slip_velocity_m_s[0] > -0.06);
    CHECK(fabs(touch.slip_velocity_m_s[1]) < 1e-3);
    touch = touch_of(&across); // the tool's y is the scene's -x
    CHECK(touch.slip_velocity_m_s[1] > 0.02 && fabs(touch.slip_velocity_m_s[0]) < 5e-3);
    touch = touch_of(&stuck); // the contact sticks: the rest is the foundation giving way
    CHECK(fabs(touch.slip_velocity_m_s[0]) < 0.0004);
}

TEST("the same press by a turned tool gives the same map, area, centre and peak")
{
    // Everything is turned by 90 degrees about z, on a block that looks the same then: leaning about y becomes about -x.
    LATTICE a = pressed(box, (double[]){0.003, 0.001, 3e-4}, 5, along_y), b = under(box);
    const double q = sqrt(0.5), turn[4] = {q, 0, 0, q};
    put(&b, 0, -0.001, 0.003, 0.0304);
    kn_turn_multiply(turn, a.in.probe[0].orientation_wxyz, b.in.probe[0].orientation_wxyz);
    move(&b, 0, 0, 0, -0.01, 200);
    kn_touch one = touch_of(&a), other = touch_of(&b);
    for (int i = 0; i < 64; i++)
        CHECK_NEAR(one.pressure_pa[i / 8][i % 8], other.pressure_pa[i / 8][i % 8], 5e-3 * peak(&one));
    CHECK(one.centre_m[0] > 0.0005);
    for (int k = 0; k < 3; k++) CHECK_NEAR(one.centre_m[k], other.centre_m[k], 2e-5);
    for (int k = 0; k < 3; k++) CHECK_NEAR(one.normal[k], other.normal[k], 1e-3);
    CHECK_NEAR(one.peak_pressure_pa, other.peak_pressure_pa, 5e-3 * one.peak_pressure_pa);
    CHECK_NEAR(one.area_m2, other.area_m2, 0.02 * one.area_m2);
}

TEST("the face of the pressure map is right-handed and perpendicular to its normal, for all normals")
{
    LATTICE l = under(box);
    const double normals[][3] = {{0.6, 0, 0.8}, {0, -1, 0}, {0.48, 0.64, -0.6}, {0, 0, -1}, {0, 0, 1}};
    kn_touch_face f;
    for (int i = 0; i < COUNT(normals); i++) {
        double n[3];
        kn_touch_face_of(l.model, 0, normals[i], &f);
        kn_cross(f.u, f.v, n);
        for (int k = 0; k < 3; k++) CHECK_NEAR(n[k], normals[i][k], 1e-12);
        CHECK_NEAR(kn_dot(f.u, f.u), 1, 1e-12);
        CHECK_NEAR(kn_dot(f.v, f.v), 1, 1e-12);
    }
    CHECK_NEAR(f.low_m[0], -0.01, 1e-12);
    CHECK_NEAR(f.size_m[1], 0.015, 1e-12);
}

TEST("a tool without contact, or a detached tool, has an empty contact patch")
{
    const kn_touch nothing = {0};
    LATTICE l = under(ball);
    put(&l, 0, 0, 0, 0.06);
    step(&l);
    kn_touch touch = touch_of(&l);
    CHECK(memcmp(&touch, &nothing, sizeof nothing) == 0);
    put(&l, 0, 0, 0, 0.0419);
    steps(&l, 20);
    l.in.probe[0].attached = false;
    step(&l);
    touch = touch_of(&l);
    CHECK(memcmp(&touch, &nothing, sizeof nothing) == 0);
}
