#include "core/shape.h"
#include "core/algebra/algebra.h"
#include "tests/check.h"
#include "tests/dice.h"

#include <stdint.h>

static const double millimetre = 1e-3;

static kn_shape of(kn_solid part)
{
    kn_shape shape = {0};
    if (!kn_shape_add(&shape, &part)) exit(70);
    return shape;
}

static kn_shape a_box(void) { return of(kn_solid_box((double[]){0.02, 0.03, 0.01}, 0.001)); }

// Make a hammer: an upright handle, and a head across it, turned by 30 degrees about x.
static kn_shape a_union(void)
{
    kn_solid handle = kn_solid_cylinder(0.004, 0.06, 0.001);
    kn_solid head = kn_solid_capsule(0.007, 0.02);
    double c = cos(acos(-1.0) / 6), s = sin(acos(-1.0) / 6);
    double turn[3][3] = {{1, 0, 0}, {0, c, -s}, {0, s, c}};
    kn_shape shape = of(handle);
    head.at_m[1] = 0.003, head.at_m[2] = 0.05, head.turned = true;
    memcpy(head.turn, turn, sizeof turn);
    if (!kn_shape_add(&shape, &head)) exit(70);
    return shape;
}

static double at(const kn_shape *shape, double x, double y, double z)
{
    double way[3];
    return kn_shape_distance(shape, (double[]){x, y, z}, way);
}

static void somewhere(uint64_t *seed, double half, double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = kn_dice_in(seed, -half, half);
}

TEST("the distance to a sphere and a capsule is the distance to a point and to an axis, minus the radius")
{
    kn_shape ball = of(kn_solid_sphere(0.01)), finger = of(kn_solid_capsule(0.008, 0.02));
    CHECK_NEAR(at(&ball, 0.03, 0.04, 0), 0.04, 1e-15);
    CHECK_NEAR(at(&ball, 0, 0, 0), -0.01, 1e-15);
    CHECK_NEAR(at(&finger, 0, 0, -0.01), 0.002, 1e-15);
    CHECK_NEAR(at(&finger, 0.01, 0, 0.013), 0.002, 1e-15);
    CHECK_NEAR(at(&finger, 0, 0.003, 0.024), 0.005 - 0.008, 1e-15);
}

TEST("a box stands on its origin, and its edges and corners are rounded")
{
    kn_shape box = a_box();
    CHECK_NEAR(at(&box, 0, 0, -0.002), 0.002, 1e-15);
    CHECK_NEAR(at(&box, 0, 0, 0.012), 0.002, 1e-15);
    CHECK_NEAR(at(&box, 0.013, 0.002, 0.004), 0.003, 1e-15);
    CHECK_NEAR(at(&box, 0, 0, 0.003), -0.003, 1e-15);
    double edge = sqrt(2.0) * 0.001 - 0.001, corner = sqrt(3.0) * 0.001 - 0.001;
    CHECK_NEAR(at(&box, 0.01, 0.015, 0.005), edge, 1e-15);
    CHECK_NEAR(at(&box, 0.01, 0.015, 0), corner, 1e-15);
}

TEST("a cylinder stands on its origin, and its edge is rounded")
{
    kn_shape pillar = of(kn_solid_cylinder(0.01, 0.02, 0.002));
    CHECK_NEAR(at(&pillar, 0.03, 0.04, 0.01), 0.04, 1e-15);
    CHECK_NEAR(at(&pillar, 0.003, 0, -0.004), 0.004, 1e-15);
    CHECK_NEAR(at(&pillar, 0, 0.006, 0.023), 0.003, 1e-15);
    CHECK_NEAR(at(&pillar, 0, 0, 0.001), -0.001, 1e-15);
    CHECK_NEAR(at(&pillar, 0.01, 0, 0), (sqrt(2.0) - 1) * 0.002, 1e-15);
}

TEST("the distance to a union is that to its nearest part, which may be moved and turned")
{
    kn_shape hammer = a_union();
    CHECK_NEAR(at(&hammer, 0, 0, -0.003), 0.003, 1e-15);
    CHECK_NEAR(at(&hammer, 0.009, 0, 0.02), 0.005, 1e-15);
    // A point beside the head, 13 mm from the head's origin along its own axis: up, and sideways by half of 13 mm.
    double along = 0.013, c = cos(acos(-1.0) / 6);
    CHECK_NEAR(at(&hammer, 0.01, 0.003 - 0.5 * along, 0.05 + c * along), 0.003, 1e-15);
}

TEST("the gradient is the unit vector to the outside: finite differences agree, and it leads from the surface")
{
    kn_shape shapes[] = {of(kn_solid_sphere(0.01)), of(kn_solid_capsule(0.008, 0.02)), a_box(),
                         of(kn_solid_cylinder(0.01, 0.02, 0.002)), a_union()};
    uint64_t seed = 1;
    for (int s = 0; s < 5; s++) {
        double half = 1.2 * shapes[s].bound_m;
        int met = 0, arrived = 0, outside = 0;
        for (int i = 0; i < 4000; i++) {
            double p[3], way[3], slope[3], foot[3], back[3];
            somewhere(&seed, half, p);
            double d = kn_shape_distance(&shapes[s], p, way);
            CHECK_NEAR(kn_dot(way, way), 1.0, 1e-14);
            for (int k = 0; k < 3; k++) {
                double e[3] = {0};
                e[k] = 1e-8;
                slope[k] = (at(&shapes[s], p[0] + e[0], p[1] + e[1], p[2] + e[2]) -
                            at(&shapes[s], p[0] - e[0], p[1] - e[1], p[2] - e[2])) /
                           2e-8;
            }
            double off[3] = {slope[0] - way[0], slope[1] - way[1], slope[2] - way[2]};
            met += kn_dot(off, off) < 1e-10;
            for (int k = 0; k < 3; k++) foot[k] = p[k] - d * way[k];
            outside += d > 0;
            arrived += d > 0 && fabs(kn_shape_distance(&shapes[s], foot, back)) < 1e-12;
        }
        CHECK(met > 3950);         // all points except those whose nearest part or face changes within 1e-8 m
        CHECK(arrived == outside); // all points outside, since the distance is exact there
    }
}

TEST("the distance changes no faster than the position: |d(a) - d(b)| <= |a - b|")
{
    kn_shape shapes[] = {a_box(), of(kn_solid_cylinder(0.01, 0.02, 0.002)), a_union()};
    uint64_t seed = 2;
    for (int s = 0; s < 3; s++)
        for (int i = 0; i < 4000; i++) {
            double a[3], b[3];
            somewhere(&seed, 1.2 * shapes[s].bound_m, a), somewhere(&seed, 1.2 * shapes[s].bound_m, b);
            double apart[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
            CHECK(fabs(at(&shapes[s], a[0], a[1], a[2]) - at(&shapes[s], b[0], b[1], b[2])) <=
                  sqrt(kn_dot(apart, apart)) + 1e-15);
        }
}

TEST("the bound encloses the shape, and the support in any direction is that of the farthest point")
{
    kn_shape shapes[] = {of(kn_solid_sphere(0.01)), of(kn_solid_capsule(0.008, 0.02)), a_box(),
                         of(kn_solid_cylinder(0.01, 0.02, 0.002)), a_union()};
    uint64_t seed = 3;
    for (int s = 0; s < 5; s++)
        for (int i = 0; i < 40; i++) {
            double way[3], farthest = -1;
            somewhere(&seed, 1, way);
            double length = sqrt(kn_dot(way, way));
            for (int k = 0; k < 3; k++) way[k] /= length;
            for (int j = 0; j < 20000; j++) {
                double p[3], out[3];
                somewhere(&seed, 1.1 * shapes[s].bound_m, p);
                double d = kn_shape_distance(&shapes[s], p, out);
                for (int k = 0; k < 3; k++) p[k] -= d > 0 ? d * out[k] : 0; // a point on the surface or inside
                CHECK(kn_dot(p, p) <= pow(shapes[s].bound_m + 1e-12, 2));
                farthest = fmax(farthest, kn_dot(p, way));
            }
            double reach = kn_shape_support(&shapes[s], way);
            CHECK(farthest <= reach + 1e-12);
            CHECK(farthest > reach - 1.5 * millimetre); // as close as 20 000 random points come
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

TESTS_MAIN
