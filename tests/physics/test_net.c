// Lattices of tetrahedra and triangles: their elasticity and creep compared with the element's, their step compared
// with Runge-Kutta, their conservation laws, and a press compared with that of the regular block.
#include "tests/check.h"
#include "tests/physics/bcc.h"
#include "tests/physics/press.h"

#include <stdint.h>

// Make the block of press.h from tetrahedra with 1/per_cm cm between corners.
static kn_model_def net_def(kn_simplices **mesh, int per_cm)
{
    kn_model_def def = press_def(per_cm);
    *mesh = bcc_block((const int[3]){5 * per_cm, 5 * per_cm, 3 * per_cm}, def.spacing_m);
    def.mesh = *mesh;
    return def;
}

static double top_height(const kn_model *model, const kn_state *state)
{
    double sum = 0, x[3];
    for (int t = 0; t < model->top_count; t++) {
        kn_state_position(model, state, model->top[t], x);
        sum += model->top_share[t] * x[2];
    }
    return sum;
}

// Return the mean height of the nodes whose rest height is height_m.
static double layer_height(const kn_model *model, const kn_state *state, double height_m)
{
    double sum = 0, x[3];
    int count = 0;
    for (int i = 0; i < model->node_count; i++) {
        if (fabs(model->rest_m[i][2] - height_m) > 1e-6) continue;
        kn_state_position(model, state, i, x);
        sum += x[2];
        count++;
    }
    return sum / count;
}

// Return the strain of a block with a free base and free sides under a constant load, after so many steps of dt. The
// strain is of the whole height, or of the middle third as an extensometer reads it.
static double strain_under(kn_model_def def, double stress_pa, double dt_s, int steps, bool middle)
{
    def.support = KN_SUPPORT_FRICTIONLESS;
    def.probe_count = 0;
    def.solver.dt_s = dt_s;
    def = converged(def);
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    double extent[3];
    kn_model_def_extent(&def, extent);
    kn_input in = {.top_load_n = stress_pa * extent[0] * extent[1]};
    kn_output out;
    for (int i = 0; i < steps; i++) CHECK(kn_step(model, state, &in, &out) == KN_OK);
    double third = extent[2] / 3, strain = 1 - top_height(model, state) / extent[2];
    if (middle) strain = 1 - (layer_height(model, state, 2 * third) - layer_height(model, state, third)) / third;
    return strain;
}

TEST("a block of tetrahedra under a small load has the strain of load over k1 and its own E along z, within 3 %")
{
    for (int per_cm = 1; per_cm <= 2; per_cm++) {
        OWN(kn_simplices) *mesh = NULL;
        kn_model_def def = net_def(&mesh, per_cm);
        def.material = jelly();
        OWN(kn_model) *model = build(&def);
        double strain = strain_under(def, 20, 0.05, 60, false), own = model->moduli.young[2];
        printf("     %d per cm: %.4f %%, element %.4f %%, E along z %.4f\n", per_cm, 100 * strain,
               100 * 20 / def.material.k1_pa, own);
        CHECK_NEAR(strain * own * def.material.k1_pa / 20, 1, 0.03);
        CHECK_NEAR(own, 1, 0.08);
    }
}

// The directions of the springs and E V/L^2 give C11 = 10/9, C12 = C44 = 4/9 of E.
TEST("a body-centred lattice has the elastic constants of its directions: nu 2/7 and shear 4/3 of an isotropic body, "
     "within 4 %")
{
    OWN(kn_simplices) *mesh = NULL;
    kn_model_def def = net_def(&mesh, 2);
    OWN(kn_model) *model = build(&def);
    const kn_net_moduli *own = &model->moduli;
    printf("     E %.3f %.3f %.3f, nu %.3f, G/Giso %.3f, gamma %.3f\n", own->young[0], own->young[1], own->young[2],
           own->poisson, own->shear * 2 * (1 + own->poisson), model->gamma);
    for (int k = 0; k < 3; k++) CHECK_NEAR(own->young[k], 1, 0.04);
    CHECK_NEAR(own->poisson, 2.0 / 7, 0.01);
    CHECK_NEAR(own->shear * 2 * (1 + own->poisson), 4.0 / 3, 0.04);
}

// Return the strain of the element after 60 s under a constant stress: the Voigt element plus the damper.
static double element_strain(const kn_material *m, double stress_pa)
{
    return stress_pa / m->k1_pa * -expm1(-60 * m->k1_pa / m->c1_pa_s) + 60 * kn_material_flow(m, stress_pa);
}

NIGHT_TEST("the middle of a dough block of tetrahedra creeps within 10 % of the element in 60 s at 20 and 30 gf/cm^2")
{
    // Under a dead load the corners, held by few springs, sink deeper than the nodes below once their dampers thin.
    // With 1 cm between corners the whole height shrinks by a quarter more, and no gamma fits both.
    OWN(kn_simplices) *mesh = NULL;
    kn_model_def def = net_def(&mesh, 1);
    for (double gf = 20; gf <= 30; gf += 10) {
        // Twenty times the moduli: the load is then small against k1, so that the block's own area hardly changes.
        kn_model_def stiff = def;
        stiff.material.k1_pa *= 20, stiff.material.c1_pa_s *= 20, stiff.material.alpha_pa_s *= 20;
        double element = element_strain(&stiff.material, gf * GF_CM2);
        double whole = strain_under(stiff, gf * GF_CM2, 0.05, 1200, false);
        double strain = strain_under(stiff, gf * GF_CM2, 0.05, 1200, true);
        printf("     %2.0f gf/cm^2: %.5f, element %.5f, %+.1f %%; whole height %+.1f %%\n", gf, strain, element,
               100 * (strain / element - 1), 100 * (whole / element - 1));
        CHECK_NEAR(strain / element, 1, 0.10);
    }
}

TEST("internal forces sum to zero: a free mesh keeps its momentum to 1e-6 in 200 steps")
{
    OWN(kn_simplices) *mesh = NULL;
    kn_model_def def = net_def(&mesh, 1);
    def.support = KN_SUPPORT_NONE;
    def.probe_count = 0;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.tolerance = 1e-14;
    def.solver.iterations_max = 500;
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    double before[3] = {0}, after[3] = {0}, size = 0;
    for (int i = 0; i < model->node_count; i++)
        for (size_t k = 0; k < 3; k++) {
            double v = 0.05 * sin(1.7 * i + 2.9 * (double)k + 0.01 * i * i);
            ((double *)state->velocity)[model->offset[i] + k] = v;
            before[k] += model->node_mass_kg[i] * v;
            size += model->node_mass_kg[i] * fabs(v);
        }
    kn_input in = {0};
    kn_output out;
    for (int i = 0; i < 200; i++) kn_step(model, state, &in, &out);
    for (int i = 0; i < model->node_count; i++)
        for (size_t k = 0; k < 3; k++)
            after[k] += model->node_mass_kg[i] * ((double *)state->velocity)[model->offset[i] + k];
    for (int k = 0; k < 3; k++) CHECK_NEAR(after[k], before[k], 1e-6 * size);
}

TEST("a copied state of a mesh continues with the same bits")
{
    OWN(kn_simplices) *mesh = NULL;
    kn_model_def def = net_def(&mesh, 1);
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model), *copy = kn_state_create(model);
    press p = {.depth_m = 0.004, .hold_s = 0.05};
    for (int i = 0; i < 200; i++) {
        kn_input in = press_input(model, &p, (i + 1) * 1e-3);
        kn_output out;
        kn_step(model, state, &in, &out);
        if (i == 99) kn_state_copy(model, copy, state);
        if (i > 99) kn_step(model, copy, &in, &out);
        CHECK(i < 99 || kn_state_hash(model, copy) == kn_state_hash(model, state));
    }
    CHECK(state->probe[0].contacts > 0);
}

TEST("a mesh gives the same bits on every instruction set")
{
    OWN(kn_simplices) *mesh = NULL;
    kn_model_def def = net_def(&mesh, 1);
    press p = {.depth_m = 0.004, .hold_s = 0.05};
    for (int kind = 0; kind < 6; kind++) {
        def.solver.precision = (kn_precision)(kind % 2);
        def.pressure = (kn_pressure)(kind / 2);
        def.solver.isa = KN_ISA_BASE;
        AT_END(run_free) run base = press_run(&def, &p, 0.3, 0.1);
        for (kn_isa isa = KN_ISA_AVX2; isa <= KN_ISA_AVX512; isa++) {
            def.solver.isa = isa;
            if (!kn_isa_supported(isa)) continue;
            AT_END(run_free) run other = press_run(&def, &p, 0.3, 0.1);
            CHECK(other.hash == base.hash && peak_n(&base) > 1);
        }
    }
}

// Compare a press of 1 mm by the fast step with Runge-Kutta, with the mass scaled for stability.
static void compare(const char *what, kn_model_def implicit)
{
    implicit.solver.mass_scale = 1000;
    kn_model_def exact = implicit;
    exact.solver.kind = KN_SOLVER_RK4;
    exact.solver.precision = KN_PRECISION_F64;
    exact.solver.dt_s = 4e-5;
    implicit.solver.dt_s = 5e-4;
    implicit = converged(implicit);
    press p = {.depth_m = 0.001, .hold_s = 0.03};
    AT_END(run_free) run oracle = press_run(&exact, &p, 0.16, 1e-2), fast = press_run(&implicit, &p, 0.16, 1e-2);
    CHECK(oracle.status == KN_OK && fast.status == KN_OK);
    printf("     %s: peak %.4f N, Runge-Kutta %.4f N; force %.3f %%, dent %.3f %% apart\n", what, peak_n(&fast),
           peak_n(&oracle), 100 * force_error(&fast, &oracle), 100 * shape_error(&fast, &oracle));
    CHECK(peak_n(&oracle) > 0.1);
    CHECK_NEAR(force_error(&fast, &oracle), 0, 0.01);
    CHECK_NEAR(shape_error(&fast, &oracle), 0, 0.01);
}

TEST("under a plate and under a ball the implicit step of a mesh agrees with Runge-Kutta within 1 %")
{
    OWN(kn_simplices) *mesh = NULL;
    kn_model_def def = net_def(&mesh, 1);
    compare("plate", def);
    def.probe[0] = ball_def(1).probe[0];
    compare("ball", def);
}

NIGHT_TEST("a mesh with gas, closed per element or as a whole, agrees with Runge-Kutta within 1 %")
{
    OWN(kn_simplices) *mesh = NULL;
    kn_model_def def = net_def(&mesh, 1);
    def.pressure = KN_PRESSURE_CELLS;
    compare("cells", def);
    def.pressure = KN_PRESSURE_OBJECT;
    compare("object", def);
}

TESTS_MAIN
