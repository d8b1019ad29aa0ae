#include "core/coupling.h"
#include "tests/check.h"

static const double period = 1e-3;

TEST("the default coupling is the ceiling of each device class up to a round trip of one period, and decreases beyond")
{
    const struct {
        double mass, damping;
        kn_coupling most;
        double at_2_ms, at_10_ms;
    } row[] = {
        {0.08, 0.1, {600, 1.5}, 384.0, 91.4}, // Touch
        {0.2, 0.5, {1200, 3}, 840.0, 200.0},  // Falcon
        {0.2, 0.5, {1500, 4}, 1080.0, 257.1}, // omega
        {0.05, 0.05, {500, 1.5}, 372.0, 88.6} // an unknown device
    };
    for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
        for (int rtt = 0; rtt <= 1; rtt++) {
            kn_coupling c = kn_coupling_default(row[i].mass, row[i].damping, period, 1e-3 * rtt, row[i].most);
            CHECK(c.stiffness_n_m == row[i].most.stiffness_n_m && c.damping_n_s_m == row[i].most.damping_n_s_m);
        }
        kn_coupling two = kn_coupling_default(row[i].mass, row[i].damping, period, 2e-3, row[i].most);
        kn_coupling ten = kn_coupling_default(row[i].mass, row[i].damping, period, 10e-3, row[i].most);
        CHECK_NEAR(two.stiffness_n_m, row[i].at_2_ms, 0.05);
        CHECK_NEAR(ten.stiffness_n_m, row[i].at_10_ms, 0.05);
    }
}

TEST("the coupling's damping stays below 0.5 m / (t_d + T + 1.6 ms): a light device on a slow link has little damping")
{
    kn_coupling c = kn_coupling_default(0.05, 0.05, period, 47.4e-3, (kn_coupling){500, 1.5});
    CHECK_NEAR(c.damping_n_s_m, 0.5 * 0.05 / 0.05, 1e-12);
    CHECK_NEAR(c.stiffness_n_m, 0.6 * (0.05 + 0.5) / 0.0479, 1e-9);
}

TEST("a default coupling is within the stability bound for every device and round trip")
{
    for (double m = 0.01; m < 2; m *= 2)
        for (double b = 0.01; b < 20; b *= 3)
            for (double t = 0; t < 0.2; t += 0.007) {
                kn_coupling c = kn_coupling_default(m, b, period, t, (kn_coupling){5000, 20});
                CHECK(c.stiffness_n_m <= 0.6 * kn_coupling_delayed(b, period, t, c.damping_n_s_m) * (1 + 1e-12));
                CHECK(c.stiffness_n_m > 0);
            }
}

TEST("Colgate's bound ignores the delay and falls with b_vc; the delayed bound falls with the delay")
{
    CHECK_NEAR(kn_coupling_colgate(1.0, period, 0.0), 2000.0, 1e-9);
    CHECK_NEAR(kn_coupling_colgate(1.0, period, 0.5), 1000.0, 1e-9);
    CHECK(kn_coupling_colgate(1.0, period, 2.0) == 0.0);
    CHECK_NEAR(kn_coupling_delayed(0.05, period, 0.0, 2.0), 4100.0, 1e-9);
    CHECK_NEAR(kn_coupling_delayed(0.05, period, 5e-3, 2.0), 2.05 / 5.5e-3, 1e-9);
}
