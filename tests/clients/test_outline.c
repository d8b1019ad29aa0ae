// The outline of a hand that is away from its tool.
#include "tests/clients/pictured.h"

static bool is_outline(const uint8_t *p) { return p[2] > p[0] + 50; } // blue

// A ball that rests on the block, and its hand.
static kn_view_scene held(double hand_x_m, double hand_z_m)
{
    kn_view_scene scene = kn_view_scene_default();
    scene.hands = true;
    scene.azimuth_deg = scene.elevation_deg = 0;
    scene.probe_count = 1;
    scene.probe[0] = (kn_view_probe){.def = {.shape = KN_PROBE_SPHERE, .radius_m = 0.005},
                                     .position_m = {0, 0, 0.035},
                                     .held = true,
                                     .hand_position_m = {hand_x_m, 0, hand_z_m}};
    return scene;
}

static void check_outline(int samples)
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_with(&b, samples);
    kn_view_scene with = held(0, 0.035), without = with, inside = held(0, 0.02);
    without.hands = false;
    uint8_t *at_it = draw(r, with, b.rest), *none = draw(r, without, b.rest), *through = draw(r, inside, b.rest);
    CHECK(memcmp(at_it, none, PIXELS * 4) == 0);
    CHECK(count(none, is_outline) == 0);
    // A ring of 1 cm across on a block of 5 cm, visible through the dough. The ring is as long as the circle and some
    // pixels wide.
    int left = WIDTH, right = 0, ring = 0, within = 0;
    for (int i = 0; i < PIXELS; i++) {
        if (!is_outline(through + 4 * i)) continue;
        ring++;
        left = i % WIDTH < left ? i % WIDTH : left;
        right = i % WIDTH > right ? i % WIDTH : right;
    }
    const int across = right - left, middle = (left + right) / 2;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = middle - across / 4; x < middle + across / 4; x++)
            within += is_outline(through + 4 * (y * WIDTH + x)) && changed(through, none, x, y, x + 1, y + 1) > 0 &&
                      abs(y - HEIGHT / 2) < 2;
    CHECK(across > 50 && across < 100);
    CHECK(ring > 2 * across && ring < 12 * across);
    CHECK(within == 0);
    CHECK(abs(middle - WIDTH / 2) <= 1);
    uint8_t *again = draw(r, with, b.rest);
    CHECK(memcmp(at_it, again, PIXELS * 4) == 0); // no outline is left from the picture before
    free(at_it), free(none), free(through), free(again);
}

TEST("a hand away from its tool is outlined through the object, and a hand at its tool is not outlined")
{
    check_outline(4);
    check_outline(1);
}

TEST("a turned hand is outlined, and a hand at a NaN position is not")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    kn_view_scene scene = held(0, 0.035), nowhere = held(NAN, 0.02);
    scene.probe[0].def = (kn_probe_def){.shape = KN_PROBE_BOX, .size_m = {0.01, 0.004, 0.01}};
    uint8_t *level = draw(r, scene, b.rest), *none = draw(r, nowhere, b.rest);
    const double half = 0.5 * 10 * M_PI / 180;
    memcpy(scene.probe[0].hand_orientation_wxyz, (double[]){cos(half), 0, sin(half), 0}, 4 * sizeof(double));
    uint8_t *turned = draw(r, scene, b.rest);
    CHECK(count(level, is_outline) == 0 && count(none, is_outline) == 0);
    CHECK(count(turned, is_outline) > 50);
    free(level), free(none), free(turned);
}

TESTS_MAIN
