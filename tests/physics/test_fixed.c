// The lattice in integers behaves as the lattice: pressed, its force is within half a per cent of the f64 force.
// KN_HOLD=30 holds the dough as long as the first paper did.
#include "core/solver_fixed.h"
#include "tests/lattice.h"

static kn_model_def fixed(kn_model_def def)
{
    def.solver.kind = KN_SOLVER_FIXED;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.passes = 2;
    def.solver.iterations = 8;
    return def;
}

static void compare(const char *name, kn_model_def def, double depth_m, double hold_s, double bound)
{
    const press p = {.depth_m = depth_m, .hold_s = hold_s};
    const double seconds = press_up_s(&p) + depth_m / PRESS_SPEED + 0.5;
    const kn_model_def integers = fixed(def), reals = converged(def);
    AT_END(run_free) run a = press_run(&integers, &p, seconds, 1e-3), b = press_run(&reals, &p, seconds, 1e-3);
    double apart = 0; // largest difference of the shapes, relative to the depth of the press
    for (int i = 0; i < 3 * a.nodes; i++)
        apart = fmax(apart, fabs((&a.shape_m[0][0])[i] - (&b.shape_m[0][0])[i]) / depth_m);
    printf("     %s: peak %.3g N, force %.3f %%, shape %.4f %% of the depth, total variation %.2f (%.2f)\n", name,
           peak_n(&b), 100 * force_error(&a, &b), 100 * apart, variation(&a), variation(&b));
    CHECK(a.status == KN_OK && force_error(&a, &b) < bound && apart < bound);
}

TEST("dough in fixed point under a plate matches f64 within 0.5 % in force and shape")
{
    const char *hold = getenv("KN_HOLD");
    compare("144 nodes", press_def(1), 0.01, hold ? atof(hold) : 2, 0.005);
}

NIGHT_TEST("a dough of 847 nodes in fixed point matches f64 within 2 % in force and shape, with few iterations")
{
    compare("847 nodes", press_def(2), 0.003, 0.2, 0.02);
}

TEST("in fixed point jelly and clay match f64 within 1 %, and dough under a ball or with gas, whose forces use the "
     "start "
     "of the step, within 2 %")
{
    kn_model_def def = press_def(1);
    def.material = jelly();
    compare("jelly", def, 0.005, 1, 0.01);
    def.material = clay();
    compare("clay", def, 0.005, 1, 0.01);
    compare("ball", ball_def(1), 0.005, 1, 0.02);
    def = press_def(1);
    def.pressure = KN_PRESSURE_CELLS, def.inside_pressure_pa = 101325;
    compare("each cell", def, 0.005, 1, 0.02);
    def.pressure = KN_PRESSURE_OBJECT;
    compare("one skin", def, 0.005, 1, 0.02);
}

TEST("a scene that fixed point cannot represent is refused with the reason")
{
    kn_model_def def = fixed(press_def(1));
    def.support = KN_SUPPORT_NONE;
    refused(def, "no inertia");
    def = fixed(press_def(1)), def.material = jelly(), def.pressure = KN_PRESSURE_CELLS, def.inside_pressure_pa = 1e6;
    refused(def, "gas is too stiff");
    def = fixed(ball_def(1)), def.material = jelly(), def.probe[0].foundation_n_m3 = 1e9;
    refused(def, "a softer foundation");
    def = fixed(press_def(1)), def.material.ratio = 0.2, def.material.stroke[0] = 0.02, def.material.stroke[1] = 0.98;
    refused(def, "no end stops");
    def = fixed(press_def(1)), def.material.c1_pa_s *= 1e4;
    refused(def, "a damper's flow");
    def = fixed(press_def(4)), def.solver.passes = def.solver.iterations = 1;
    refused(def, "a press with 1 passes of 1 iterations");
    def = fixed(press_def(1)), def.solver.precision = KN_PRECISION_F32;
    refused(def, "f64 only");
}
