// The dependence of the result on the time step and on the calibration of the lattice.
#include "tests/check.h"
#include "tests/physics/press.h"

TEST("the implicit step is of first order: half the step gives half the error of force and shape")
{
    press p = {.depth_m = 0.001, .hold_s = 0.05};
    kn_model_def def = converged(press_def(1));
    run r[4];
    for (int i = 0; i < 4; i++) { // 2, 1, 0.5 ms against 0.125 ms; without the first touch
        def.solver.dt_s = i < 3 ? 2e-3 / (1 << i) : 1.25e-4;
        r[i] = press_run(&def, &p, 0.16, 2e-3);
        memset(r[i].force_n, 0, 5 * sizeof *r[i].force_n);
    }
    double force[3], shape[3];
    for (int i = 0; i < 3; i++) {
        force[i] = force_error(&r[i], &r[3]);
        shape[i] = shape_error(&r[i], &r[3]);
        printf("     %g ms: force %.3f %%, shape %.4f %%\n", 2.0 / (1 << i), 100 * force[i], 100 * shape[i]);
    }
    // At 1 ms, for a press that accelerates or brakes half of the time.
    CHECK(force[1] < 2e-2 && shape[1] < 2e-3);
    for (int i = 0; i < 2; i++) { // the reference has a quarter of the finest error: expected ratios 2.1, 2.3
        CHECK(force[i] / force[i + 1] > 1.8 && force[i] / force[i + 1] < 2.6);
        CHECK(shape[i] / shape[i + 1] > 1.6 && shape[i] / shape[i + 1] < 2.6);
    }
    for (int i = 0; i < 4; i++) run_free(&r[i]);
}

// Measure the settled strain of a block under a small distributed load: along z, and sideways along x.
static void patch(kn_model_def def, double stress_pa, double *along, double *sideways)
{
    def.material = (kn_material){.k1_pa = 1e4, .c1_pa_s = 100, .damper = KN_DAMPER_NONE}; // settles in 10 ms
    def.support = KN_SUPPORT_FRICTIONLESS;
    def.probe_count = 0;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.tolerance = 1e-12;
    def.solver.iterations_max = 500;
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    double h = def.spacing_m, depth = def.thickness_m > 0 ? def.thickness_m : (def.nodes[1] - 1) * h;
    double area = (def.nodes[0] - 1) * h * depth;
    kn_input in = {.top_load_n = stress_pa * area};
    kn_output out;
    for (int i = 0; i < 400; i++) kn_step(model, state, &in, &out);
    double low[3], high[3];
    displacement(model, state, 0, low);
    displacement(model, state, model->grid.nodes - 1, high);
    *along = (high[2] - low[2]) / ((def.nodes[2] - 1) * h);
    *sideways = (high[0] - low[0]) / ((def.nodes[0] - 1) * h);
    // Uniform strain: every node moves in proportion to its position.
    for (int i = 0; i < model->grid.nodes; i++) {
        double x[3], u[3];
        kn_grid_rest(&model->grid, i, x);
        displacement(model, state, i, u);
        CHECK_NEAR(u[2], *along * x[2], 1e-4 * fabs(*along) * 0.01);
    }
}

TEST("uniaxial patch test: a block with diagonals has the material's modulus, E = 2.7 k/h, and nu = 0.35")
{
    static const int blocks[3][3] = {{6, 6, 4}, {3, 4, 5}, {2, 2, 2}};
    for (int t = 0; t < 3; t++) {
        kn_model_def def = press_def(1);
        memcpy(def.nodes, blocks[t], sizeof def.nodes);
        def.spacing_m = 0.01 / (t + 1);
        double along, sideways;
        patch(def, 0.1, &along, &sideways); // strain 1e-5
        CHECK_NEAR(along, -1e-5, 1e-9);
        CHECK_NEAR(-sideways / along, 0.35, 1e-3);
    }
}

TEST("with weak diagonals E is the material's and nu = 7 e/(3 + 17 e), flat e/(1 + e); without diagonals nu is 0")
{
    static const double stiffness[] = {1, 0.5, 0.1, 0.02};
    for (int t = 0; t < 8; t++) {
        kn_model_def def = press_def(1);
        double e = def.diagonal_stiffness = stiffness[t / 2], along, sideways;
        bool flat = t % 2;
        if (flat) def.nodes[1] = 1, def.thickness_m = 0.02;
        patch(def, 0.1, &along, &sideways);
        CHECK_NEAR(along, -1e-5, 2e-9);
        CHECK_NEAR(-sideways / along, flat ? e / (1 + e) : 7 * e / (3 + 17 * e), 1e-3);
    }
    kn_model_def def = press_def(1);
    double along, sideways;
    def.structure = KN_STRUCTURE_AXIS;
    patch(def, 0.1, &along, &sideways);
    CHECK_NEAR(along, -1e-5, 2e-9);
    CHECK_NEAR(sideways / along, 0, 1e-3);
}

TEST("a column's own weight shortens it by rho g H^2 / (2 E) at every mass scale")
{
    for (int scaled = 0; scaled < 2; scaled++) {
        kn_model_def def = press_def(1);
        def.material = (kn_material){.k1_pa = 1e4, .c1_pa_s = 300, .damper = KN_DAMPER_NONE};
        def.structure = KN_STRUCTURE_AXIS;
        def.nodes[0] = def.nodes[1] = 1;
        def.nodes[2] = 5;
        def.gravity_m_s2 = 0.01; // small strains
        def.probe_count = 0;
        def.solver.precision = KN_PRECISION_F64;
        def.solver.mass_scale = scaled ? 10 : 1;
        OWN(kn_model) *model = build(&def);
        OWN(kn_state) *state = kn_state_create(model);
        kn_input in = {0};
        kn_output out;
        double u[3], height = 0.04;
        for (int i = 0; i < 2000; i++) kn_step(model, state, &in, &out);
        displacement(model, state, 4, u);
        double expected = -def.density_kg_m3 * def.gravity_m_s2 * height * height / (2 * def.material.k1_pa);
        CHECK_NEAR(u[2], expected, 1e-4 * fabs(expected));
    }
}

TESTS_MAIN
