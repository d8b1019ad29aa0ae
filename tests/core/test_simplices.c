#include "core/simplices.h"
#include "tests/check.h"

#include <stdbool.h>

static char error[256];

// Make a block of nx x ny x nz cells of side h. Each cell has six tetrahedra around one diagonal (Kuhn).
static kn_simplices *block(int nx, int ny, int nz, double h)
{
    // The corners between 0 and 7, the ends of the diagonal. Bit k of a corner is axis k.
    static const int path[6][2] = {{1, 3}, {1, 5}, {2, 3}, {2, 6}, {4, 5}, {4, 6}};
    int sx = nx + 1, sxy = sx * (ny + 1), e = 0;
    kn_simplices *s = kn_simplices_create(3, sxy * (nz + 1), 6 * nx * ny * nz);
    if (!s) return NULL;
    for (int i = 0; i < s->node_count; i++) {
        s->x_m[i][0] = h * (i % sx);
        s->x_m[i][1] = h * (i / sx % (ny + 1));
        s->x_m[i][2] = h * (i / sxy);
    }
    for (int cell = 0; cell < nx * ny * nz; cell++)
        for (int p = 0; p < 6; p++, e++) {
            int corner[4] = {0, path[p][0], path[p][1], 7};
            int origin = cell / (nx * ny) * sxy + cell / nx % ny * sx + cell % nx;
            for (int k = 0; k < 4; k++)
                s->element[e][k] = origin + (corner[k] & 1) + (corner[k] >> 1 & 1) * sx + (corner[k] >> 2) * sxy;
            s->tag[e] = 100 + e;
            if (p != 1 && p != 2 && p != 5) continue;
            int swap = s->element[e][1];
            s->element[e][1] = s->element[e][2], s->element[e][2] = swap;
        }
    return s;
}

TEST("a block of tetrahedra is valid and has the volume and the edges of a block")
{
    OWN(kn_simplices) *s = block(3, 2, 4, 0.01);
    kn_simplices_measures m;
    if (!kn_simplices_check(s, error, sizeof error)) KN_TEST_FAIL("%s", error);
    CHECK(kn_simplices_measure(s, &m));
    CHECK_NEAR(m.volume, 24e-6, 1e-15);
    // edges along axes, face diagonals and body diagonals
    CHECK(m.edges == (3 * 3 * 5 + 4 * 2 * 5 + 4 * 3 * 4) + (3 * 2 * 5 + 3 * 3 * 4 + 4 * 2 * 4) + 24);
    CHECK_NEAR(m.edge_min_m, 0.01, 1e-15);
    CHECK_NEAR(m.edge_max_m, 0.01 * sqrt(3), 1e-15);
    CHECK_NEAR(m.quality_min, 12 * pow(0.5, 2. / 3) / (3 + 2 * 2 + 3), 1e-12);
}

TEST("the regular tetrahedron and the regular triangle have quality 1 at every size")
{
    static const double corner[4][3] = {{0, 0, 0}, {1, 1, 0}, {1, 0, 1}, {0, 1, 1}};
    for (double h = 1e-4; h < 10; h *= 100) {
        OWN(kn_simplices) *s = kn_simplices_create(3, 4, 1), *flat = kn_simplices_create(2, 3, 1);
        kn_simplices_measures m;
        for (int i = 0; i < 4; i++)
            for (int k = 0; k < 3; k++) s->x_m[i][k] = h * corner[i][k];
        memcpy(s->element[0], (int[]){0, 2, 1, 3}, sizeof s->element[0]);
        flat->x_m[1][0] = h;
        flat->x_m[2][0] = h / 2;
        flat->x_m[2][2] = h * sqrt(0.75);
        memcpy(flat->element[0], (int[]){0, 1, 2, -1}, sizeof flat->element[0]);
        CHECK(kn_simplices_check(s, error, sizeof error) && kn_simplices_measure(s, &m));
        CHECK_NEAR(m.quality_min, 1, 1e-12);
        CHECK_NEAR(m.volume, h * h * h / 3, 1e-12 * h * h * h);
        int lowest = -1;
        CHECK_NEAR(kn_simplices_lowest(s, &lowest), h * 2 / sqrt(3), 1e-12 * h);
        CHECK(lowest == 0);
        CHECK(kn_simplices_check(flat, error, sizeof error) && kn_simplices_measure(flat, &m));
        CHECK_NEAR(m.quality_mean, 1, 1e-12);
        CHECK_NEAR(kn_simplices_lowest(flat, &lowest), h * sqrt(0.75), 1e-12 * h);
        CHECK(m.edges == 3);
    }
}

static void refused(const kn_simplices *s, int element, const char *why)
{
    int blame = -1;
    CHECK(!kn_simplices_blame(s, &blame, error, sizeof error));
    CHECK_STR(error, why);
    CHECK(element < 0 || blame == element);
}

TEST("a node that does not exist, is not finite or belongs to no element is refused, and so is a wrong count")
{
    OWN(kn_simplices) *s = block(1, 1, 1, 0.01), *twice = block(1, 1, 2, 0.01);
    const int was = s->element[4][2];
    for (s->element[4][2] = 8; s->element[4][2] >= -1; s->element[4][2] -= 9)
        refused(s, 4, "element 104 has a node that does not exist");
    s->element[4][2] = was, s->x_m[7][1] = NAN;
    refused(s, 5, "a node of element 105 is not at a finite place");
    twice->element_count = 6;
    refused(twice, -1, "node 9 of 12 belongs to no element");
    twice->element_count = 0;
    refused(twice, -1, "0 elements, expected 1 to 2097152");
    twice->element_count = 1;
    twice->node_count = 3;
    refused(twice, -1, "3 nodes, expected 4 to 262144");
}

TEST("coinciding nodes are found across the borders of the search grid")
{
    for (int trial = 0; trial < 200; trial++) {
        // Two blocks that touch. Each has its own nodes on the common side, at a tiny distance from the other's.
        OWN(kn_simplices) *a = block(2, 2, 2, 0.01), *s = kn_simplices_create(3, 54, 96);
        double off = 0.8e-11 * (trial % 7 - 3), shift = 1e-4 * trial;
        for (int i = 0; i < 54; i++)
            for (int k = 0; k < 3; k++)
                s->x_m[i][k] = a->x_m[i % 27][k] + shift + (k == 0 && i >= 27 ? 0.02 : 0) + (i >= 27 ? off : 0);
        for (int e = 0; e < 96; e++)
            for (int k = 0; k < 4; k++) s->element[e][k] = a->element[e % 48][k] + (e < 48 ? 0 : 27);
        CHECK(!kn_simplices_check(s, error, sizeof error) && strstr(error, "different nodes at one place"));
    }
}

TEST("a mesh of 227 000 nodes is checked in reasonable time, since no search is quadratic")
{
    // 226 981 nodes and 1 296 000 tetrahedra: a quadratic search would take hours.
    OWN(kn_simplices) *s = block(60, 60, 60, 0.001);
    CHECK(s != NULL);
    if (s && !kn_simplices_check(s, error, sizeof error)) KN_TEST_FAIL("%s", error);
}

TEST("elements that are flat on average are refused, even if the worst one alone would pass")
{
    OWN(kn_simplices) *s = block(3, 3, 2, 0.01);
    CHECK(kn_simplices_check(s, error, sizeof error));
    for (int i = 0; i < s->node_count; i++) s->x_m[i][2] *= 0.05;
    CHECK(!kn_simplices_check(s, error, sizeof error) && strstr(error, "flat or elongated on average (mean quality"));
}

TEST("an object is placed on the table and centred over the origin")
{
    OWN(kn_simplices) *s = block(3, 2, 4, 0.01);
    kn_simplices_measures m;
    for (int i = 0; i < s->node_count; i++)
        for (int k = 0; k < 3; k++) s->x_m[i][k] += 1 + k;
    kn_simplices_place(s);
    CHECK(kn_simplices_measure(s, &m) && m.low_m[2] == 0);
    CHECK_NEAR(m.low_m[0], -0.015, 1e-12);
    CHECK_NEAR(m.high_m[1], 0.01, 1e-12);
}
