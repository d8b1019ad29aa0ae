// The height of an object from its mesh, and the height of a tool above the object.
#include "clients/hand/tool_height.h"
#include "core/step.h"
#include "core/surface.h"
#include "tests/check.h"

// The default block. Its mesh is at rest, or the middle of the top is pushed down.
static kn_model *model;
static kn_mesh mesh;
static uint8_t *top;

static void make(double push_m)
{
    kn_model_def def = kn_model_def_default();
    int vertices = 0;
    model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    OWN(kn_surface) *surface = kn_surface_create(model);
    mesh = (kn_mesh){.vertex_count = surface->vertex_count, .triangle_count = surface->triangle_count, .whole = true};
    mesh.triangles = malloc(sizeof(int32_t) * 3 * (size_t)surface->triangle_count);
    mesh.positions_m = malloc(sizeof(float) * 3 * (size_t)surface->vertex_count);
    for (int i = 0; i < 3 * surface->triangle_count; i++) mesh.triangles[i] = surface->triangle[i];
    kn_surface_positions(surface, model, state, mesh.positions_m);
    top = kn_tool_height_top(&def, &vertices);
    CHECK(vertices == surface->vertex_count);
    for (int v = 0; v < vertices; v++) {
        float *at = mesh.positions_m + 3 * v;
        if (top[v] && fabsf(at[0]) < 0.006f && fabsf(at[1]) < 0.006f) at[2] -= (float)push_m;
    }
}

static void forget(void)
{
    kn_model_destroy(model);
    kn_mesh_free(&mesh);
    free(top);
}

TEST("the top face of the default block is its 6 x 6 vertices at the block's height")
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

TEST("the surface of a block at rest is at its height everywhere, and no surface is found beside it")
{
    double z;
    make(0);
    CHECK(kn_tool_height_object(&mesh, 0, 0, &z));
    CHECK_NEAR(z, 0.03, 1e-8);
    CHECK(kn_tool_height_object(&mesh, -0.0249, 0.0173, &z));
    CHECK_NEAR(z, 0.03, 1e-8);
    CHECK(!kn_tool_height_object(&mesh, 0.03, 0, &z));
    mesh.whole = false;
    CHECK(!kn_tool_height_object(&mesh, 0, 0, &z));
    forget();
}

TEST("the bottom of a dent has the full depth, and a point halfway up its side has half the depth")
{
    double z;
    make(0.008);
    CHECK(kn_tool_height_object(&mesh, 0, 0, &z));
    CHECK_NEAR(z, 0.022, 1e-8);
    CHECK(kn_tool_height_object(&mesh, 0.01, 0, &z));
    CHECK_NEAR(z, 0.026, 1e-8);
    forget();
}

TEST("a plate over a dent touches the highest covered vertex first and the lowest last")
{
    double first, last;
    kn_probe_def narrow = {.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.01}};
    kn_probe_def wide = {.shape = KN_PROBE_PLATE, .size_m = {0.03, 0.01}};
    kn_probe_def away = {.shape = KN_PROBE_PLATE, .size_m = {0.002, 0.002}};
    make(0.008);
    CHECK(kn_tool_height_touch(&mesh, top, 0.01, &narrow, 0, 0, &first, &last));
    CHECK_NEAR(first, 0.022, 1e-8);
    CHECK_NEAR(last, 0.022, 1e-8);
    CHECK(kn_tool_height_touch(&mesh, top, 0.01, &wide, 0, 0, &first, &last));
    CHECK_NEAR(first, 0.03, 1e-8);
    CHECK_NEAR(last, 0.022, 1e-8);
    CHECK(!kn_tool_height_touch(&mesh, top, 0.01, &away, 0, 0, &first, &last)); // between the nodes
    forget();
}

TEST("a plate touches only vertices of the top face, even if vertices of a side stand higher")
{
    double first, last;
    kn_probe_def plate = {.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.06}};
    make(0);
    for (int v = 0; v < mesh.vertex_count; v++)
        if (!top[v]) mesh.positions_m[3 * v + 2] = 0.04f;
    CHECK(kn_tool_height_touch(&mesh, top, 0.01, &plate, 0, 0, &first, &last));
    CHECK_NEAR(first, 0.03, 1e-8);
    forget();
}

TEST("a sphere over a dent rests on the rim of the dent")
{
    double first, last, r = 0.02;
    kn_probe_def ball = {.shape = KN_PROBE_SPHERE, .radius_m = r};
    make(0);
    CHECK(kn_tool_height_touch(&mesh, top, 0.01, &ball, 0.005, 0.005, &first, &last));
    CHECK_NEAR(first, 0.03 + r, 1e-8);
    forget();
    make(0.015);
    CHECK(kn_tool_height_touch(&mesh, top, 0.01, &ball, 0, 0, &first, &last));
    double rim = 0.03 + sqrt(r * r - 0.015 * 0.015 - 0.005 * 0.005);
    CHECK_NEAR(first, rim, 1e-6);
    forget();
}

static const kn_probe_def tools[] = {
    {.name = "t", .shape = KN_PROBE_PLATE, .size_m = {0.03, 0.03}},
    {.name = "t", .shape = KN_PROBE_SPHERE, .radius_m = 0.012},
    {.name = "t", .shape = KN_PROBE_CAPSULE, .radius_m = 0.011, .length_m = 0.03},
    {.name = "t", .shape = KN_PROBE_CYLINDER, .radius_m = 0.015, .length_m = 0.02},
    {.name = "t", .shape = KN_PROBE_BOX, .size_m = {0.03, 0.02, 0.01}, .edge_m = 0.001},
    {.name = "t", .shape = KN_PROBE_CROSS, .size_m = {0.04, 0.012, 0.01}},
};

TEST("a tool of any shape touches at the height where the model's clearance ends")
{
    static const double level[4] = {1};
    make(0);
    for (size_t i = 0; i < sizeof tools / sizeof *tools; i++) {
        kn_model_def def = kn_model_def_default();
        def.probe_count = 1;
        def.probe[0] = tools[i];
        OWN(kn_model) *with = build(&def);
        OWN(kn_state) *state = kn_state_create(with);
        double first, last, at[3] = {0.005, 0.005}; // above a node
        CHECK(kn_tool_height_touch(&mesh, top, 0.01, &tools[i], at[0], at[1], &first, &last));
        CHECK_NEAR(first, 0.03 + kn_tool_height_m(&tools[i]), 1e-8);
        CHECK_NEAR(last, first, 1e-8);
        at[2] = first + 1e-4;
        CHECK_NEAR(kn_clearance(with, state, 0, at, level), 1e-4, 1e-6);
        at[2] = first - 1e-4;
        CHECK(kn_clearance(with, state, 0, at, level) <= 0);
    }
    forget();
}

TEST("a foot covers its shape: a cross has no corners, and a capsule rises towards its sides")
{
    const kn_probe_def *finger = &tools[2], *cylinder = &tools[3], *box = &tools[4], *cross = &tools[5];
    CHECK(kn_tool_height_below(cross, 0.019, -0.005) == 0 && kn_tool_height_below(cross, -0.005, 0.019) == 0);
    CHECK(isinf(kn_tool_height_below(cross, 0.019, 0.019)));
    CHECK(kn_tool_height_below(box, -0.014, 0.009) == 0 && isinf(kn_tool_height_below(box, 0.009, 0.014)));
    CHECK(kn_tool_height_below(cylinder, 0.01, -0.011) == 0 && isinf(kn_tool_height_below(cylinder, 0.011, 0.011)));
    CHECK_NEAR(kn_tool_height_below(finger, 0.0066, 0), 0.0088, 1e-12);
    CHECK(isinf(kn_tool_height_below(finger, 0.008, 0.008)));
    CHECK(kn_tool_height_flat(KN_PROBE_PLATE) && kn_tool_height_flat(KN_PROBE_CROSS) &&
          !kn_tool_height_flat(KN_PROBE_CAPSULE));
}

TESTS_MAIN
