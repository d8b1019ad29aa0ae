// The lattice in integers behaves as the lattice: pressed, its force is within half a per cent of the f64 force.
// KN_HOLD=30 holds the dough as long as the first paper did.
#include "core/solver_fixed.h"
#include "tests/check.h"
#include "tests/physics/press.h"

static kn_model_def fixed(kn_model_def def)
{
    def.solver.kind = KN_SOLVER_FIXED;
    def.solver.precision = KN_PRECISION_F64;
    def.solver.passes = 2;
    def.solver.iterations = 8;
    return def;
}

static double peak_error(const run *a, const run *b)
{
    double most = 0;
    for (int i = 0; i < a->samples; i++) most = fmax(most, fabs(a->force_n[i][2] - b->force_n[i][2]));
    return most / peak_n(b);
}

// Return the largest difference of two shapes, relative to the depth of the press.
static double shape_apart(const run *a, const run *b, double depth_m)
{
    double most = 0;
    for (int i = 0; i < a->nodes; i++)
        for (int k = 0; k < 3; k++) most = fmax(most, fabs(a->shape_m[i][k] - b->shape_m[i][k]));
    return most / depth_m;
}

static void compare(const char *name, kn_model_def def, double depth_m, double hold_s, double force, double shape)
{
    const press p = {.depth_m = depth_m, .hold_s = hold_s};
    const double seconds = press_up_s(&p) + depth_m / PRESS_SPEED + 0.5;
    const kn_model_def integers = fixed(def), reals = converged(def);
    AT_END(run_free) run a = press_run(&integers, &p, seconds, 1e-3), b = press_run(&reals, &p, seconds, 1e-3);
    printf("     %s: peak %.3g N, force %.3f %%, at most %.2f %% of the peak, shape %.4f %% of the depth, total "
           "variation %.2f (%.2f)\n",
           name, peak_n(&b), 100 * force_error(&a, &b), 100 * peak_error(&a, &b), 100 * shape_apart(&a, &b, depth_m),
           variation(&a), variation(&b));
    CHECK(a.status == KN_OK && force_error(&a, &b) < force && shape_apart(&a, &b, depth_m) < shape);
}

TEST("dough in fixed point under a plate matches f64 within 0.5 % in force and shape")
{
    const char *hold = getenv("KN_HOLD");
    compare("144 nodes", press_def(1), 0.01, hold ? atof(hold) : 2, 0.005, 0.005);
}

NIGHT_TEST("a dough of 847 nodes in fixed point matches f64 within 2 % in force and shape, with few iterations")
{
    compare("847 nodes", press_def(2), 0.003, 0.2, 0.02, 0.02);
}

TEST("jelly and clay in fixed point match f64 within 1 % in force and shape")
{
    kn_model_def def = press_def(1);
    def.material = jelly();
    compare("jelly", def, 0.005, 1, 0.01, 0.01);
    def.material = clay();
    compare("clay", def, 0.005, 1, 0.01, 0.01);
}

TEST("dough in fixed point under a ball, whose force uses the depth at the start of the step, matches f64 within 2 %")
{
    compare("ball", ball_def(1), 0.005, 1, 0.02, 0.02);
}

TEST("dough in fixed point with gas, whose pressure uses the volume at the start of the step, matches f64 within 2 %")
{
    kn_model_def def = press_def(1);
    def.pressure = KN_PRESSURE_CELLS, def.inside_pressure_pa = 101325;
    compare("each cell", def, 0.005, 1, 0.02, 0.02);
    def.pressure = KN_PRESSURE_OBJECT;
    compare("one skin", def, 0.005, 1, 0.02, 0.02);
}

TEST("a copied fixed-point state continues with the same bits")
{
    const kn_model_def def = fixed(press_def(1));
    const press p = {.depth_m = 0.004, .hold_s = 0.1};
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *a = kn_state_create(model), *b = kn_state_create(model), *kept = kn_state_keep(model);
    kn_output out;
    for (int i = 0; i < 400; i++) {
        kn_input in = press_input(model, &p, (i + 1) * 1e-3);
        kn_step(model, a, &in, &out);
        if (i == 200) kn_state_copy(model, kept, a), kn_state_copy(model, b, kept);
        if (i > 200) kn_step(model, b, &in, &out);
    }
    CHECK(kn_state_hash(model, a) == kn_state_hash(model, b));
}

static void refused(kn_model_def def, const char *why)
{
    char error[256] = "";
    OWN(kn_model) *model = kn_model_build(&def, error, sizeof error);
    if (model || !strstr(error, why)) KN_TEST_FAIL("%s, expected: %s", model ? "built" : error, why);
}

TEST("a scene that fixed point cannot represent is refused with the reason")
{
    kn_model_def def = fixed(press_def(1));
    def.support = KN_SUPPORT_NONE;
    refused(def, "no inertia");
    def = fixed(press_def(1)), def.material = jelly(), def.pressure = KN_PRESSURE_CELLS, def.inside_pressure_pa = 1e6;
    refused(def, "gas from the start of the step");
    def = fixed(ball_def(1)), def.material = jelly(), def.probe[0].foundation_n_m3 = 1e9;
    refused(def, "a softer one");
    def = fixed(press_def(1)), def.material.ratio = 0.2, def.material.stroke[0] = 0.02, def.material.stroke[1] = 0.98;
    refused(def, "no end stops");
    def = fixed(press_def(1)), def.material.c1_pa_s *= 1e4;
    refused(def, "a damper's flow");
    def = fixed(press_def(4)), def.solver.passes = def.solver.iterations = 1;
    refused(def, "unsolved with 1 passes of 1 iterations");
    def = fixed(press_def(1)), def.solver.precision = KN_PRECISION_F32;
    refused(def, "f64 only");
}

TESTS_MAIN
