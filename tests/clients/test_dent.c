// Heights of an object from its mesh.
#include "clients/knead/dent.h"
#include "core/surface.h"
#include "tests/check.h"

// The default block, its mesh at rest or with the middle of its top pushed down.
static kn_model *model;
static kn_mesh mesh;
static uint8_t *top;

static void make(double push_m)
{
    char error[256];
    kn_model_def def = kn_model_def_default();
    int vertices = 0;
    model = kn_model_build(&def, error, sizeof error);
    kn_state *state = kn_state_create(model);
    kn_surface *surface = kn_surface_create(model);
    mesh = (kn_mesh){.vertex_count = surface->vertex_count, .triangle_count = surface->triangle_count, .whole = true};
    mesh.triangles = malloc(sizeof(int32_t) * 3 * (size_t)surface->triangle_count);
    mesh.positions_m = malloc(sizeof(float) * 3 * (size_t)surface->vertex_count);
    for (int i = 0; i < 3 * surface->triangle_count; i++) mesh.triangles[i] = surface->triangle[i];
    kn_surface_positions(surface, model, state, mesh.positions_m);
    top = kn_dent_top(&def, &vertices);
    CHECK(vertices == surface->vertex_count);
    for (int v = 0; v < vertices; v++) {
        float *at = mesh.positions_m + 3 * v;
        if (top[v] && fabsf(at[0]) < 0.006f && fabsf(at[1]) < 0.006f) at[2] -= (float)push_m;
    }
    kn_surface_destroy(surface);
    kn_state_destroy(state);
}

static void forget(void)
{
    kn_model_destroy(model);
    kn_mesh_free(&mesh);
    free(top);
}

TEST("the top face is the vertices at the block's height, 6 x 6 of the default block")
{
    make(0);
    int count = 0;
    for (int v = 0; v < mesh.vertex_count; v++) {
        count += top[v];
        CHECK(top[v] == (fabsf(mesh.positions_m[3 * v + 2] - 0.03f) < 1e-6f));
    }
    CHECK(count == 36);
    forget();
}

TEST("a block at rest is as high as it is, and nothing stands beside it")
{
    double z;
    make(0);
    CHECK(kn_dent_height(&mesh, 0, 0, &z));
    CHECK_NEAR(z, 0.03, 1e-8);
    CHECK(kn_dent_height(&mesh, -0.0249, 0.0173, &z));
    CHECK_NEAR(z, 0.03, 1e-8);
    CHECK(!kn_dent_height(&mesh, 0.03, 0, &z));
    mesh.whole = false;
    CHECK(!kn_dent_height(&mesh, 0, 0, &z));
    forget();
}

TEST("the bottom of a dent is found, and half of it half way up its side")
{
    double z;
    make(0.008);
    CHECK(kn_dent_height(&mesh, 0, 0, &z));
    CHECK_NEAR(z, 0.022, 1e-8);
    CHECK(kn_dent_height(&mesh, 0.01, 0, &z));
    CHECK_NEAR(z, 0.026, 1e-8);
    forget();
}

TEST("a plate in a dent touches the lowest it covers last and the highest first")
{
    double first, last;
    kn_probe_def narrow = {.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.01}};
    kn_probe_def wide = {.shape = KN_PROBE_PLATE, .size_m = {0.03, 0.01}};
    kn_probe_def away = {.shape = KN_PROBE_PLATE, .size_m = {0.002, 0.002}};
    make(0.008);
    CHECK(kn_dent_touch(&mesh, top, 0.01, &narrow, 0, 0, &first, &last));
    CHECK_NEAR(first, 0.022, 1e-8);
    CHECK_NEAR(last, 0.022, 1e-8);
    CHECK(kn_dent_touch(&mesh, top, 0.01, &wide, 0, 0, &first, &last));
    CHECK_NEAR(first, 0.03, 1e-8);
    CHECK_NEAR(last, 0.022, 1e-8);
    CHECK(!kn_dent_touch(&mesh, top, 0.01, &away, 0, 0, &first, &last)); // between the nodes
    forget();
}

TEST("a plate looks at the top alone: a vertex of a side that stands higher is not touched")
{
    double first, last;
    kn_probe_def plate = {.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.06}};
    make(0);
    for (int v = 0; v < mesh.vertex_count; v++)
        if (!top[v]) mesh.positions_m[3 * v + 2] = 0.04f;
    CHECK(kn_dent_touch(&mesh, top, 0.01, &plate, 0, 0, &first, &last));
    CHECK_NEAR(first, 0.03, 1e-8);
    forget();
}

TEST("a sphere over a dent rests on its rim")
{
    double first, last, r = 0.02;
    kn_probe_def ball = {.shape = KN_PROBE_SPHERE, .radius_m = r};
    make(0);
    CHECK(kn_dent_touch(&mesh, top, 0.01, &ball, 0.005, 0.005, &first, &last));
    CHECK_NEAR(first, 0.03 + r, 1e-8);
    forget();
    make(0.015);
    CHECK(kn_dent_touch(&mesh, top, 0.01, &ball, 0, 0, &first, &last));
    double rim = 0.03 + sqrt(r * r - 0.015 * 0.015 - 0.005 * 0.005);
    CHECK_NEAR(first, rim, 1e-6);
    forget();
}

TESTS_MAIN
