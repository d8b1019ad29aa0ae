// Blows, and plates that slow down or are torn away: the answer of one step beside the converged one.
#include "tests/check.h"
#include "tests/physics/press.h"

// One step under a plate that has come from above at a speed; the force on it.
static double struck(const kn_model_def *def, double speed_m_s)
{
    kn_model *model = build(def);
    kn_state *state = kn_state_create(model);
    kn_input in = {.probe[0] = {.attached = true, .velocity_m_s = {0, 0, -speed_m_s}}};
    in.probe[0].position_m[2] = model->rest_m[model->top[0]][2];
    kn_output out;
    CHECK(kn_step(model, state, &in, &out) == KN_OK);
    kn_state_destroy(state);
    kn_model_destroy(model);
    return out.probe[0].force_n[2];
}

TEST("dough struck at 0.1 to 1 m/s answers in the same millisecond with the force that it has, not with twice that")
{
    for (int i = 0; i < 3; i++) {
        const double speed[3] = {0.1, 0.3, 1};
        kn_model_def def = press_def(1), exact = converged(def);
        exact.solver.passes = 100;
        CHECK_NEAR(struck(&def, speed[i]) / struck(&exact, speed[i]), 1, 0.05);
    }
}

TEST("a plate that is torn away at 1 m/s takes nothing along")
{
    kn_model_def def = press_def(1);
    kn_model *model = build(&def);
    kn_state *state = kn_state_create(model);
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
    CHECK(fabs(after[2] - before[2]) < 1e-4); // it would be 1 mm
    kn_state_destroy(state);
    kn_model_destroy(model);
}

TEST("a heavy node that a plate has thrown flies on when the plate slows down")
{
    kn_model_def def = press_def(1);
    def.nodes[0] = def.nodes[1] = def.nodes[2] = 1;
    def.structure = KN_STRUCTURE_AXIS;
    def.support = KN_SUPPORT_NONE;
    kn_model *model = build(&def);
    kn_state *state = kn_state_create(model);
    kn_input in = {.probe[0].attached = true};
    kn_output out;
    for (int i = 0; i < 100; i++) { // to 0.1 m/s downwards in 50 ms, and to rest in as many
        double speed = 0.002 * (i < 50 ? i + 1 : 99 - i);
        in.probe[0].velocity_m_s[2] = -speed;
        kn_step(model, state, &in, &out);
        in.probe[0].position_m[2] -= speed * 1e-3;
    }
    double v[3];
    kn_state_velocity(model, state, 0, v);
    CHECK_NEAR(v[2], -0.1, 3e-3); // let go one step late
    kn_state_destroy(state);
    kn_model_destroy(model);
}

TEST("a plate in steps of 0.1 s is where its pose is, not past it")
{
    kn_model_def def = press_def(1);
    def.solver.dt_s = 0.1;
    kn_model *model = build(&def);
    kn_state *state = kn_state_create(model);
    kn_input in = {.probe[0].attached = true};
    kn_output out;
    for (int i = 0; i < 20; i++) {
        in.probe[0].position_m[2] = i == 0 ? 0.05 : 0.06; // clear of the block; 1 cm at once
        kn_step(model, state, &in, &out);
    }
    CHECK_NEAR(out.probe[0].position_m[2], 0.06, 1e-12);
    kn_state_destroy(state);
    kn_model_destroy(model);
}

TEST("a scene is refused whose sphere is a thousand times as stiff as its object, or whose gas takes 0.1 s steps")
{
    char error[200];
    kn_model_def stiff = ball_def(1), gas = press_def(1);
    stiff.material = jelly();
    stiff.probe[0].foundation_n_m3 = 1e14;
    CHECK(kn_model_build(&stiff, error, sizeof error) == NULL && strstr(error, "1000 times as stiff"));
    gas.pressure = KN_PRESSURE_CELLS;
    gas.solver.dt_s = 0.1;
    CHECK(kn_model_build(&gas, error, sizeof error) == NULL && strstr(error, "at most 30 ms"));
}

TESTS_MAIN
