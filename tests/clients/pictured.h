#ifndef KN_TESTS_CLIENTS_PICTURED_H
#define KN_TESTS_CLIENTS_PICTURED_H
// A block for tests of pictures: 5 x 5 x 3 cm in cells of 5 mm, at rest and with a dent of 1 cm across its top.
// Further functions recognise dough, arrows and tools in a picture by their colours.
#include "clients/viewer/renderer.h"
#include "core/surface.h"
#include "tests/check.h"

enum { WIDTH = 640, HEIGHT = 360, PIXELS = WIDTH * HEIGHT };

OWNS(kn_renderer, kn_renderer_close)

static kn_surface *surface;
static float rest[1000][3], dented[1000][3]; // positions of its vertices
static const int (*triangles)[3];
static kn_renderer *view;   // of that block, open from the first begin_view to the end of the program
static kn_view_scene scene; // what draw() shows

static inline void begin_block(void)
{
    kn_model_def def = kn_model_def_default();
    memcpy(def.nodes, (int[]){11, 11, 7}, sizeof def.nodes);
    def.spacing_m = 0.005;
    OWN(kn_model) *model = build(&def);
    if (!surface) surface = kn_surface_create(model);
    triangles = (const int(*)[3])surface->triangle;
    for (int i = 0; i < surface->vertex_count; i++) {
        double x_m[3];
        kn_grid_rest(&model->grid, surface->node[i], x_m);
        double height = x_m[2] / 0.03, beside = fmax(0, fabs(x_m[0]) - 0.005);
        for (int k = 0; k < 3; k++) rest[i][k] = dented[i][k] = (float)x_m[k];
        dented[i][2] -= (float)(0.01 * height * height * exp(-beside / 0.003));
    }
}

// Return a renderer with the block's mesh. Skip the test if there is no OpenGL.
static inline kn_renderer *open_sized(int width, int height, int samples)
{
    char error[300];
    kn_renderer *r = kn_renderer_open(width, height, samples, error, sizeof error);
    if (!r) SKIP("%s", error);
    CHECK(kn_renderer_mesh(r, surface->vertex_count, rest, surface->triangle_count, triangles));
    return r;
}
static inline kn_renderer *open_with(int samples) { return open_sized(WIDTH, HEIGHT, samples); }

// Begin a test with a new block, the default scene, and the open renderer.
static inline void begin_view(void)
{
    begin_block();
    scene = kn_view_scene_default();
    if (!view) view = open_with(4);
}

static inline void show_tool(kn_view_probe probe)
{
    scene.probe_count = 1;
    scene.probe[0] = probe;
}

// Draw the scene with the vertices at these positions. The picture stays until eight more are drawn.
static inline const uint8_t *draw_by(kn_renderer *r, const float (*xyz)[3])
{
    static uint8_t rgba[8][PIXELS * 4];
    static int next;
    uint8_t *picture = rgba[next++ % 8];
    scene.xyz = xyz;
    kn_renderer_draw(r, &scene, picture);
    return picture;
}
static inline const uint8_t *draw(const float (*xyz)[3]) { return draw_by(view, xyz); }

static inline bool equal(const uint8_t *one, const uint8_t *other) { return memcmp(one, other, PIXELS * 4) == 0; }

// The dough is warm in colour; the table and the tools are not.
static inline bool is_dough(const uint8_t *p) { return p[0] > p[2] + 25 && p[0] < p[2] + 120; }
static inline bool is_arrow(const uint8_t *p) { return p[0] > 2 * p[2] + 60 && p[0] > 2 * p[1]; }
static inline bool is_tool(const uint8_t *p) { return p[2] > p[0] + 7; } // bluish; the table is hardly so

static inline int count(const uint8_t *rgba, bool (*is)(const uint8_t *))
{
    int n = 0;
    for (int i = 0; i < PIXELS; i++) n += is(rgba + 4 * i);
    return n;
}

// Count the pixels inside the given rows and columns that differ visibly between two pictures.
static inline int changed_in(const uint8_t *one, const uint8_t *other, int left, int top, int right, int bottom)
{
    int n = 0;
    for (int y = top; y < bottom; y++)
        for (int x = left; x < right; x++) {
            const uint8_t *p = one + 4 * (y * WIDTH + x), *q = other + 4 * (y * WIDTH + x);
            n += abs(p[0] - q[0]) > 8 || abs(p[1] - q[1]) > 8 || abs(p[2] - q[2]) > 8;
        }
    return n;
}

static inline int changed(const uint8_t *one, const uint8_t *other)
{
    return changed_in(one, other, 0, 0, WIDTH, HEIGHT);
}

#endif
