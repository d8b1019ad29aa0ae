// Late, lost and repeated poses. The probe follows with its velocity, so one bad pose costs a few per cent of the
// force. A plate pinned to the latest pose loses the whole force (12.4 -> 0.14 -> 17.2 N). The server also
// extrapolates an old pose by its velocity; here old poses are used unchanged.
#include "tests/check.h"
#include "tests/physics/press.h"

// Run a press whose input arrives as device data do: every 50th pose is late by `late` ms, and the one before
// repeats.
static run press_late(kn_model_def def, const press *p, double seconds, int late)
{
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    int steps = (int)lround(seconds * 1000);
    run r = {.samples = steps, .force_n = calloc((size_t)steps, sizeof *r.force_n)};
    kn_input in = {0};
    for (int i = 1; i <= steps; i++) {
        kn_output out;
        if (i < 50 || i % 50 >= late) in = press_input(model, p, i * 1e-3);
        CHECK(kn_step(model, state, &in, &out) == KN_OK);
        memcpy(r.force_n[i - 1], out.probe[0].force_n, sizeof *r.force_n);
    }
    return r;
}

TEST("every 50th pose late by 1, 2 or 3 ms changes the force by at most 4, 7 or 10 %")
{
    press p = {.depth_m = 0.01, .hold_s = 0.5};
    for (int t = 0; t < 4; t++) {
        kn_model_def def = t % 2 ? ball_def(1) : press_def(t / 2 + 1);
        AT_END(run_free) run clean = press_late(def, &p, 1, 0);
        for (int late = 1; late <= 3; late++) {
            AT_END(run_free) run r = press_late(def, &p, 1, late);
            double worst = 0;
            for (int i = 100; i < r.samples; i++)
                worst = fmax(worst, fabs(r.force_n[i][2] - clean.force_n[i][2]) / clean.force_n[i][2]);
            printf("     %s, %d ms: at most %.2f %%\n", def.probe[0].name, late, 100 * worst);
            CHECK(worst <= 0.01 + 0.03 * late);
        }
    }
}

TEST("a steady hand is followed exactly, and a jump of the pose is closed with a time constant of 20 ms")
{
    kn_model_def def = ball_def(1);
    OWN(kn_model) *model = build(&def);
    OWN(kn_state) *state = kn_state_create(model);
    kn_input in = {0};
    kn_output out;
    in.probe[0] = (kn_probe_input){.attached = true, .position_m = {0, 0, 0.1}, .velocity_m_s = {0.02, 0, 0}};
    for (int i = 0; i < 200; i++) {
        in.probe[0].position_m[0] = 0.02 * i * 1e-3;
        kn_step(model, state, &in, &out);
        CHECK_NEAR(out.probe[0].position_m[0], 0.02 * (i + 1) * 1e-3, 1e-12);
    }
    double from = out.probe[0].position_m[0], to = from + 1e-3;
    in.probe[0].velocity_m_s[0] = 0;
    in.probe[0].position_m[0] = to;
    for (int i = 1; i <= 100; i++) {
        kn_step(model, state, &in, &out);
        CHECK_NEAR(out.probe[0].position_m[0], to - 1e-3 * pow(1 - 1.0 / 20, i), 1e-9);
    }
}

TESTS_MAIN
