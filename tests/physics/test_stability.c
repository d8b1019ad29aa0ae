// Extremes: a user's guess of stiffness or viscosity may be wrong by eight decades, and no guess may break the step.
#include "tests/check.h"
#include "tests/physics/press.h"

static const double scales[5] = {1e-4, 1e-2, 1, 1e2, 1e4};

static bool finite_all(const double *v, int n)
{
    for (int i = 0; i < n; i++)
        if (!isfinite(v[i])) return false;
    return true;
}

static void scale_material(kn_material *m, int field, double by)
{
    if (field == 0) m->k1_pa *= by;
    if (field == 1) m->c1_pa_s *= by;
    if (field == 2) m->alpha_pa_s *= by;
}

TEST("with k1, c1 and alpha of dough times 1e-4 to 1e4, f32 and f64, a press stays finite and inside the block")
{
    for (int t = 0; t < 3 * 5 * 2; t++) {
        kn_model_def def = press_def(1);
        scale_material(&def.material, t / 5 % 3, scales[t % 5]);
        def.solver.precision = (kn_precision)(t / 15);
        press p = {.depth_m = 0.003, .hold_s = 0.05};
        AT_END(run_free) run r = press_run(&def, &p, 0.6, 1e-3);
        CHECK(r.status == KN_OK);
        CHECK(finite_all(&r.force_n[0][0], 3 * r.samples) && finite_all(&r.shape_m[0][0], 3 * r.nodes));
        for (int i = 0; i < r.nodes; i++)
            for (int k = 0; k < 3; k++) CHECK(fabs(r.shape_m[i][k]) < 0.05);
        CHECK(peak_n(&r) > 0);
    }
}

TEST("with c1 = 0, k1 = 0, a rigid or an almost fluid damper, a press with a ball stays finite")
{
    kn_material m[5] = {dough, dough, jelly(), clay(), dough};
    m[0].c1_pa_s = 0;
    m[1].k1_pa = 0;
    m[2].c1_pa_s = 0;
    m[3].c2_pa_s *= 1e-4;
    m[4].beta_per_pa = 0;
    for (int t = 0; t < 10; t++) {
        kn_model_def def = ball_def(1);
        def.material = m[t % 5];
        def.solver.precision = (kn_precision)(t / 5);
        press p = {.depth_m = 0.003, .hold_s = 0.05};
        AT_END(run_free) run r = press_run(&def, &p, 0.6, 1e-3);
        CHECK(r.status == KN_OK && finite_all(&r.force_n[0][0], 3 * r.samples));
        CHECK(peak_n(&r) > 0);
    }
}

TEST(
    "a dead load only lowers the top, at every scale and at steps of 0.1 to 20 ms; without the load the top only rises")
{
    static const double steps[4] = {1e-4, 1e-3, 5e-3, 2e-2};
    for (int t = 0; t < 3 * 5 * 4; t++) {
        kn_model_def def = converged(press_def(1));
        def.nodes[0] = def.nodes[1] = 3;
        def.probe_count = 0;
        def.density_kg_m3 = 0.01; // no inertia, since it may oscillate where c1 is small
        scale_material(&def.material, t / 5 % 3, scales[t % 5]);
        def.solver.dt_s = steps[t / 15];
        OWN(kn_model) *model = build(&def);
        OWN(kn_state) *state = kn_state_create(model);
        double before = 0, u[3];
        // A load that bends the softest of them by a tenth at most.
        kn_input in = {.top_load_n = 4e-4 * fmin(400, fmin(def.material.k1_pa / 10, def.material.c1_pa_s / 10))};
        kn_output out;
        for (int i = 0; i < 60; i++) {
            if (i == 30) in.top_load_n = 0;
            CHECK(kn_step(model, state, &in, &out) == KN_OK);
            displacement(model, state, model->grid.nodes - 5, u); // middle of the top
            CHECK(i < 30 ? u[2] <= before + 1e-15 : u[2] >= before * (1 + 1e-5));
            before = u[2];
        }
        CHECK(before <= 0);
    }
}

TEST("a NaN in the state is reported and gives zero force, and the state stays bad until it is reset")
{
    kn_model_def def = ball_def(1);
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    press p = {.depth_m = 0.003, .hold_s = 1};
    kn_input in;
    kn_output out;
    for (int i = 1; i <= 300; i++) in = press_input(model, &p, i * 1e-3), kn_step(model, state, &in, &out);
    CHECK(out.probe[0].force_n[2] > 0);
    ((float *)state->velocity)[kn_grid_offset(&model->grid, model->grid.nodes - 1)] = NAN;
    kn_status status = KN_OK;
    for (int i = 0; i < 3; i++) status = kn_step(model, state, &in, &out);
    CHECK(status == KN_DIVERGED && state->bad);
    for (int k = 0; k < 3; k++) CHECK(out.probe[0].force_n[k] == 0);
    kn_state_reset(model, state);
    CHECK(kn_step(model, state, &in, &out) == KN_OK);
}

TESTS_MAIN
