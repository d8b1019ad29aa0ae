// A block under its own weight for five minutes. The force-dependent damper keeps the block in shape. A linear damper
// of the viscosity that a press meets does not, and without diagonals no damper does.
#include "core/scene/scene.h"
#include "core/state.h"
#include "core/step.h"
#include "tests/check.h"

static kn_scene *weighed(const char *const *sets, int count)
{
    const char *all[8] = {"gravity=9.81 m/s^2"};
    for (int i = 0; i < count; i++) all[1 + i] = sets[i];
    return load_scene("dough-small.yaml", all, 1 + count);
}

// Lean the block by so much of its height. To first order, no edge along an axis changes its length.
static void lean(const kn_model *model, kn_state *state, double share)
{
    float *moved = state->displacement;
    for (int node = 0; node < model->grid.nodes; node++) {
        double rest_m[3];
        kn_grid_rest(&model->grid, node, rest_m);
        moved[kn_grid_offset(&model->grid, node)] = (float)(share * rest_m[2]);
    }
}

// Return the mean displacement of the top face along an axis, m.
static double top_after(const kn_scene *scene, double seconds, double leaning, int axis)
{
    OWN(kn_model) *model = build(&scene->model);
    OWN(kn_state) *state = kn_state_create(model);
    lean(model, state, leaning);
    kn_input input = {0};
    kn_output output;
    for (int i = 0; i < (int)(seconds / model->def.solver.dt_s); i++)
        if (kn_step(model, state, &input, &output) != KN_OK) break;
    double sum_m = 0;
    for (int t = 0; t < model->top_count; t++) {
        double x_m[3];
        kn_state_position(model, state, model->top[t], x_m);
        sum_m += x_m[axis] - model->rest_m[model->top[t]][axis];
    }
    double mean_m = sum_m / model->top_count;
    return mean_m;
}

static double height_m(const kn_scene *scene) { return scene->model.spacing_m * (scene->model.nodes[2] - 1); }

// Return the fall of the top as a share of the height.
static double sag_after(const kn_scene *scene, double seconds, double leaning)
{
    return -top_after(scene, seconds, leaning, 2) / height_m(scene);
}

// Return the increase of the lean beyond its start.
static double drift_after(const kn_scene *scene, double seconds, double leaning)
{
    return top_after(scene, seconds, leaning, 0) - leaning * height_m(scene);
}

static double predicted(const kn_scene *scene, double seconds) // as knead check predicts
{
    const kn_model_def *def = &scene->model;
    double weight_pa = def->density_kg_m3 * def->gravity_m_s2 * def->spacing_m * (def->nodes[2] - 1);
    return 0.85 * 0.5 * weight_pa * kn_material_compliance(&def->material, seconds);
}

NIGHT_TEST("dough sags by less than 1.6 % in five minutes, as its stiffness at rest predicts")
{
    OWN(kn_scene) *scene = weighed(NULL, 0);
    double sag = sag_after(scene, 300, 0);
    printf("     dough sags %.2f %%, predicted %.2f %%\n", 100 * sag, 100 * predicted(scene, 300));
    CHECK(sag < 0.016);
    CHECK_NEAR(sag / predicted(scene, 300), 1, 0.05);
}

NIGHT_TEST("a block with a linear damper of the viscosity in a press slumps to less than half its height")
{
    OWN(kn_scene) *scene = weighed((const char *const[]){"material.damper=constant", "material.c2=1387 gf s/cm^3"}, 2);
    double sag = sag_after(scene, 300, 0);
    printf("     linear damper: %.0f %%\n", 100 * sag);
    CHECK(sag > 0.5);
}

NIGHT_TEST("a plastic block keeps its shape with a force-dependent damper and slumps with a linear one")
{
    static const char *const linear[] = {
        "material={k1: 0 Pa, c1: 2774 gf s/cm^3, damper: constant, c2: 2774 gf s/cm^3}",
        "material.specimen_height=1 cm"};
    OWN(kn_scene) *plastic = weighed((const char *const[]){"material=dough-plastic"}, 1), *slack = weighed(linear, 2);
    double holds = sag_after(plastic, 300, 0), flows = sag_after(slack, 300, 0);
    printf("     plastic: %.2f %%, with a linear damper of 1387 gf s/cm^3 %.0f %%\n", 100 * holds, 100 * flows);
    CHECK_NEAR(holds, 0.012, 0.001);
    CHECK_NEAR(flows, 0.52, 0.05);
}

TEST("a block leaning by 2 % stands with diagonals and collapses within a second without them")
{
    OWN(kn_scene) *whole = weighed(NULL, 0), *sides = weighed((const char *const[]){"object.structure=axis"}, 1);
    CHECK(sag_after(whole, 1, 0.02) < 0.01);
    double sag = sag_after(sides, 1, 0.02);
    printf("     sides only: %.0f %% after 1 s\n", 100 * sag);
    CHECK(sag > 0.5);
}

TEST("gas in the cells does not stop a lattice without diagonals from leaning over; diagonals of 1 % stiffness do")
{
    static const char *const weak[] = {"object.pressure=cells", "object.diagonal_stiffness=0.01"};
    static const char *const none[] = {"object.pressure=cells", "object.structure=axis"};
    OWN(kn_scene) *sides = weighed(none, 2), *braced = weighed(weak, 2);
    double drift = drift_after(sides, 20, 0.02), held = drift_after(braced, 20, 0.02);
    printf("     after 20 s the top has gone %.2f mm sideways without diagonals, %.3f mm with them\n", 1e3 * drift,
           1e3 * held);
    CHECK(drift > 2e-3 && fabs(held) < 0.1 * drift);
}

NIGHT_TEST("with gas and diagonals of 2 % stiffness a block sags by 1 %")
{
    static const char *const weak[] = {"object.pressure=cells", "object.diagonal_stiffness=0.02", "solver.dt=2 ms"};
    OWN(kn_scene) *scene = weighed(weak, 3);
    double sag = sag_after(scene, 300, 0);
    printf("     with gas %.2f %%\n", 100 * sag);
    CHECK_NEAR(sag, 0.01, 0.001);
}

TESTS_MAIN
