// One law, three materials (second paper): recovery after a press, and the remaining dent.
#include "tests/check.h"
#include "tests/physics/press.h"

typedef struct dent {
    double pressed_m,
        left_m; // depth of the deepest top node under the plate: at the end of the hold, after 8 s of rest
} dent;

static dent press_and_rest(kn_material material, kn_precision precision)
{
    kn_model_def def = press_def(1);
    def.material = material;
    def.solver.precision = precision;
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    press p = {.depth_m = 0.01, .hold_s = 1};
    int node = kn_grid_node(&model->grid, 2, 3, 3); // on top, under the plate
    dent d = {0};
    kn_output out;
    for (int i = 1; i <= 11000; i++) {
        kn_input in = press_input(model, &p, i * 1e-3);
        CHECK(kn_step(model, state, &in, &out) == KN_OK);
        double u[3];
        displacement(model, state, node, u);
        if (i == (int)(press_up_s(&p) * 1000)) d.pressed_m = -u[2];
        d.left_m = -u[2];
    }
    CHECK(out.probe[0].contacts == 0);
    return d;
}

static dent dents[2][3]; // [precision][jelly, dough, clay]

TEST("jelly recovers: less than 0.1 % of the press depth is left")
{
    for (int p = 0; p < 2; p++) {
        dents[p][0] = press_and_rest(jelly(), (kn_precision)p);
        CHECK_NEAR(dents[p][0].pressed_m, 0.01, 1e-4);
        CHECK_NEAR(dents[p][0].left_m, 0, 1e-3 * 0.01);
    }
}

TEST("clay keeps the dent: more than 99.9 % of the press depth is left")
{
    for (int p = 0; p < 2; p++) {
        dents[p][2] = press_and_rest(clay(), (kn_precision)p);
        CHECK_NEAR(dents[p][2].pressed_m, 0.01, 1e-4);
        CHECK_NEAR(dents[p][2].left_m, dents[p][2].pressed_m, 1e-3 * 0.01);
    }
}

TEST("dough keeps 50 to 98 % of the dent and recovers the rest")
{
    for (int p = 0; p < 2; p++) {
        dents[p][1] = press_and_rest(dough, (kn_precision)p);
        double left = dents[p][1].left_m / dents[p][1].pressed_m;
        printf("     %s: of 1 cm jelly keeps %.4f cm, dough %.4f cm, clay %.4f cm\n", p ? "f64" : "f32",
               100 * dents[p][0].left_m, 100 * dents[p][1].left_m, 100 * dents[p][2].left_m);
        CHECK(left > 0.5 && left < 0.98);
    }
}

TEST("f32 and f64 leave the same dents")
{
    for (int m = 0; m < 3; m++) CHECK_NEAR(dents[0][m].left_m, dents[1][m].left_m, 1e-5);
}

TESTS_MAIN
