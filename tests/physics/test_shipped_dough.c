// The default dough is faithful: a cube of its lattice under a weight creeps and recovers as the first paper's element.
// gate in release: some ten thousand steps
#include "core/level_plate.h"
#include "tests/lattice.h"
#include "tests/physics/press.h"

TEST("the shipped dough creeps and recovers under a weight as the first paper's element")
{
    // heights of the element after 60 s under each load, and 65 s later: knead creep dough --rest 65
    static const double load_gf[] = {10, 30, 50, 70, 90}, low[] = {0.9637, 0.7901, 0.5266, 0.3520, 0.2536},
                        left[] = {0.9842, 0.8412, 0.5841, 0.4062, 0.3038};
    double mean = 0;
    for (int k = 0; k < 5; k++) {
        static const char *const cube[] = {"object.size=[1 cm, 1 cm, 1 cm]",
                                           "support=frictionless",
                                           "probes.plate.size=[2 cm, 2 cm]",
                                           "solver.dt=30 ms",
                                           "solver.passes=12",
                                           "solver.iterations_max=300"};
        LATTICE l = lattice_of_scene(load_scene("dough.yaml", cube, 6));
        kn_level_plate plate = {0};
        OWN(kn_state) *trial = kn_state_create(l.model);
        kn_level_plate_lower(&plate, l.model, l.state);
        for (int i = 0; i < 2000; i++)
            CHECK(kn_level_plate_step(&plate, l.model, l.state, trial, l.scratch, load_gf[k] * GF_N, &l.in, &l.out) ==
                  KN_PLATE_CARRIED);
        const double off = (1 - 100 * plate.height_m) / (1 - low[k]) - 1;
        for (int i = 0; i < 2167; i++) CHECK(kn_step(l.model, l.state, l.scratch, &l.in, &l.out) == KN_OK);
        double mean_m = 0, x[3]; // the top is dented, so its mean height counts
        for (int t = 0; t < l.model->top_count; t++) {
            kn_state_position(l.model, l.state, l.model->top[t], x);
            mean_m += l.model->top_share[t] * x[2];
        }
        printf("     %g gf: creep %+.1f %%, height 65 s later %+.1f %%\n", load_gf[k], 100 * off,
               100 * (100 * mean_m / left[k] - 1));
        CHECK(fabs(off) < 0.045);
        CHECK_NEAR(100 * mean_m, left[k], 0.078 * left[k]);
        mean += fabs(off) / 5;
    }
    CHECK(mean < 0.025);
}
