// Extremes: a user's guess of stiffness or viscosity may be wrong by eight decades, and no guess may break the step.
// A diverged state: core/test_contact.c.
#include "tests/lattice.h"

static const double scales[5] = {1e-4, 1e-2, 1, 1e2, 1e4};

// Return dough with k1, c1 or alpha scaled, for t = 0 .. 14.
static kn_material scaled(int t)
{
    kn_material m = dough;
    double *field[3] = {&m.k1_pa, &m.c1_pa_s, &m.alpha_pa_s};
    *field[t / 5] *= scales[t % 5];
    return m;
}

// Check that a press of 3 mm stays finite, and that no node moves by more than 5 cm.
static void stays_finite(kn_model_def def, kn_material material)
{
    const press p = {.depth_m = 0.003, .hold_s = 0.05};
    def.material = material;
    for (int precision = 0; precision < 2; precision++) {
        def.solver.precision = (kn_precision)precision;
        AT_END(run_free) run r = press_run(&def, &p, 0.6, 1e-3);
        CHECK(r.status == KN_OK && peak_n(&r) > 0);
        for (int i = 0; i < 3 * r.samples; i++) CHECK(isfinite((&r.force_n[0][0])[i]));
        for (int i = 0; i < 3 * r.nodes; i++) CHECK(fabs((&r.shape_m[0][0])[i]) < 0.05);
    }
}

TEST("with k1, c1 and alpha of dough times 1e-4 to 1e4, f32 and f64, a press stays finite and inside the block")
{
    for (int t = 0; t < 15; t++) stays_finite(press_def(1), scaled(t));
}

TEST("with c1 = 0, k1 = 0, a rigid or an almost fluid damper, a press with a ball stays finite")
{
    kn_material m[5] = {dough, dough, jelly(), clay(), dough};
    m[0].c1_pa_s = 0;
    m[1].k1_pa = 0;
    m[2].c1_pa_s = 0;
    m[3].c2_pa_s *= 1e-4;
    m[4].beta_per_pa = 0;
    for (int t = 0; t < 5; t++) stays_finite(ball_def(1), m[t]);
}

TEST(
    "a dead load only lowers the top, at every scale and at steps of 0.1 to 20 ms; without the load the top only rises")
{
    static const double dt_s[4] = {1e-4, 1e-3, 5e-3, 2e-2};
    for (int t = 0; t < 15 * 4; t++) {
        kn_model_def def = converged(press_def(1));
        def.nodes[0] = def.nodes[1] = 3;
        def.probe_count = 0;
        def.density_kg_m3 = 0.01; // no inertia, since it may oscillate where c1 is small
        def.material = scaled(t % 15);
        def.solver.dt_s = dt_s[t / 15];
        LATTICE l = lattice_of(def);
        double before = 0, u[3];
        // A load that bends the softest of them by a tenth at most.
        l.in.top_load_n = 4e-4 * fmin(400, fmin(def.material.k1_pa / 10, def.material.c1_pa_s / 10));
        for (int i = 0; i < 60; i++) {
            if (i == 30) l.in.top_load_n = 0;
            step(&l);
            displacement(l.model, l.state, l.model->grid.nodes - 5, u); // middle of the top
            CHECK(i < 30 ? u[2] <= before + 1e-15 : u[2] >= before * (1 + 1e-5));
            before = u[2];
        }
        CHECK(before <= 0);
    }
}
