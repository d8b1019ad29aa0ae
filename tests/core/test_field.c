// gate in release: arithmetic, ten times slower with the sanitizers
#include "core/field.h"
#include "core/shape.h"
#include "core/algebra/algebra.h"
#include "tests/check.h"
#include "tests/core/surface_of.h"
#include "tests/dice.h"

#include <time.h>

OWNS(kn_field, kn_field_drop)

typedef struct error {     // distances in cells
    double anywhere, near; // within the grid; within one cell of the surface
    double turned;         // largest angle between the gradients near the surface, rad
    double beyond;         // relative error of the distance outside of the grid
} error;

static error compare(const kn_field *f, const kn_shape *exact)
{
    error e = {0};
    uint64_t seed = 1;
    for (int i = 0; i < 200000; i++) {
        double p[3], way[3], own[3];
        bool within = i % 4 > 0;
        for (int k = 0; k < 3; k++) {
            double size = f->box_m[1][k] - f->box_m[0][k], more = within ? f->cell_m : 2 * size;
            p[k] = kn_dice_in(&seed, f->box_m[0][k] - more, f->box_m[1][k] + more);
        }
        double d = kn_shape_distance(exact, p, way), off = kn_field_distance(f, p, own) - d;
        if (within) e.anywhere = fmax(e.anywhere, fabs(off) / f->cell_m);
        else e.beyond = fmax(e.beyond, fabs(off) / (fabs(d) + f->cell_m));
        if (fabs(d) > f->cell_m) continue;
        e.near = fmax(e.near, fabs(off) / f->cell_m);
        e.turned = fmax(e.turned, acos(fmin(1, kn_dot(way, own))));
    }
    return e;
}

// Return the largest depth of a ball's triangles below its surface.
static double chord_of(const kn_field *f, double radius_m)
{
    double most = 0, u[3], v[3], normal[3];
    for (int t = 0; t < f->triangle_count; t++) {
        const double *a = f->x_m[f->triangle[t][0]], *b = f->x_m[f->triangle[t][1]], *c = f->x_m[f->triangle[t][2]];
        for (int k = 0; k < 3; k++) u[k] = b[k] - a[k], v[k] = c[k] - a[k];
        kn_cross(u, v, normal);
        most = fmax(most, radius_m - fabs(kn_dot(normal, a)) / sqrt(kn_dot(normal, normal)));
    }
    return most;
}

TEST("a ball of triangles matches the ball within s^3/4r^2 plus the chord error near the surface, and within a cell "
     "elsewhere")
{
    const double r = 0.01, cell = 0.000625;
    for (int fine = 1; fine <= 2; fine++) {
        OWN(kn_field) *f = surface_field(surface_ball(r, 40), cell / fine);
        const kn_shape exact = shape_of_part(kn_solid_sphere(r));
        error e = compare(f, &exact);
        double s = f->cell_m, chord = chord_of(f, r), bound = s * s * s / (4 * r * r) + chord;
        printf("     cells of %.3f mm: %.2g near it, of %.2g; %.2g anywhere, %.2g rad, %.2g beyond\n", 1e3 * s,
               e.near * s, bound, e.anywhere * s, e.turned, e.beyond);
        CHECK(e.near * s <= bound && e.anywhere < 1 && e.turned < 2 * s / r && e.beyond < 0.1);
        CHECK_NEAR(f->fine_m, r, s);
        CHECK_NEAR(f->bound_m, r, 1e-9);
    }
}

TEST("a sharp box of triangles matches the box within one cell")
{
    const double size[3] = {0.02, 0.03, 0.01};
    OWN(kn_field) *f = surface_field(surface_box(size, 0, 3), 0.0005);
    const kn_shape exact = shape_of_part(kn_solid_box(size, 0));
    error e = compare(f, &exact);
    printf("     in cells: %.2f near it, %.2f anywhere; %.2f beyond\n", e.near, e.anywhere, e.beyond);
    CHECK(e.anywhere < 1 && e.beyond < 0.15);
    CHECK_NEAR(f->fine_m, 0.005, 0.0005);
    double way[3];
    // a face is flat, so the distance is exact
    CHECK_NEAR(kn_field_distance(f, (double[]){0.003, 0.004, -0.0002}, way), 0.0002, 1e-8);
    CHECK_NEAR(way[2], -1, 1e-6);
    const kn_shape own = shape_of_part(kn_solid_field(f));
    for (int k = 0; k < 3; k++) CHECK_NEAR(kn_shape_span(&own, k), size[k], 1e-15);
}

TEST("distance and gradient are continuous across cells, and the distance across the border of the grid")
{
    OWN(kn_field) *f = surface_field(surface_box((double[]){0.02, 0.03, 0.01}, 0, 3), 0.0005);
    uint64_t seed = 3;
    for (int i = 0; i < 20000; i++) {
        double p[3], q[3], a[3], b[3];
        for (int k = 0; k < 3; k++) p[k] = q[k] = kn_dice_in(&seed, f->box_m[0][k] - 0.001, f->box_m[1][k] + 0.001);
        int k = i % 3, line = 1 + (int)((p[k] - f->low_m[k]) / f->cell_m); // a border of cells, which p and q straddle
        double border = f->low_m[k] + (line - 0.5) * f->cell_m;
        p[k] = border - 1e-9, q[k] = border + 1e-9;
        double before = kn_field_distance(f, p, a), after = kn_field_distance(f, q, b);
        CHECK(fabs(after - before) < 3e-9);
        for (int c = 0; c < 3; c++) CHECK(fabs(a[c] - b[c]) < 1e-3 || kn_dot(a, a) < 0.5);
        p[k] = f->low_m[k] + 0.75 * f->cell_m - 1e-9, q[k] = p[k] + 2e-9;
        CHECK_NEAR(kn_field_distance(f, p, a), kn_field_distance(f, q, b), 3e-9);
    }
}

TEST("a point in one or both of two crossing bodies is inside, even if the surface is turned inside out")
{
    surface_of a = surface_box((double[]){0.02, 0.02, 0.02}, 0, 2), b = surface_box((double[]){0.01, 0.01, 0.06}, 0, 2);
    surface_of both = {.x_m = malloc((size_t)(a.vertices + b.vertices) * sizeof *a.x_m),
                       .triangle = malloc((size_t)(a.triangles + b.triangles) * sizeof *a.triangle)};
    memcpy(both.x_m, a.x_m, (size_t)a.vertices * sizeof *a.x_m);
    memcpy(both.x_m + a.vertices, b.x_m, (size_t)b.vertices * sizeof *b.x_m);
    both.vertices = a.vertices + b.vertices;
    for (int t = 0; t < a.triangles + b.triangles; t++, both.triangles++)
        for (int c = 0; c < 3; c++) // turn the triangles inside out
            both.triangle[t][2 - c] = t < a.triangles ? a.triangle[t][c] : a.vertices + b.triangle[t - a.triangles][c];
    free(a.x_m), free(a.triangle), free(b.x_m), free(b.triangle);
    OWN(kn_field) *f = surface_field(both, 0.0007);
    double way[3];
    CHECK(kn_field_distance(f, (double[]){0.001, 0.002, 0.01}, way) < -0.002); // inside both bodies
    CHECK(kn_field_distance(f, (double[]){0.008, 0.002, 0.01}, way) < -0.001); // inside one
    CHECK(kn_field_distance(f, (double[]){0.001, 0.002, 0.05}, way) < -0.002); // inside the other
    CHECK(kn_field_distance(f, (double[]){0.008, 0.002, 0.05}, way) > 0.002);
}

TEST("a field with two owners lives until the second drops it, and its points are counted in advance")
{
    kn_field *f = surface_field(surface_ball(0.01, 8), 0.001);
    AT_END(kn_shape_drop) kn_shape shape = shape_of_part(kn_solid_field(f));
    kn_shape_keep(&shape);
    kn_field_drop(f);
    double way[3];
    CHECK(kn_shape_distance(&shape, (double[]){0, 0, 0}, way) < -0.009);
    CHECK(shape.bound_m == f->bound_m && shape.fine_m == f->fine_m);
    CHECK(kn_field_points((double[]){0.02, 0.02, 0.02}, 0.001) >= (double)f->n[0] * f->n[1] * f->n[2]);
}

// Make an upright prism of n sides with fans as end faces. All triangles are long, as drawing programs write a
// cylinder.
static surface_of prism(double radius_m, double height_m, int n)
{
    surface_of s = {.vertices = 2 * n + 2, .triangles = 4 * n};
    s.x_m = calloc((size_t)s.vertices, sizeof *s.x_m);
    s.triangle = calloc((size_t)s.triangles, sizeof *s.triangle);
    s.x_m[2 * n + 1][2] = height_m;
    for (int i = 0; i < n; i++) {
        double way = 6.283185307179586 * i / n;
        int next = (i + 1) % n,
            sides[4][3] = {{i, next, n + next}, {i, n + next, n + i}, {2 * n, next, i}, {2 * n + 1, n + i, n + next}};
        for (int end = 0; end < 2; end++) {
            double *x = s.x_m[end * n + i];
            x[0] = radius_m * cos(way), x[1] = radius_m * sin(way), x[2] = end * height_m;
        }
        memcpy(s.triangle[4 * i], sides, sizeof sides);
    }
    return s;
}

static double seconds_of(surface_of s, double cell_m, double middle_m[3])
{
    clock_t begin = clock();
    OWN(kn_field) *f = surface_field(s, cell_m);
    double taken = (double)(clock() - begin) / CLOCKS_PER_SEC, way[3];
    CHECK_NEAR(kn_field_distance(f, middle_m, way), -0.01, cell_m);
    return taken;
}

TEST("long thin triangles take at most 12 times as long as regular ones, plus 0.2 s")
{
    double ball = seconds_of(surface_ball(0.01, 26), 1e-3, (double[]){0, 0, 0});       // 8 112 triangles
    double strips = seconds_of(prism(0.01, 0.02, 2000), 1e-3, (double[]){0, 0, 0.01}); // 8 000 triangles
    printf("     %.3f s and %.3f s\n", ball, strips);
    CHECK(strips < 12 * ball + 0.2);
}
