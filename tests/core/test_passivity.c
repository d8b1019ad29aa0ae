#include "core/passivity.h"
#include "core/algebra/algebra.h"
#include "tests/check.h"

static const double still[3] = {0, 0, 0};

static const kn_passivity_def touch = {
    .mass_kg = 0.08, .round_trip_s = 1e-3, .coupling_n_m = 600.0, .force_limit_n = 3.3};

static kn_passivity with(kn_passivity_def def)
{
    kn_passivity p;
    kn_passivity_init(&p, &def);
    return p;
}

// Run one period at z with a wanted force. The controller's output is the force sent.
static double tick(kn_passivity *p, double z_m, double speed_m_s, double stored_j, double wanted_n)
{
    double out[3];
    kn_passivity_filter(p, (double[3]){0, 0, z_m}, (double[3]){0, 0, speed_m_s}, stored_j, (double[3]){0, 0, wanted_n},
                        out);
    kn_passivity_sent(p, out);
    return out[2];
}

TEST("the energy given is the force sent, not the force wanted, times the distance between two samples, to the bit")
{
    kn_passivity p = with(touch);
    double out[3], sum = 0.0, before[3] = {0}, last[3] = {0};
    for (int n = 0; n < 50; n++) {
        double at[3] = {0.01 + 1e-4 * n, 0.02 - 2e-5 * n * n, 0.03}, force[3] = {0.1 * n, -0.2, 5.0};
        kn_passivity_filter(&p, at, still, 1.0, (double[3]){0, 0, 9.0}, out);
        double moved[3] = {at[0] - before[0], at[1] - before[1], at[2] - before[2]};
        if (n > 0) sum += kn_dot(last, moved);
        memcpy(before, at, sizeof at);
        memcpy(last, force, sizeof force);
        kn_passivity_sent(&p, force);
        CHECK(p.given_j == sum);
    }
}

TEST("in free air the observer counts no energy and the controller does not act")
{
    kn_passivity p = with(touch);
    for (int n = 0; n < 2000; n++) {
        double w = 0.004 * 3.14159 * n;
        CHECK(tick(&p, 0.02 * sin(w), 0.25 * cos(w), 0.0, 0.0) == 0.0);
    }
    CHECK(p.given_j == 0.0 && p.acted == 0 && p.credit_j == 0.0);
}

TEST("a spring returns all its energy without an action of the controller")
{
    kn_passivity p = with(touch);
    const double k = 600.0, depth = 0.004;
    // the force at the middle of each period, so that the zero-order hold adds no energy
    for (int n = 0; n <= 1000; n++) {
        double w = 6.283185307179586e-3;
        double now = depth * 0.5 * (1.0 - cos(w * n)), next = depth * 0.5 * (1.0 - cos(w * (n + 1)));
        double wanted = k * 0.5 * (now + next);
        CHECK(tick(&p, -now, -(next - now) / 1e-3, 0.0, wanted) == wanted);
    }
    CHECK(p.acted == 0);
    CHECK_NEAR(p.given_j, 0.0, 1e-9);
}

TEST("long kneading earns a credit of at most 1 mJ beyond the stored energy")
{
    kn_passivity p = with(touch);
    for (int n = 0; n < 3000; n++) tick(&p, -1e-5 * n, -0.01, 0.0, 1.0); // dissipates 30 mJ
    CHECK_NEAR(p.given_j, -30e-3, 1e-4);
    CHECK_NEAR(p.credit_j, 1e-3 + 1.0 / 1200.0, 2e-5);
    // the tool is pushed out with 1 N
    for (int n = 0; n < 300 && !p.acted; n++) tick(&p, -0.03 + 1e-4 * n, 0.1, 0.0, 1.0);
    CHECK(p.acted > 0);
    double gained = p.given_j + 30e-3;
    CHECK(gained < 1e-3 + 1.0 / 1200.0 + 3e-4); // the controller acts a few periods late, 0.1 mJ each
}

TEST("if the stored energy is unknown, the credit is the larger of 5 mJ and twice the coupling's capacity")
{
    for (int i = 0; i < 2; i++) {
        kn_passivity_def def = touch;
        if (i) def.coupling_n_m = 3e5;
        kn_passivity p = with(def);
        for (int n = 0; n < 3000; n++) tick(&p, -1e-4 * n, -0.1, -1.0, 1.0);
        CHECK_NEAR(p.credit_j, i ? 5e-3 : 3.3 * 3.3 / 600.0, 1.1e-4);
    }
}

TEST("with the controller an active object gives the hand less than a tenth of the energy")
{
    double given[2];
    for (int i = 0; i < 2; i++) { // a mass on a spring with negative damping: x'' = (-k x + 2 v) / m
        kn_passivity p = with(touch);
        double x = 2e-3, v = 0.0, force = 0.0;
        for (int n = 0; n < 300; n++) {
            double wanted = -300.0 * x + 2.0 * v;
            force = i ? tick(&p, x, v, 0.0, wanted) : (tick(&p, x, v, 0.0, wanted), wanted);
            kn_passivity_sent(&p, (double[3]){0, 0, force});
            v += 1e-3 / 0.08 * force;
            x += 1e-3 * v;
        }
        given[i] = p.given_j;
    }
    CHECK(given[0] > 10e-3);
    CHECK(given[1] < 0.1 * given[0]);
}

TEST("the damping is at most m / 2 (T + t_d + 1/w_f), and at most 10 N s/m for heavy devices")
{
    kn_passivity_def light = touch, heavy = touch;
    light.mass_kg = 0.05, heavy.mass_kg = 0.3;
    kn_passivity p = with(light);
    CHECK_NEAR(p.def.damping_max_n_s_m, 0.05 / (2.0 * (1e-3 + 1e-3 + 1.0 / 628.3185307)), 1e-6);
    p = with(heavy);
    CHECK(p.def.damping_max_n_s_m == 10.0);
    tick(&p, 0.0, 0.0, 0.0, 1.0);
    CHECK_NEAR(tick(&p, 0.1, 0.2, 0.0, 1.0), 1.0 - 10.0 * 0.2, 1e-12); // 100 mJ in debt
    CHECK(p.damping_n_s_m == 10.0);
}

TEST("an energy debt is not paid in free air: the debt fades within 100 ms, and the forgiven energy is counted")
{
    kn_passivity p = with(touch);
    tick(&p, 0.0, 0.0, 0.0, 1.0);
    tick(&p, 0.005, 0.1, 0.0, 0.0); // 5 mJ given, then no force
    for (int n = 0; n < 100; n++) CHECK(tick(&p, 0.005 + 1e-4 * n, 0.1, 0.0, 0.0) == 0.0);
    CHECK_NEAR(p.credit_j, -5e-3 * exp(-1.01), 1e-5);
    CHECK_NEAR(p.forgiven_j, 5e-3 * (1.0 - exp(-1.01)), 1e-5);
    CHECK(p.acted == 0);
}

TEST("a light touch through a coarse encoder looks like energy given, and a known encoder step prevents damping")
{
    int64_t acted[2];
    for (int i = 0; i < 2; i++) {
        kn_passivity_def def = touch;
        def.encoder_m = i ? 40e-6 : 0.0;
        kn_passivity p = with(def);
        for (int n = 0; n < 5000; n++) { // 0.1 mm in and out of a spring with a little friction, read in steps of 40 um
            double w = 0.0125, x = 5e-5 * (1.0 - cos(w * n)), v = 5e-5 * w * 1e3 * sin(w * n);
            double read = 40e-6 * round(x / 40e-6), noise = n % 5 ? 0.0 : 40e-6 * (n % 2 ? 1 : -1);
            tick(&p, -read + 0.3 * noise, -v, -1.0, 600.0 * read);
        }
        acted[i] = p.acted;
    }
    CHECK(acted[0] > 100);
    CHECK(acted[1] == 0);
}

TEST("a position that is NaN is skipped")
{
    kn_passivity p = with(touch);
    tick(&p, 0.0, 0.0, 0.0, 1.0);
    tick(&p, NAN, 0.0, 0.0, 1.0);
    tick(&p, -0.001, 0.0, 0.0, 1.0);
    CHECK_NEAR(p.given_j, -1e-3, 1e-15);
}
