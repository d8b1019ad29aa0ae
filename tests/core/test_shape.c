#include "core/shape.h"
#include "core/algebra/algebra.h"
#include "tests/check.h"
#include "tests/core/surface_of.h"
#include "tests/dice.h"

// Make a hammer: an upright handle, and a head across it, turned by 30 degrees about x.
static kn_shape a_union(void)
{
    kn_solid handle = kn_solid_cylinder(0.004, 0.06, 0.001);
    kn_solid head = kn_solid_capsule(0.007, 0.02);
    double c = cos(acos(-1.0) / 6), s = sin(acos(-1.0) / 6);
    double turn[3][3] = {{1, 0, 0}, {0, c, -s}, {0, s, c}};
    kn_shape shape = shape_of_part(handle);
    head.at_m[1] = 0.003, head.at_m[2] = 0.05, head.turned = true;
    memcpy(head.turn, turn, sizeof turn);
    if (!kn_shape_add(&shape, &head)) exit(70);
    return shape;
}

static double at(const kn_shape *shape, const double p[3])
{
    double way[3];
    return kn_shape_distance(shape, p, way);
}

static void somewhere(uint64_t *seed, double half, double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = kn_dice_in(seed, -half, half);
}

typedef enum which { BALL, FINGER, BOX, PILLAR, HAMMER, SHAPES } which;

static kn_shape shape_of(which i)
{
    const kn_shape shapes[SHAPES] = {shape_of_part(kn_solid_sphere(0.01)), shape_of_part(kn_solid_capsule(0.008, 0.02)),
                                     shape_of_part(kn_solid_box((double[]){0.02, 0.03, 0.01}, 0.001)),
                                     shape_of_part(kn_solid_cylinder(0.01, 0.02, 0.002)), a_union()};
    return shapes[i];
}

TEST(
    "the distance is that to a point or an axis minus the radius, to a box or a cylinder that stands on its origin, or "
    "to a union's nearest part")
{
    const double c = cos(acos(-1.0) / 6), along = 0.013;
    const struct {
        which shape;
        double p[3], distance;
    } table[] = {
        {BALL, {0.03, 0.04, 0}, 0.04},
        {BALL, {0, 0, 0}, -0.01},
        {FINGER, {0, 0, -0.01}, 0.002},
        {FINGER, {0.01, 0, 0.013}, 0.002},
        {FINGER, {0, 0.003, 0.024}, 0.005 - 0.008},
        {BOX, {0, 0, -0.002}, 0.002},
        {BOX, {0, 0, 0.012}, 0.002},
        {BOX, {0.013, 0.002, 0.004}, 0.003},
        {BOX, {0, 0, 0.003}, -0.003},
        {BOX, {0.01, 0.015, 0.005}, (sqrt(2.0) - 1) * 0.001}, // edges and corners are rounded
        {BOX, {0.01, 0.015, 0}, (sqrt(3.0) - 1) * 0.001},
        {PILLAR, {0.03, 0.04, 0.01}, 0.04},
        {PILLAR, {0.003, 0, -0.004}, 0.004},
        {PILLAR, {0, 0.006, 0.023}, 0.003},
        {PILLAR, {0, 0, 0.001}, -0.001},
        {PILLAR, {0.01, 0, 0}, (sqrt(2.0) - 1) * 0.002},
        {HAMMER, {0, 0, -0.003}, 0.003},
        {HAMMER, {0.009, 0, 0.02}, 0.005},
        // a point beside the head, 13 mm from the head's origin along its own axis: up, and sideways by half of 13 mm
        {HAMMER, {0.01, 0.003 - 0.5 * along, 0.05 + c * along}, 0.003},
    };
    for (int i = 0; i < COUNT(table); i++) {
        kn_shape shape = shape_of(table[i].shape);
        CHECK_NEAR(at(&shape, table[i].p), table[i].distance, 1e-15);
    }
}

TEST("the gradient is the unit vector to the outside: finite differences agree, and it leads from the surface")
{
    uint64_t seed = 1;
    for (int s = 0; s < SHAPES; s++) {
        kn_shape shape = shape_of((which)s);
        double half = 1.2 * shape.bound_m;
        int met = 0, arrived = 0, outside = 0;
        for (int i = 0; i < 4000; i++) {
            double p[3], way[3], slope[3], foot[3], back[3];
            somewhere(&seed, half, p);
            double d = kn_shape_distance(&shape, p, way);
            CHECK_NEAR(kn_dot(way, way), 1.0, 1e-14);
            for (int k = 0; k < 3; k++) {
                double more[3] = {p[0], p[1], p[2]}, less[3] = {p[0], p[1], p[2]};
                more[k] += 1e-8, less[k] -= 1e-8;
                slope[k] = (at(&shape, more) - at(&shape, less)) / 2e-8;
            }
            double off[3] = {slope[0] - way[0], slope[1] - way[1], slope[2] - way[2]};
            met += kn_dot(off, off) < 1e-10;
            for (int k = 0; k < 3; k++) foot[k] = p[k] - d * way[k];
            outside += d > 0;
            arrived += d > 0 && fabs(kn_shape_distance(&shape, foot, back)) < 1e-12;
        }
        CHECK(met > 3950);         // all points except those whose nearest part or face changes within 1e-8 m
        CHECK(arrived == outside); // all points outside, since the distance is exact there
    }
}

TEST("the distance changes no faster than the position: |d(a) - d(b)| <= |a - b|")
{
    uint64_t seed = 2;
    for (int s = BOX; s < SHAPES; s++) {
        kn_shape shape = shape_of((which)s);
        for (int i = 0; i < 4000; i++) {
            double a[3], b[3];
            somewhere(&seed, 1.2 * shape.bound_m, a), somewhere(&seed, 1.2 * shape.bound_m, b);
            double apart[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
            CHECK(fabs(at(&shape, a) - at(&shape, b)) <= sqrt(kn_dot(apart, apart)) + 1e-15);
        }
    }
}

TEST("the bound encloses the shape, and the support in any direction is that of the farthest point")
{
    uint64_t seed = 3;
    for (int i = 0; i < SHAPES * 40; i++) {
        kn_shape shape = shape_of((which)(i / 40));
        double way[3], farthest = -1;
        somewhere(&seed, 1, way);
        double length = sqrt(kn_dot(way, way));
        for (int k = 0; k < 3; k++) way[k] /= length;
        for (int j = 0; j < 20000; j++) {
            double p[3], out[3];
            somewhere(&seed, 1.1 * shape.bound_m, p);
            double d = kn_shape_distance(&shape, p, out);
            for (int k = 0; k < 3; k++) p[k] -= d > 0 ? d * out[k] : 0; // a point on the surface or inside
            CHECK(kn_dot(p, p) <= pow(shape.bound_m + 1e-12, 2));
            farthest = fmax(farthest, kn_dot(p, way));
        }
        double reach = kn_shape_support(&shape, way);
        CHECK(farthest <= reach + 1e-12);
        CHECK(farthest > reach - 1.5e-3); // as close as 20 000 random points come
    }
}

TEST("a tool has room for eight parts and refuses a ninth")
{
    kn_shape shape = {0};
    kn_solid part = kn_solid_sphere(0.01);
    for (int i = 0; i < KN_PARTS_MAX; i++) CHECK(kn_shape_add(&shape, &part));
    CHECK(!kn_shape_add(&shape, &part));
    CHECK(shape.part_count == KN_PARTS_MAX);
}
