// Tools of a flat object are drawn as wide as the object is thick.
#include "tests/clients/pictured.h"

// Count the pixels of a tool far above the block and at the same distance from the camera, in a level view from an
// azimuth.
static int shown(kn_renderer *r, const block *b, kn_probe_def def, double thickness_m, double azimuth_deg)
{
    kn_view_scene scene = kn_view_scene_default();
    scene.azimuth_deg = azimuth_deg;
    scene.elevation_deg = 0;
    scene.thickness_m = thickness_m;
    scene.probe_count = 1;
    scene.probe[0] = (kn_view_probe){.def = def, .position_m = {0, 0, 0.04}};
    uint8_t *picture = draw(r, scene, b->rest);
    int n = 0;
    for (int i = 0; i < PIXELS / 2; i++) n += is_tool(picture + 4 * i); // the upper half of the picture
    free(picture);
    return n;
}

TEST("a ball is drawn on a flat object as a disc of the object's thickness, and on a block as a ball")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    const kn_probe_def ball = {.shape = KN_PROBE_SPHERE, .radius_m = 0.004};
    const double from_front = shown(r, &b, ball, 0, 0), from_right = shown(r, &b, ball, 0, 90);
    CHECK_NEAR(from_right, from_front, 0.03 * from_front);
    // The front view of a disc is a circle, and the side view is 2 r by its width: 8 mm by 2 mm over pi (4 mm)^2.
    CHECK_NEAR(shown(r, &b, ball, 0.002, 0), from_front, 0.05 * from_front);
    CHECK_NEAR(shown(r, &b, ball, 0.002, 90), from_front * 0.008 * 0.002 / (M_PI * 0.004 * 0.004), 0.05 * from_front);
}

TEST("a plate on a flat object is drawn as wide as the object is thick")
{
    AT_END(block_destroy) block b = block_create();
    OWN(kn_renderer) *r = open_renderer(&b);
    const kn_probe_def plate = {.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.03}};
    const double wide = shown(r, &b, plate, 0, 90);
    CHECK_NEAR(shown(r, &b, plate, 0.01, 90), wide / 3, 0.05 * wide);
}

TESTS_MAIN
