// The fast step against the papers' own method: explicit Runge-Kutta in f64, with the mass scaled so that it is stable.
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

TEST("the force of a press by the implicit step agrees with Runge-Kutta within 1 %, and so does the dent")
{
    press p = {.depth_m = 0.002, .hold_s = 0.05};
    kn_model_def exact = rk4_def(1.8e-5, 100), implicit = converged(press_def(1));
    implicit.solver.mass_scale = 100;
    implicit.solver.dt_s = 2.5e-4;
    run oracle = press_run(&exact, &p, 0.405, 9e-3), fast = press_run(&implicit, &p, 0.405, 9e-3);
    CHECK(oracle.status == KN_OK && fast.status == KN_OK);
    printf("     peak %.4f N, Runge-Kutta %.4f N; force %.3f %%, dent %.3f %% apart\n", peak_n(&fast), peak_n(&oracle),
           100 * force_error(&fast, &oracle), 100 * shape_error(&fast, &oracle));
    CHECK(peak_n(&oracle) > 1);
    CHECK_NEAR(force_error(&fast, &oracle), 0, 0.01);
    CHECK_NEAR(shape_error(&fast, &oracle), 0, 0.02);
    run_free(&oracle);
    run_free(&fast);
}

TESTS_MAIN
