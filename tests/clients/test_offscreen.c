// The sources of OpenGL: every available source draws the same picture.
#include "tests/clients/pictured.h"
#include <dlfcn.h>

// Draw by this source. Skip the test if the source is not available.
static const uint8_t *drawn_by(const char *way)
{
    setenv("KNEAD_GL", way, 1);
    OWN(kn_renderer) *r = open_with(4);
    unsetenv("KNEAD_GL");
    const uint8_t *picture = draw_by(r, dented);
    CHECK(equal(picture, draw_by(r, dented)));
    return picture;
}

TEST("OSMesa and EGL draw the same picture, each from its own library, and OSMesa again after EGL")
{
    begin_block();
    scene = kn_view_scene_default();
    show_tool((kn_view_probe){
        .def = {.shape = KN_PROBE_SPHERE, .radius_m = 0.006}, .position_m = {0, 0, 0.027}, .force_n = {0, 0, 6}});
    const uint8_t *osmesa = drawn_by("osmesa");
    CHECK(dlopen("libOSMesa.so.8", RTLD_NOW | RTLD_NOLOAD) != NULL);
    CHECK(dlopen("libEGL.so.1", RTLD_NOW | RTLD_NOLOAD) == NULL);
    const uint8_t *egl = drawn_by("egl");
    CHECK(dlopen("libEGL.so.1", RTLD_NOW | RTLD_NOLOAD) != NULL);
    long sum = 0;
    for (int i = 0; i < PIXELS * 4; i++) sum += labs((long)osmesa[i] - egl[i]);
    CHECK((double)sum / (PIXELS * 4) < 0.2); // 0 if both come from one Mesa
    CHECK(changed(osmesa, egl) < PIXELS / 500);
    CHECK(count(egl, is_dough) > PIXELS / 20 && count(egl, is_arrow) > 50);
    CHECK(equal(osmesa, drawn_by("osmesa")));
}

TESTS_MAIN
