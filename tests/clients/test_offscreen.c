// The sources of OpenGL: every available source draws the same picture.
#include "clients/viewer/offscreen.h"
#include "tests/clients/pictured.h"
#include <dlfcn.h>

static kn_view_scene pressed(void)
{
    kn_view_scene scene = kn_view_scene_default();
    scene.probe_count = 1;
    scene.probe[0] = (kn_view_probe){
        .def = {.shape = KN_PROBE_SPHERE, .radius_m = 0.006}, .position_m = {0, 0, 0.027}, .force_n = {0, 0, 6}};
    return scene;
}

// Draw by this source. Return NULL and the reason in `error` if the source is not available.
static uint8_t *drawn_by(const char *way, const block *b, char *error, size_t error_size)
{
    setenv("KNEAD_GL", way, 1);
    OWN(kn_renderer) *r = kn_renderer_open(WIDTH, HEIGHT, 4, error, error_size);
    unsetenv("KNEAD_GL");
    if (!r) return NULL;
    CHECK(kn_renderer_mesh(r, b->surface->vertex_count, (const float(*)[3])b->rest, b->surface->triangle_count,
                           triangles(b)));
    uint8_t *rgba = draw(r, pressed(), b->dented), *again = draw(r, pressed(), b->dented);
    CHECK(memcmp(rgba, again, PIXELS * 4) == 0);
    free(again);
    return rgba;
}

TEST("an unknown value of KNEAD_GL is refused with the valid ones")
{
    char error[300];
    setenv("KNEAD_GL", "vulkan", 1);
    CHECK(kn_offscreen_open(64, 64, 1, error, sizeof error) == NULL);
    CHECK_STR(error, "KNEAD_GL=vulkan: expected osmesa or egl");
    unsetenv("KNEAD_GL");
}

TEST("OSMesa and EGL draw the same picture, each from its own library, and OSMesa again after EGL")
{
    char error[300] = "";
    AT_END(block_destroy) block b = block_create();
    uint8_t *osmesa = drawn_by("osmesa", &b, error, sizeof error);
    if (!osmesa) SKIP("%s", error);
    CHECK(dlopen("libOSMesa.so.8", RTLD_NOW | RTLD_NOLOAD) != NULL);
    CHECK(dlopen("libEGL.so.1", RTLD_NOW | RTLD_NOLOAD) == NULL);
    uint8_t *egl = drawn_by("egl", &b, error, sizeof error);
    if (!egl) SKIP("%s", error);
    CHECK(dlopen("libEGL.so.1", RTLD_NOW | RTLD_NOLOAD) != NULL);
    long sum = 0;
    for (int i = 0; i < PIXELS * 4; i++) sum += labs((long)osmesa[i] - egl[i]);
    CHECK((double)sum / (PIXELS * 4) < 0.2); // 0 if both come from one Mesa
    CHECK(changed(osmesa, egl, 0, 0, WIDTH, HEIGHT) < PIXELS / 500);
    CHECK(count(egl, is_dough) > PIXELS / 20 && count(egl, is_arrow) > 50);
    uint8_t *back = drawn_by("osmesa", &b, error, sizeof error);
    CHECK(back && memcmp(osmesa, back, PIXELS * 4) == 0);
    free(osmesa), free(egl), free(back);
}

TESTS_MAIN
