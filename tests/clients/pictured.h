#ifndef KN_TESTS_CLIENTS_PICTURED_H
#define KN_TESTS_CLIENTS_PICTURED_H
// A block for tests of pictures: 5 x 5 x 3 cm in cells of 5 mm, at rest and with a dent of 1 cm across its top.
// Further functions recognise dough, arrows and tools in a picture by their colours.
#include "clients/viewer/renderer.h"
#include "core/surface.h"
#include "tests/check.h"

enum { WIDTH = 640, HEIGHT = 360, PIXELS = WIDTH * HEIGHT };

OWNS(kn_renderer, kn_renderer_close)

typedef struct block {
    kn_surface *surface;
    float (*rest)[3], (*dented)[3];
} block;

static inline const int (*triangles(const block *b))[3] { return (const int(*)[3])b->surface->triangle; }

static inline block block_create(void)
{
    kn_model_def def = kn_model_def_default();
    memcpy(def.nodes, (int[]){11, 11, 7}, sizeof def.nodes);
    def.spacing_m = 0.005;
    OWN(kn_model) *model = build(&def);
    block b = {.surface = kn_surface_create(model)};
    size_t n = (size_t)b.surface->vertex_count;
    b.rest = calloc(n, sizeof *b.rest);
    b.dented = calloc(n, sizeof *b.dented);
    for (size_t i = 0; i < n; i++) {
        double x_m[3];
        kn_grid_rest(&model->grid, b.surface->node[i], x_m);
        double height = x_m[2] / 0.03, beside = fmax(0, fabs(x_m[0]) - 0.005);
        for (int k = 0; k < 3; k++) b.rest[i][k] = b.dented[i][k] = (float)x_m[k];
        b.dented[i][2] -= (float)(0.01 * height * height * exp(-beside / 0.003));
    }
    return b;
}

static inline void block_destroy(block *b)
{
    kn_surface_destroy(b->surface);
    free(b->rest);
    free(b->dented);
}

// Return a renderer with the block's mesh. Skip the test if there is no OpenGL.
static inline kn_renderer *open_with(const block *b, int samples)
{
    char error[300];
    kn_renderer *r = kn_renderer_open(WIDTH, HEIGHT, samples, error, sizeof error);
    if (!r) SKIP("%s", error);
    const float(*rest)[3] = (const float(*)[3])b->rest;
    CHECK(kn_renderer_mesh(r, b->surface->vertex_count, rest, b->surface->triangle_count, triangles(b)));
    return r;
}

static inline kn_renderer *open_renderer(const block *b) { return open_with(b, 4); }

static inline uint8_t *draw(kn_renderer *r, kn_view_scene scene, float (*xyz)[3])
{
    uint8_t *rgba = malloc(PIXELS * 4);
    scene.xyz = (const float(*)[3])xyz;
    kn_renderer_draw(r, &scene, rgba);
    return rgba;
}

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
static inline int changed(const uint8_t *a, const uint8_t *b, int left, int top, int right, int bottom)
{
    int n = 0;
    for (int y = top; y < bottom; y++)
        for (int x = left; x < right; x++)
            for (int k = 0, i = 4 * (y * WIDTH + x); k < 3; k++)
                if (abs(a[i + k] - b[i + k]) > 8) {
                    n++;
                    break;
                }
    return n;
}

#endif
