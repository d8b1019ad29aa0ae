// The outline of a hand that is away from its tool, and tools of a flat object, drawn as wide as the object is thick.
#include "tests/clients/pictured.h"

static bool is_outline(const uint8_t *p) { return p[2] > p[0] + 50; } // blue

// Show a ball that rests on the block, and its hand.
static void hold(double hand_x_m, double hand_z_m)
{
    scene.hands = true;
    scene.azimuth_deg = scene.elevation_deg = 0;
    show_tool((kn_view_probe){.def = {.shape = KN_PROBE_SPHERE, .radius_m = 0.005},
                              .position_m = {0, 0, 0.035},
                              .held = true,
                              .hand_position_m = {hand_x_m, 0, hand_z_m}});
}

TEST("a hand away from its tool is outlined through the object, and a hand at its tool is not outlined")
{
    for (int samples = 1; samples <= 4; samples += 3) {
        begin_view();
        OWN(kn_renderer) *r = open_with(samples);
        hold(0, 0.02);
        const uint8_t *through = draw_by(r, rest);
        hold(0, 0.035);
        const uint8_t *at_it = draw_by(r, rest); // no outline is left from the picture before
        scene.hands = false;
        const uint8_t *none = draw_by(r, rest);
        CHECK(equal(at_it, none) && count(none, is_outline) == 0);
        // A ring of 1 cm across on a block of 5 cm, visible through the dough. The ring is as long as the circle and
        // some pixels wide.
        int left = WIDTH, right = 0, ring = 0, within = 0;
        for (int i = 0; i < PIXELS; i++) {
            if (!is_outline(through + 4 * i)) continue;
            ring++;
            left = i % WIDTH < left ? i % WIDTH : left;
            right = i % WIDTH > right ? i % WIDTH : right;
        }
        const int across = right - left, middle = (left + right) / 2;
        for (int y = HEIGHT / 2 - 1; y <= HEIGHT / 2 + 1; y++)
            for (int x = middle - across / 4; x < middle + across / 4; x++)
                within += is_outline(through + 4 * (y * WIDTH + x));
        CHECK(across > 50 && across < 100);
        CHECK(ring > 2 * across && ring < 12 * across);
        CHECK(within == 0);
        CHECK(abs(middle - WIDTH / 2) <= 1);
    }
}

TEST("a turned hand is outlined, and a hand at a NaN position is not")
{
    begin_view();
    hold(NAN, 0.02);
    CHECK(count(draw(rest), is_outline) == 0);
    hold(0, 0.035);
    scene.probe[0].def = (kn_probe_def){.shape = KN_PROBE_BOX, .size_m = {0.01, 0.004, 0.01}};
    CHECK(count(draw(rest), is_outline) == 0);
    const double half = 0.5 * 10 * M_PI / 180;
    memcpy(scene.probe[0].hand_orientation_wxyz, (double[]){cos(half), 0, sin(half), 0}, 4 * sizeof(double));
    CHECK(count(draw(rest), is_outline) > 50);
}

// Count the pixels of a tool far above the block and at the same distance from the camera, in a level view from an
// azimuth.
static int shown(kn_probe_def def, double thickness_m, double azimuth_deg)
{
    int n = 0;
    scene.azimuth_deg = azimuth_deg;
    scene.elevation_deg = 0;
    scene.thickness_m = thickness_m;
    show_tool((kn_view_probe){.def = def, .position_m = {0, 0, 0.04}});
    const uint8_t *picture = draw(rest);
    for (int i = 0; i < PIXELS / 2; i++) n += is_tool(picture + 4 * i); // the upper half of the picture
    return n;
}

TEST("a ball is drawn on a flat object as a disc of the object's thickness, and on a block as a ball; a plate is drawn "
     "as wide as a flat object is thick")
{
    begin_view();
    const kn_probe_def ball = {.shape = KN_PROBE_SPHERE, .radius_m = 0.004},
                       plate = {.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.03}};
    const double from_front = shown(ball, 0, 0), wide = shown(plate, 0, 90);
    CHECK_NEAR(shown(ball, 0, 90), from_front, 0.03 * from_front);
    // The front view of a disc is a circle, and the side view is 2 r by its width: 8 mm by 2 mm over pi (4 mm)^2.
    CHECK_NEAR(shown(ball, 0.002, 0), from_front, 0.05 * from_front);
    CHECK_NEAR(shown(ball, 0.002, 90), from_front * 0.008 * 0.002 / (M_PI * 0.004 * 0.004), 0.05 * from_front);
    CHECK_NEAR(shown(plate, 0.01, 90), wide / 3, 0.05 * wide);
}

TESTS_MAIN
