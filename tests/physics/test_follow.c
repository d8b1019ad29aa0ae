// Late, lost and repeated poses. The probe follows with its velocity, so one bad pose costs a few per cent of the
// force. A plate pinned to the latest pose loses the whole force (12.4 -> 0.14 -> 17.2 N). The server also
// extrapolates an old pose by its velocity; here old poses are used unchanged.
#include "tests/lattice.h"

enum { TICKS = 1000 };

// Run a press whose input arrives as device data do: every 50th pose is late by `late` ms, and the one before
// repeats.
static void press_late(kn_model_def def, int late, double force_n[TICKS])
{
    const press p = {.depth_m = 0.01, .hold_s = 0.5};
    LATTICE l = lattice_of(def);
    for (int i = 1; i <= TICKS; i++) {
        if (i < 50 || i % 50 >= late) l.in = press_input(l.model, &p, i * 1e-3);
        step(&l);
        force_n[i - 1] = l.out.probe[0].force_n[2];
    }
}

TEST("every 50th pose late by 1, 2 or 3 ms changes the force by at most 4, 7 or 10 %")
{
    const kn_model_def defs[3] = {press_def(1), ball_def(1), press_def(2)};
    static double clean[TICKS], force[TICKS];
    for (int t = 0; t < 3; t++) {
        press_late(defs[t], 0, clean);
        for (int late = 1; late <= 3; late++) {
            double worst = 0;
            press_late(defs[t], late, force);
            for (int i = 100; i < TICKS; i++) worst = fmax(worst, fabs(force[i] - clean[i]) / clean[i]);
            printf("     %s, %d ms: at most %.2f %%\n", defs[t].probe[0].name, late, 100 * worst);
            CHECK(worst <= 0.01 + 0.03 * late);
        }
    }
}

TEST("a steady hand is followed exactly, and a jump of the pose is closed with a time constant of 20 ms")
{
    LATTICE l = lattice_of(ball_def(1));
    put(&l, 0, 0, 0, 0.1);
    for (int i = 0; i < 200; i++) {
        move(&l, 0, 0.02, 0, 0, 1);
        CHECK_NEAR(l.out.probe[0].position_m[0], 0.02 * (i + 1) * 1e-3, 1e-12);
    }
    double to = l.in.probe[0].position_m[0] += 1e-3;
    for (int i = 1; i <= 100; i++) {
        step(&l);
        CHECK_NEAR(l.out.probe[0].position_m[0], to - 1e-3 * pow(1 - 1.0 / 20, i), 1e-9);
    }
}
