// Compare pictures with reference pictures, tests/clients/pictures/NAME.png, 176 x 99, which were inspected by eye.
// Another Mesa may draw other pixels along an outline. Missing, mirrored or wrongly coloured parts are detected, as
// the mutations below prove.
//
//     KN_PICTURES=write tests/one clients.pictures       draws the references anew: look at them
//
// A pixel is wrong if the other picture has no similar pixel within one pixel of the place. Two pictures are equal if
// fewer than WRONG_SHARE of the pixels are wrong, in either direction, and if their blurred copies differ by less
// than APART on average.
#include "clients/viewer/image.h"
#include "tests/clients/pictured.h"
#include <png.h>

enum { W = 176, H = 99, LIKE = 24 }; // LIKE: largest difference of similar pixels in each channel, of 255
#define WRONG_SHARE 0.001
#define APART 1.0

typedef struct look { // parameters of a picture; a mutation changes one of them
    const char *name;
    int tool; // kn_probe_shape, or NO_TOOL
    double force_n, azimuth_deg, elevation_deg, zoom, hand_z_m;
    kn_view_style style;
    bool dented, colored, clay;
    float top;
} look;

enum { NO_TOOL = 99 };

static const look looks[] = {
    {"press", KN_PROBE_PLATE, 8, 28, 27, 1, 0, KN_VIEW_LINED, true, false, false, 1},
    {"ball", KN_PROBE_SPHERE, 7, -40, 20, 1, 0.02, KN_VIEW_SOLID, true, false, true, 1},
    {"values", NO_TOOL, 0, 118, 50, 1, 0, KN_VIEW_SOLID, true, true, false, 1},
    {"wire", NO_TOOL, 0, 28, 27, 1, 0, KN_VIEW_WIRE, true, true, false, 1},
    {"near", KN_PROBE_CAPSULE, 0, 0, 8, 1.5, 0, KN_VIEW_SOLID, false, false, false, 1},
};
enum { LOOKS = sizeof looks / sizeof *looks };

static kn_renderer *renderer;
static const kn_probe_def tools[] = {
    [KN_PROBE_PLATE] = {.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.06}},
    [KN_PROBE_SPHERE] = {.shape = KN_PROBE_SPHERE, .radius_m = 0.007},
    [KN_PROBE_CAPSULE] = {.shape = KN_PROBE_CAPSULE, .radius_m = 0.004, .length_m = 0.01},
};

static const uint8_t *drawn(const look *l)
{
    static float value[1000];
    static uint8_t rgba[W * H * 4];
    begin_block();
    if (!renderer) renderer = open_sized(W, H, 4);
    scene = kn_view_scene_default();
    if (l->clay) memcpy(scene.color, (float[]){0.74f, 0.47f, 0.36f}, sizeof scene.color);
    for (int v = 0; v < surface->vertex_count; v++) value[v] = (rest[v][2] - dented[v][2]) / 0.01f / l->top;
    scene.azimuth_deg = l->azimuth_deg;
    scene.elevation_deg = l->elevation_deg;
    scene.zoom = l->zoom;
    scene.style = l->style;
    scene.hands = true;
    scene.xyz = l->dented ? dented : rest;
    if (l->colored) scene.value = value;
    if (l->tool != NO_TOOL)
        show_tool((kn_view_probe){.def = tools[l->tool],
                                  .position_m = {0, 0, l->tool == KN_PROBE_PLATE ? 0.02 : 0.034},
                                  .force_n = {0, 0, l->force_n},
                                  .held = l->hand_z_m > 0,
                                  .hand_position_m = {0, 0, l->hand_z_m}});
    kn_renderer_draw(renderer, &scene, rgba);
    return rgba;
}

static bool like(const uint8_t *a, const uint8_t *b, int x, int y) // a's pixel, and any of b's pixels around it
{
    for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < H; v++)
        for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < W; u++) {
            const uint8_t *p = a + 4 * (y * W + x), *q = b + 4 * (v * W + u);
            if (abs(p[0] - q[0]) <= LIKE && abs(p[1] - q[1]) <= LIKE && abs(p[2] - q[2]) <= LIKE) return true;
        }
    return false;
}

static double wrong_share(const uint8_t *a, const uint8_t *b)
{
    int wrong = 0;
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) wrong += !like(a, b, x, y) || !like(b, a, x, y);
    return (double)wrong / (W * H);
}

static double apart(const uint8_t *a, const uint8_t *b) // mean difference of squares of 5 x 5 pixels
{
    double sum = 0;
    for (int y = 0; y + 5 <= H; y += 5)
        for (int x = 0; x + 5 <= W; x += 5)
            for (int k = 0; k < 3; k++) {
                double d = 0;
                for (int i = 0; i < 25; i++) {
                    const int at = 4 * ((y + i / 5) * W + x + i % 5) + k;
                    d += a[at] - b[at];
                }
                sum += fabs(d / 25);
            }
    return sum / (H / 5 * (W / 5) * 3);
}

static bool same(const uint8_t *a, const uint8_t *b) { return wrong_share(a, b) < WRONG_SHARE && apart(a, b) < APART; }

static const char *path_of(const look *l)
{
    static char path[1000];
    snprintf(path, sizeof path, KN_SOURCE_DIR "/tests/clients/pictures/%s.png", l->name);
    return path;
}

static const uint8_t *reference(const look *l)
{
    static uint8_t rgba[W * H * 4];
    AT_END(png_image_free) png_image image = {.version = PNG_IMAGE_VERSION};
    bool good = png_image_begin_read_from_file(&image, path_of(l)) && image.width == W && image.height == H;
    image.format = PNG_FORMAT_RGBA;
    if (!good || !png_image_finish_read(&image, NULL, rgba, 0, NULL)) KN_TEST_FAIL("%s: %s", path_of(l), image.message);
    return rgba;
}

TEST("pictures match the reference pictures that were inspected by eye")
{
    const char *write = getenv("KN_PICTURES");
    for (int i = 0; i < LOOKS; i++) {
        char error[300];
        const uint8_t *now = drawn(&looks[i]);
        if (write && strcmp(write, "write") == 0)
            CHECK(kn_image_write_png(path_of(&looks[i]), W, H, now, error, sizeof error));
        const uint8_t *was = reference(&looks[i]);
        if (!same(was, now))
            KN_TEST_FAIL("%s: %.2f %% of the pixels are wrong, %.2f apart", looks[i].name, 100 * wrong_share(was, now),
                         apart(was, now));
    }
}

static void differs(const look *l, const look *mutated, const char *what)
{
    const uint8_t *was = reference(l), *now = drawn(mutated);
    if (same(was, now))
        KN_TEST_FAIL("%s %s: is not told, %.3f %% of the pixels are wrong, %.2f apart", l->name, what,
                     100 * wrong_share(was, now), apart(was, now));
}

TEST("the comparison detects a missing arrow, tool, hand or dent, a mirrored view, and other colours or styles")
{
    for (int i = 0; i < LOOKS; i++) {
        const look *l = &looks[i];
        look m = *l;
        if (l->force_n > 0) m.force_n = 0, differs(l, &m, "without an arrow");
        m = *l;
        if (l->tool != NO_TOOL) m.tool = NO_TOOL, differs(l, &m, "without a tool");
        m = *l;
        if (l->hand_z_m > 0) m.hand_z_m = 0, differs(l, &m, "without the hand's outline");
        m = *l, m.dented = !l->dented, differs(l, &m, "with another shape");
        m = *l, m.azimuth_deg = l->azimuth_deg != 0 ? -l->azimuth_deg : 4, differs(l, &m, "mirrored");
        m = *l, m.elevation_deg += 2, differs(l, &m, "from higher up");
        m = *l, m.zoom *= 1.05, differs(l, &m, "from nearer");
        m = *l, m.clay = !l->clay;
        if (!l->colored) differs(l, &m, "of another material");
        m = *l, m.style = l->style == KN_VIEW_SOLID ? KN_VIEW_LINED : KN_VIEW_SOLID, differs(l, &m, "in another style");
        m = *l, m.top = 1.5f;
        if (l->colored) differs(l, &m, "on another scale");
        m = *l, m.colored = !l->colored, differs(l, &m, "with or without colours");
    }
}

TESTS_MAIN
