#include "core/surface.h"
#include "tests/check.h"

static kn_model *block(int nx, int ny, int nz)
{
    kn_model_def def = kn_model_def_default();
    def.probe_count = 0;
    def.nodes[0] = nx, def.nodes[1] = ny, def.nodes[2] = nz;
    if (ny == 1) def.thickness_m = 0.02;
    def.spacing_m = 0.01;
    return build(&def);
}

// Check that each side of a triangle occurs once in the other direction.
static void check_closed(const kn_surface *s)
{
    int *way = calloc((size_t)(s->vertex_count * s->vertex_count), sizeof *way);
    for (int t = 0; t < s->triangle_count; t++)
        for (int k = 0; k < 3; k++) way[s->triangle[3 * t + k] * s->vertex_count + s->triangle[3 * t + (k + 1) % 3]]++;
    for (int i = 0; i < s->vertex_count; i++)
        for (int j = 0; j < s->vertex_count; j++) {
            int here = way[i * s->vertex_count + j];
            CHECK(here <= 1 && here == way[j * s->vertex_count + i]);
        }
    free(way);
}

static double enclosed(const kn_surface *s, const kn_model *model, const kn_state *state)
{
    float *x = malloc((size_t)s->vertex_count * 3 * sizeof *x);
    kn_surface_positions(s, model, state, x);
    double volume = 0;
    for (int t = 0; t < s->triangle_count; t++) {
        const float *a = x + 3 * s->triangle[3 * t], *b = x + 3 * s->triangle[3 * t + 1],
                    *c = x + 3 * s->triangle[3 * t + 2];
        double det = 0;
        for (int k = 0; k < 3; k++) {
            int m = (k + 1) % 3, n = (k + 2) % 3;
            det += (double)a[k] * ((double)b[m] * (double)c[n] - (double)b[n] * (double)c[m]);
        }
        volume += det / 6;
    }
    free(x);
    return volume;
}

TEST("the skin has every outer node once and is closed: each side of a triangle occurs once in the other direction")
{
    OWN(kn_model) *model = block(6, 5, 4);
    OWN(kn_surface) *s = kn_surface_create(model);
    CHECK(s->vertex_count == 6 * 5 * 4 - 4 * 3 * 2);
    CHECK(s->triangle_count == 2 * 2 * (5 * 4 + 5 * 3 + 4 * 3));
    CHECK(s->vertex_count - 3 * s->triangle_count / 2 + s->triangle_count == 2); // Euler's formula
    check_closed(s);
}

TEST("triangles turn counter-clockwise seen from outside and enclose the volume of the block")
{
    OWN(kn_model) *model = block(6, 5, 4);
    OWN(kn_state) *state = kn_state_create(model);
    OWN(kn_surface) *s = kn_surface_create(model);
    CHECK_NEAR(enclosed(s, model, state), 0.05 * 0.04 * 0.03, 1e-10);
}

TEST("the skin of a flat block is closed and as thick as the block, with a vertex before and behind every node")
{
    OWN(kn_model) *model = block(6, 1, 4);
    OWN(kn_state) *state = kn_state_create(model);
    OWN(kn_surface) *s = kn_surface_create(model);
    CHECK(s->vertex_count == 2 * 6 * 4);
    check_closed(s);
    CHECK_NEAR(enclosed(s, model, state), 0.05 * 0.02 * 0.03, 1e-10);
    int behind = 0;
    for (int v = 0; v < s->vertex_count; v++) {
        double x[3];
        kn_surface_rest(s, model, v, x);
        CHECK_NEAR(x[0], model->rest_m[s->node[v]][0], 0);
        CHECK_NEAR(fabs(x[1]), 0.01, 1e-15);
        behind += x[1] > 0;
    }
    CHECK(behind == 6 * 4);
}

TEST("the vertices of the skin lie at the positions of their nodes")
{
    OWN(kn_model) *model = block(3, 3, 3);
    OWN(kn_state) *state = kn_state_create(model);
    OWN(kn_surface) *s = kn_surface_create(model);
    float x[3 * 27];
    CHECK(s->vertex_count == 26);
    kn_surface_positions(s, model, state, x);
    for (int i = 0; i < s->vertex_count; i++) {
        double rest[3];
        kn_grid_rest(&model->grid, s->node[i], rest);
        for (int k = 0; k < 3; k++) CHECK_NEAR(x[3 * i + k], rest[k], 1e-8);
    }
}

TESTS_MAIN
