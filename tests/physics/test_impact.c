// Impacts, and plates that slow down or are torn away: the result of one step compared with the converged result.
#include "core/solve/kernel.h"
#include "tests/check.h"
#include "tests/physics/press.h"

// Run one step under a plate that arrives from above at a speed. Return the force on the plate.
static double struck(const kn_model_def *def, double speed_m_s)
{
    OWN(kn_model) *model = build(def);
    OWN(kn_state) *state = kn_state_create(model);
    kn_input in = {.probe[0] = {.attached = true, .velocity_m_s = {0, 0, -speed_m_s}}};
    in.probe[0].position_m[2] = model->rest_m[model->top[0]][2];
    kn_output out;
    CHECK(kn_step(model, state, &in, &out) == KN_OK);
    return out.probe[0].force_n[2];
}

TEST("dough hit at 0.1 to 1 m/s answers in the same millisecond within 5 % of the converged force")
{
    for (int i = 0; i < 3; i++) {
        const double speed[3] = {0.1, 0.3, 1};
        kn_model_def def = press_def(1), exact = converged(def);
        exact.solver.passes = 100;
        CHECK_NEAR(struck(&def, speed[i]) / struck(&exact, speed[i]), 1, 0.05);
    }
}

TEST("a plate torn away at 1 m/s takes no node along")
{
    kn_model_def def = press_def(1);
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    press p = {.depth_m = 0.002, .hold_s = 1};
    kn_input in;
    kn_output out;
    double before[3], after[3];
    int under = model->top[model->top_count / 2];
    for (int i = 1; i <= 200; i++) in = press_input(model, &p, i * 1e-3), kn_step(model, state, &in, &out);
    CHECK(out.probe[0].contacts > 0);
    displacement(model, state, under, before);
    in.probe[0].velocity_m_s[2] = 1;
    kn_step(model, state, &in, &out);
    displacement(model, state, under, after);
    CHECK(out.probe[0].contacts == 0 && out.probe[0].force_n[2] == 0);
    CHECK(fabs(after[2] - before[2]) < 1e-4); // a node taken along would move 1 mm
}

TEST("a heavy node accelerated by a plate keeps flying when the plate slows down")
{
    kn_model_def def = press_def(1);
    def.nodes[0] = def.nodes[1] = def.nodes[2] = 1;
    def.structure = KN_STRUCTURE_AXIS;
    def.support = KN_SUPPORT_NONE;
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    kn_input in = {.probe[0].attached = true};
    kn_output out;
    for (int i = 0; i < 100; i++) { // to 0.1 m/s downwards in 50 ms, and to rest in another 50 ms
        double speed = 0.002 * (i < 50 ? i + 1 : 99 - i);
        in.probe[0].velocity_m_s[2] = -speed;
        kn_step(model, state, &in, &out);
        in.probe[0].position_m[2] -= speed * 1e-3;
    }
    double v[3];
    kn_state_velocity(model, state, 0, v);
    CHECK_NEAR(v[2], -0.1, 3e-3); // the plate lets go one step late
}

TEST("a plate simulated in steps of 0.1 s reaches its pose and does not overshoot")
{
    kn_model_def def = press_def(1);
    def.solver.dt_s = 0.1;
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    kn_input in = {.probe[0].attached = true};
    kn_output out;
    for (int i = 0; i < 20; i++) {
        in.probe[0].position_m[2] = i == 0 ? 0.05 : 0.06; // clear of the block; a jump of 1 cm
        kn_step(model, state, &in, &out);
    }
    CHECK_NEAR(out.probe[0].position_m[2], 0.06, 1e-12);
}

// Release a block whose upper cells start without any volume. Return the height of the middle of the top after so
// many steps.
static double sprung(const kn_model_def *def, int steps)
{
    OWN(kn_model) *model = build(def);
    OWN(kn_state) *state = kn_state_create(model);
    kn_input in = {0};
    kn_output out;
    double u[3];
    for (int i = 0; i < model->top_count; i++)
        kn_real_set(model, state->displacement, model->offset[model->top[i]] + 2 * model->stride, -def->spacing_m);
    for (int i = 0; i < steps; i++) CHECK(kn_step(model, state, &in, &out) == KN_OK);
    displacement(model, state, model->top[model->top_count / 2], u);
    return u[2];
}

TEST("gas that expands at 1 MPa in steps of 10 ms moves the dough like the converged solution, at once and later")
{
    static const int steps[3] = {1, 5, 40};
    for (int i = 0; i < 6; i++) {
        kn_model_def def = press_def(1);
        memcpy(def.nodes, (int[]){4, 3, 3}, sizeof def.nodes);
        def.probe_count = 0;
        def.pressure = i < 3 ? KN_PRESSURE_OBJECT : KN_PRESSURE_CELLS;
        def.inside_pressure_pa = 1e6;
        def.solver.dt_s = 0.01;
        kn_model_def exact = converged(def);
        exact.solver.passes = 100;
        // the error was once up to 1 mm
        CHECK_NEAR(sprung(&def, steps[i % 3]), sprung(&exact, steps[i % 3]), 2e-5);
    }
}

TEST("in a press that comes to rest the solver needs fewer than 60 linearisations and fewer than 5 at the end")
{
    kn_model_def def = converged(press_def(1));
    def.solver.passes = 100;
    def.solver.linearization = KN_LINEARIZATION_BLEND; // the secant converges too slowly
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    press p = {.depth_m = 0.002, .hold_s = 1};
    kn_output out;
    for (int i = 1; i <= 800; i++) {
        kn_input in = press_input(model, &p, i * 1e-3);
        kn_step(model, state, &in, &out);
        CHECK(out.passes < 60);
    }
    CHECK(out.passes < 5);
}

TEST("a scene is refused if its sphere is 500 times as stiff as the object, or if it has gas with 0.1 s steps")
{
    char error[200];
    kn_model_def stiff = ball_def(1), gas = press_def(1);
    stiff.material = jelly();
    stiff.probe[0].foundation_n_m3 = 1e14;
    CHECK(kn_model_build(&stiff, error, sizeof error) == NULL && strstr(error, "500 times as stiff"));
    gas.pressure = KN_PRESSURE_CELLS;
    gas.solver.dt_s = 0.1;
    CHECK(kn_model_build(&gas, error, sizeof error) == NULL && strstr(error, "at most 30 ms"));
}

TEST("a scene is refused if its gas is 10000 times as stiff as the object, or hides the sphere's force in f32")
{
    char error[200];
    kn_model_def stiff = press_def(1), soft = ball_def(1);
    stiff.material = jelly();
    stiff.pressure = soft.pressure = KN_PRESSURE_CELLS;
    stiff.inside_pressure_pa = 1e11;
    CHECK(kn_model_build(&stiff, error, sizeof error) == NULL && strstr(error, "10000 times as stiff"));
    soft.probe[0].foundation_n_m3 = 500;
    CHECK(kn_model_build(&soft, error, sizeof error) == NULL && strstr(error, "needs precision: f64"));
    soft.solver.precision = KN_PRECISION_F64;
    kn_model_destroy(build(&soft));
}

TESTS_MAIN
