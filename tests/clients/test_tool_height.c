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
    kn_model_destroy(model);
    kn_mesh_free(&mesh);
    free(top);
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

// Return the height of the object at a place, NAN if there is none.
static double height_m(double x_m, double y_m)
{
    double z_m;
    return kn_tool_height_object(&mesh, x_m, y_m, &z_m) ? z_m : NAN;
}

// Check the heights at which a tool touches its first and its last vertex.
static void check_touch(kn_probe_def def, double x_m, double y_m, double first_m, double last_m)
{
    double first = NAN, last = NAN;
    CHECK(kn_tool_height_touch(&mesh, top, 0.01, &def, x_m, y_m, &first, &last));
    CHECK_NEAR(first, first_m, 1e-8);
    CHECK_NEAR(last, last_m, 1e-8);
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
}

TEST("the surface of a block at rest is at its height everywhere, and no surface is found beside it; the bottom of a "
     "dent has the full depth, and a point halfway up its side has half the depth")
{
    make(0);
    CHECK_NEAR(height_m(0, 0), 0.03, 1e-8);
    CHECK_NEAR(height_m(-0.0249, 0.0173), 0.03, 1e-8);
    CHECK(isnan(height_m(0.03, 0)));
    mesh.whole = false;
    CHECK(isnan(height_m(0, 0)));
    make(0.008);
    CHECK_NEAR(height_m(0, 0), 0.022, 1e-8);
    CHECK_NEAR(height_m(0.01, 0), 0.026, 1e-8);
}

TEST("a plate over a dent touches the highest covered vertex of the top first and the lowest last; vertices of a side "
     "do not count")
{
    double first, last;
    const kn_probe_def away = {.shape = KN_PROBE_PLATE, .size_m = {0.002, 0.002}};
    make(0.008);
    check_touch((kn_probe_def){.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.01}}, 0, 0, 0.022, 0.022);
    check_touch((kn_probe_def){.shape = KN_PROBE_PLATE, .size_m = {0.03, 0.01}}, 0, 0, 0.03, 0.022);
    CHECK(!kn_tool_height_touch(&mesh, top, 0.01, &away, 0, 0, &first, &last)); // between the nodes
    make(0);
    for (int v = 0; v < mesh.vertex_count; v++)
        if (!top[v]) mesh.positions_m[3 * v + 2] = 0.04f;
    check_touch((kn_probe_def){.shape = KN_PROBE_PLATE, .size_m = {0.01, 0.06}}, 0, 0, 0.03, 0.03);
}

TEST("a sphere over a dent rests on the rim of the dent")
{
    const double r = 0.02;
    double first, last;
    const kn_probe_def ball = {.shape = KN_PROBE_SPHERE, .radius_m = r};
    make(0.015);
    CHECK(kn_tool_height_touch(&mesh, top, 0.01, &ball, 0, 0, &first, &last));
    CHECK_NEAR(first, 0.03 + sqrt(r * r - 0.015 * 0.015 - 0.005 * 0.005), 1e-6);
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
        const double first = 0.03 + kn_tool_height_m(&tools[i]); // above a node
        check_touch(tools[i], 0.005, 0.005, first, first);
        CHECK_NEAR(kn_clearance(with, state, 0, (double[]){0.005, 0.005, first + 1e-4}, level), 1e-4, 1e-6);
        CHECK(kn_clearance(with, state, 0, (double[]){0.005, 0.005, first - 1e-4}, level) <= 0);
    }
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
