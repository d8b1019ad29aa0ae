#include "clients/picture/object_still.h"
#include "tests/check.h"

// Make a sheet of n x n vertices, 1 cm on a side, shifted along x and bent down in the middle.
static kn_object_still sheet(int n, float shift_m, float bend_m)
{
    kn_object_still s = {.vertex_count = n * n, .triangle_count = 2 * (n - 1) * (n - 1)};
    s.rest = calloc((size_t)s.vertex_count, sizeof *s.rest);
    s.now = calloc((size_t)s.vertex_count, sizeof *s.now);
    s.triangle = calloc((size_t)s.triangle_count, sizeof *s.triangle);
    for (int v = 0; v < n * n; v++) {
        const float u = (float)(v % n) / (float)(n - 1), w = (float)(v / n) / (float)(n - 1);
        memcpy(s.rest[v], (float[]){shift_m + 0.01f * u, 0.01f * w, 0}, sizeof *s.rest);
        memcpy(s.now[v], s.rest[v], sizeof *s.now);
        s.now[v][2] = -bend_m * 16 * u * (1 - u) * w * (1 - w);
    }
    for (int t = 0; t < s.triangle_count; t++) {
        const int cell = t / 2, a = cell % (n - 1) + n * (cell / (n - 1));
        memcpy(s.triangle[t], t % 2 ? (int[]){a + 1, a + n + 1, a + n} : (int[]){a, a + 1, a + n}, sizeof *s.triangle);
    }
    return s;
}

static double most(const kn_object_still *first, const kn_object_still *second, kn_vertex_match *m)
{
    static float value[10000];
    char error[300] = "";
    double most_m = -1;
    if (!kn_vertex_match_make(m, first, second, error, sizeof error)) KN_TEST_FAIL("%s", error);
    else kn_vertex_match_distance(m, first, second, value);
    for (int v = 0; v < m->count; v++) most_m = fmax(most_m, value[v]);
    return most_m;
}

TEST("two states of one mesh are compared vertex by vertex, and equal states have distance 0")
{
    kn_vertex_match m;
    AT_END(kn_object_still_free)
    kn_object_still a = sheet(11, 0, 0.002f), b = sheet(11, 0, 0.002f), flat = sheet(11, 0, 0);
    CHECK(most(&a, &b, &m) == 0);
    CHECK(m.same && m.count == 121 && m.apart_m == 0);
    for (int v = 0; v < m.count; v++) CHECK(m.first[v] == v);
    kn_vertex_match_free(&m);
    CHECK_NEAR(most(&a, &flat, &m), 0.002, 1e-8);
    kn_vertex_match_free(&m);
}

TEST("different meshes are compared by nearest vertices: equal shapes differ by under 0.4 mm, a bend by its depth")
{
    kn_vertex_match m;
    AT_END(kn_object_still_free)
    kn_object_still coarse = sheet(21, 0, 0.002f), fine = sheet(44, 0, 0.002f), flat = sheet(44, 0, 0);
    CHECK(most(&coarse, &fine, &m) < 0.0004);
    CHECK(!m.same && m.apart_m < 0.0005 && m.apart_m > 0);
    CHECK(kn_vertex_match_fits(&m, &coarse, &flat) && !kn_vertex_match_fits(&m, &coarse, &coarse));
    kn_vertex_match_free(&m);
    CHECK_NEAR(most(&coarse, &flat, &m), 0.002, 1e-5);
    kn_vertex_match_free(&m);
}

TEST("each vertex is matched to the nearest vertex at rest")
{
    AT_END(kn_vertex_match_free) kn_vertex_match m = {0};
    char error[300];
    AT_END(kn_object_still_free) kn_object_still a = sheet(17, 0, 0), b = sheet(23, 0.0003f, 0);
    CHECK(kn_vertex_match_make(&m, &a, &b, error, sizeof error));
    for (int v = 0; v < m.count; v++) {
        float least = INFINITY;
        for (int u = 0; u < a.vertex_count; u++)
            least = fminf(least, hypotf(a.rest[u][0] - b.rest[v][0], a.rest[u][1] - b.rest[v][1]));
        const int u = m.first[v];
        CHECK_NEAR(hypotf(a.rest[u][0] - b.rest[v][0], a.rest[u][1] - b.rest[v][1]), least, 1e-9);
    }
}

TESTS_MAIN
