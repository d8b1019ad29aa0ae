// The fast step compared with the papers' own method: explicit Runge-Kutta in f64, with the mass scaled for
// stability.
#include "tests/check.h"
#include "tests/physics/press.h"

static void compare(kn_model_def implicit, const press *p, double seconds, double bound)
{
    kn_model_def exact = implicit;
    exact.solver.kind = KN_SOLVER_RK4;
    exact.solver.precision = KN_PRECISION_F64;
    exact.solver.mass_scale = implicit.solver.mass_scale = 100;
    exact.solver.dt_s = 1.8e-5; // just below the stability limit
    implicit.solver.dt_s = 2.5e-4;
    implicit = converged(implicit);
    AT_END(run_free) run oracle = press_run(&exact, p, seconds, 9e-3), fast = press_run(&implicit, p, seconds, 9e-3);
    CHECK(oracle.status == KN_OK && fast.status == KN_OK);
    printf("     %s: peak %.4f N, Runge-Kutta %.4f N; force %.3f %%, dent %.3f %% apart\n", implicit.probe[0].name,
           peak_n(&fast), peak_n(&oracle), 100 * force_error(&fast, &oracle), 100 * shape_error(&fast, &oracle));
    CHECK(peak_n(&oracle) > 0.1);
    CHECK_NEAR(force_error(&fast, &oracle), 0, bound);
    CHECK_NEAR(shape_error(&fast, &oracle), 0, bound);
}

NIGHT_TEST("under a plate the force and the dent of the implicit step agree with Runge-Kutta within 1 %")
{
    press p = {.depth_m = 0.001, .hold_s = 0.05}; // down, held, lifted off
    compare(press_def(1), &p, 0.225, 0.01);
}

TEST("under a ball the force and the dent of the implicit step agree with Runge-Kutta within 1 %")
{
    press p = {.depth_m = 0.001, .hold_s = 0.03};
    compare(ball_def(1), &p, 0.18, 0.01);
}

TESTS_MAIN
