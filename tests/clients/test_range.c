// Range images of a block of 5 x 5 x 3 cm in cells of 5 mm, at rest and with a dent of 1 cm across its top.
#include "clients/viewer/image.h"
#include "clients/viewer/range.h"
#include "tests/clients/heard.h"
#include "tests/clients/pictured.h"

enum { W = 320, H = 300 };

static uint16_t level[W * H];
static char error[300];

static double dent_m(double x_m) { return 0.01 * exp(-fmax(0, fabs(x_m) - 0.005) / 0.003); }

static kn_range draw_range(const float (*now)[3])
{
    begin_block();
    kn_range r = kn_range_frame(W, H, surface->vertex_count, rest, now);
    kn_range_draw(&r, now, surface->triangle_count, triangles, level);
    return r;
}

static double height_m(const kn_range *r, double x_m, double y_m) // -1: no surface there
{
    const int x = (int)lround((x_m - r->left_m) / r->pixel_m), y = (int)lround((r->top_m - y_m) / r->pixel_m);
    return level[y * W + x] > 0 ? (level[y * W + x] - 1) * r->step_m : -1;
}

TEST("a range image of a block shows its height over its whole footprint and nothing beside it")
{
    const kn_range r = draw_range(rest);
    int over = 0;
    for (int i = 0; i < W * H; i++) {
        if (level[i] == 0) continue;
        over++;
        if (fabs((level[i] - 1) * r.step_m - 0.03) > r.step_m) KN_TEST_FAIL("pixel %d stands at level %d", i, level[i]);
    }
    CHECK_NEAR(over * r.pixel_m * r.pixel_m, 0.05 * 0.05, 0.01 * 0.05 * 0.05);
    CHECK_NEAR(r.pixel_m, 0.0002, 1e-12);
    CHECK_NEAR(r.step_m, 1e-6, 1e-15);
    CHECK_NEAR(r.lowest_m, 0.03, r.step_m);
    CHECK_NEAR(r.highest_m, 0.03, r.step_m);
    CHECK(height_m(&r, 0.0255, 0) < 0 && height_m(&r, 0, -0.0255) < 0);
    CHECK(height_m(&r, 0.0245, 0.0245) > 0 && height_m(&r, -0.0245, -0.0245) > 0);
}

TEST("a range image of a dent has the depth of the mesh at its vertices and halfway between them")
{
    const kn_range r = draw_range(dented);
    for (int v = 0; v < surface->vertex_count; v++) {
        const float *x = rest[v];
        if (x[2] < 0.0299f || fabsf(x[0]) > 0.0249f || fabsf(x[1]) > 0.0249f) continue; // an outline may be a pixel off
        const double slope = fabs(dent_m(x[0] + 0.005) - dent_m(x[0] - 0.005)) / 0.005; // largest slope on either side
        CHECK_NEAR(height_m(&r, x[0], x[1]), dented[v][2], 0.5 * r.pixel_m * slope + r.step_m);
    }
    CHECK_NEAR(height_m(&r, 0, 0.011), 0.02, r.step_m);
    CHECK_NEAR(r.lowest_m, 0.02, r.step_m);
    const double half_m = 0.03 - 0.5 * (dent_m(0.01) + dent_m(0.015));
    CHECK_NEAR(height_m(&r, 0.0125, 0), half_m, 0.5 * r.pixel_m * 0.4 + r.step_m);
    CHECK_NEAR(height_m(&r, 0.0125, 0), height_m(&r, -0.0125, 0), 0.4 * r.pixel_m + r.step_m);
}

TEST("x points right and y up, the highest surface hides those below, and NaN positions are left out")
{
    const float now[7][3] = {{0, 0, 0.001f},     {0.01f, 0, 0.001f}, {0, 0.01f, 0.001f}, {0, 0, 0.002f},
                             {0.01f, 0, 0.002f}, {0, 0.01f, 0.002f}, {NAN, 0.05f, 0.1f}};
    const int triangle[3][3] = {{3, 4, 5}, {0, 1, 2}, {4, 5, 6}};
    kn_range r = kn_range_frame(100, 100, 6, now, now);
    kn_range_draw(&r, now, 3, triangle, level);
    CHECK(level[70 * 100 + 30] > 0 && level[30 * 100 + 70] == 0); // below left, above right
    // height above the lower triangle, which is the table
    CHECK_NEAR((level[70 * 100 + 30] - 1) * r.step_m, 0.001, r.step_m);
}

TEST("a range image is read back as written, and values given beside the file override the file's own")
{
    const kn_range_given none = {NAN, NAN, NAN, NAN}, other = {1e-4, NAN, NAN, -0.5};
    kn_range r = {.width = 7, .height = 5, .pixel_m = 2e-4, .left_m = -0.0006, .top_m = 4e-4, .step_m = 1e-6}, back;
    uint16_t *read = NULL;
    char bytes[2000];
    for (int i = 0; i < 35; i++) level[i] = (uint16_t)(i % 3 ? i * 1871 + 3 : 0);
    CHECK(kn_range_save("range.png", &r, "dough", level, error, sizeof error));
    const size_t size = kn_read("range.png", bytes, sizeof bytes);
    CHECK(memmem(bytes, size, "pHYs\0\0\x13\x88\0\0\x13\x88\1", 13) != NULL); // 5000 pixels per metre, for any program
    CHECK(kn_range_load("range.png", &none, &back, &read, error, sizeof error));
    CHECK(back.width == 7 && back.height == 5 && read && memcmp(level, read, 35 * sizeof *level) == 0);
    const double expected[] = {2e-4, -0.0006, 4e-4, 1e-6, 1e-6 * (34 * 1871 + 2), 1e-6 * (1871 + 2)};
    const double got[] = {back.pixel_m, back.left_m, back.top_m, back.step_m, back.highest_m, back.lowest_m};
    for (int i = 0; i < 6; i++) CHECK_NEAR(got[i], expected[i], i == 3 ? 1e-14 : 1e-12);
    free(read);
    CHECK(kn_range_load("range.png", &other, &back, &read, error, sizeof error));
    CHECK(back.step_m == 1e-4 && back.top_m == -0.5 && fabs(back.left_m + 0.0006) < 1e-12);
    free(read);
}

TESTS_MAIN
