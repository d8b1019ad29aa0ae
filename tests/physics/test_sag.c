// A block under its own weight for five minutes: the force-dependent damper keeps its shape, a linear one of the viscosity that
// a press meets does not, and without diagonals nothing does.
#include "core/scene/scene.h"
#include "core/state.h"
#include "core/step.h"
#include "tests/check.h"

static kn_scene *weighed(const char *const *sets, int count)
{
    char error[400];
    const char *all[8] = {"gravity=9.81 m/s^2"};
    for (int i = 0; i < count; i++) all[1 + i] = sets[i];
    kn_scene *scene = kn_scene_load(KN_SOURCE_DIR "/core/scenes/dough-small.yaml", all, 1 + count, error, sizeof error);
    if (!scene) KN_TEST_FAIL("%s", error);
    return scene;
}

// Leans the block by so much of its height: no edge along an axis gets longer or shorter by it, to first order.
static void lean(const kn_model *model, kn_state *state, double share)
{
    float *moved = state->displacement;
    for (int node = 0; node < model->grid.nodes; node++) {
        double rest_m[3];
        kn_grid_rest(&model->grid, node, rest_m);
        moved[kn_grid_offset(&model->grid, node)] = (float)(share * rest_m[2]);
    }
}

// Share of its height that the top face has come down, in the mean.
static double sag_after(const kn_scene *scene, double seconds, double leaning)
{
    char error[400];
    kn_model *model = kn_model_build(&scene->model, error, sizeof error);
    kn_state *state = kn_state_create(model);
    lean(model, state, leaning);
    kn_input input = {0};
    kn_output output;
    for (int i = 0; i < (int)(seconds * 1e3); i++)
        if (kn_step(model, state, &input, &output) != KN_OK) break;
    const kn_face *top = &model->face[0];
    double height_m = model->def.spacing_m * (model->def.nodes[2] - 1), mean_m = 0;
    for (int u = 0; u < top->len[0]; u++)
        for (int v = 0; v < top->len[1]; v++) {
            double x_m[3];
            kn_state_position(model, state, top->origin + u * top->step[0] + v * top->step[1], x_m);
            mean_m += x_m[2] / (top->len[0] * top->len[1]);
        }
    kn_state_destroy(state);
    kn_model_destroy(model);
    return 1 - mean_m / height_m;
}

static double predicted(const kn_scene *scene, double seconds) // as knead check has it
{
    const kn_model_def *def = &scene->model;
    double weight_pa = def->density_kg_m3 * def->gravity_m_s2 * def->spacing_m * (def->nodes[2] - 1);
    return 0.85 * 0.5 * weight_pa * kn_material_compliance(&def->material, seconds);
}

TEST("dough stands: 1.5 % in five minutes, as its stiffness at rest predicts")
{
    kn_scene *scene = weighed(NULL, 0);
    double sag = sag_after(scene, 300, 0);
    printf("     dough sags %.2f %%, predicted %.2f %%\n", 100 * sag, 100 * predicted(scene, 300));
    CHECK(sag < 0.016);
    CHECK_NEAR(sag / predicted(scene, 300), 1, 0.05);
    kn_scene_destroy(scene);
}

TEST("with a linear damper of the viscosity that a press meets it slumps to less than half")
{
    kn_scene *scene = weighed((const char *const[]){"material.damper=constant", "material.c2=1387 gf s/cm^3"}, 2);
    double sag = sag_after(scene, 300, 0);
    printf("     linear damper: %.0f %%\n", 100 * sag);
    CHECK(sag > 0.5);
    kn_scene_destroy(scene);
}

TEST("a plastic block holds its shape too by its force-dependent damper, and flows away with a linear one")
{
    kn_scene *scene = weighed((const char *const[]){"material=dough-plastic"}, 1);
    double holds = sag_after(scene, 300, 0);
    kn_scene_destroy(scene);
    scene = weighed((const char *const[]){"material={k1: 0 Pa, c1: 2774 gf s/cm^3, damper: constant, c2: 2774 gf s/cm^3}",
                                          "material.specimen_height=1 cm"},
                    2);
    double flows = sag_after(scene, 300, 0);
    kn_scene_destroy(scene);
    printf("     plastic: %.2f %%, with a linear damper of 1387 gf s/cm^3 %.0f %%\n", 100 * holds, 100 * flows);
    CHECK_NEAR(holds, 0.012, 0.001);
    CHECK_NEAR(flows, 0.52, 0.05);
}

TEST("leaning by 2 % it stands with diagonals, and without them lies down within a second")
{
    kn_scene *scene = weighed(NULL, 0);
    CHECK(sag_after(scene, 1, 0.02) < 0.01);
    kn_scene_destroy(scene);
    scene = weighed((const char *const[]){"object.structure=axis"}, 1);
    double sag = sag_after(scene, 1, 0.02);
    printf("     sides only: %.0f %% after 1 s\n", 100 * sag);
    CHECK(sag > 0.5);
    kn_scene_destroy(scene);
}

TESTS_MAIN
