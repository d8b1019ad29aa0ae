#include "core/solver_rk4.h"
#include "tests/check.h"
#include "tests/physics/press.h"

static kn_model_def rk4_def(double dt_s, double mass_scale)
{
    kn_model_def def = press_def(1);
    def.solver.kind = KN_SOLVER_RK4;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.dt_s = dt_s;
    def.solver.mass_scale = mass_scale;
    return def;
}

TEST("at rest the dough needs steps of 1.9e-7 s (144 nodes), 4.7e-8 s (847): Runge-Kutta at 1 kHz is refused by name")
{
    static const double limit[3] = {0, 1.87e-7, 4.67e-8}; // 2.785 / lambda_max, found by hand for the same lattices
    for (int per_cm = 1; per_cm <= 2; per_cm++) {
        kn_model_def def = rk4_def(1e-8, 1);
        def.nodes[0] = def.nodes[1] = 5 * per_cm + 1;
        def.nodes[2] = 3 * per_cm + 1;
        def.spacing_m = 0.01 / per_cm;
        kn_model *model = build(&def);
        CHECK_NEAR(model->rk4_limit_s, limit[per_cm], 0.02 * limit[per_cm]);
        kn_model_destroy(model);
        char error[256] = "";
        def.solver.dt_s = 1e-3;
        CHECK(!kn_model_build(&def, error, sizeof error));
        CHECK(strstr(error, "e-0") && strlen(error) > 20);
        if (per_cm == 1) printf("     %s\n", error);
    }
}

TEST("the limit is where a resting lattice starts to blow up: 2 % below it a small push dies out, 2 % above it grows")
{
    for (int above = 0; above < 2; above++) {
        kn_model_def def = rk4_def(1e-8, 1);
        def.material = (kn_material){.k1_pa = 1e3, .c1_pa_s = 2500 * GF_CM2, .damper = KN_DAMPER_NONE};
        def.support = KN_SUPPORT_NONE;
        def.gravity_m_s2 = 0;
        kn_model *model = build(&def);
        model->def.solver.dt_s = model->rk4_limit_s * (above ? 1.02 : 0.98);
        kn_state *state = kn_state_create(model);
        double *v = state->velocity;
        for (int i = 0; i < model->grid.nodes; i++)
            for (size_t k = 0; k < 3; k++) // speeds so small that the lattice stays linear
                v[kn_grid_offset(&model->grid, i) + k * kn_grid_stride(&model->grid)] =
                    1e-12 * ((i * 7 + (int)k * 3) % 11 - 5);
        kn_input in = {0};
        kn_output out;
        double first = 0, last = 0;
        for (int step = 0; step < 300; step++) {
            kn_step(model, state, &in, &out);
            double energy = 0;
            for (size_t i = 0; i < kn_grid_field(&model->grid, 3); i++) energy += v[i] * v[i];
            if (step == 200) first = energy;
            last = energy;
        }
        CHECK(above ? last > 100 * first : last < first);
        kn_state_destroy(state);
        kn_model_destroy(model);
    }
}

TEST("Runge-Kutta is of fourth order: half the step, a sixteenth of the error")
{
    // a smooth law (no kink is passed), one bar let go from a stretch
    double end[3];
    for (int i = 0; i < 3; i++) {
        kn_model_def def = rk4_def(4e-3 / (1 << i), 1);
        def.material = (kn_material){.k1_pa = 2e4, .c1_pa_s = 20, .damper = KN_DAMPER_CONSTANT, .c2_pa_s = 2e3};
        def.nodes[0] = def.nodes[1] = 1;
        def.nodes[2] = 2;
        def.structure = KN_STRUCTURE_AXIS;
        def.density_kg_m3 = 1e4;
        def.solver.mass_scale = 200; // a slow bar: 2 rad/s per step at most
        def.probe_count = 0;
        kn_model *model = build(&def);
        kn_state *state = kn_state_create(model);
        kn_input in = {.top_load_n = 0.5};
        kn_output out;
        for (int step = 0; step < 50 << i; step++) kn_step(model, state, &in, &out);
        double x[3];
        kn_state_position(model, state, 1, x);
        end[i] = x[2];
        kn_state_destroy(state);
        kn_model_destroy(model);
    }
    double order = log2((end[0] - end[1]) / (end[1] - end[2]));
    printf("     order %.2f\n", order);
    CHECK_NEAR(order, 4, 0.3);
}

TESTS_MAIN
