// The exponential integral, and a relaxation in closed form compared with the network, which steps through time.
#include "clients/identify/hold.h"
#include "clients/identify/special.h"
#include "core/network.h"
#include "tests/check.h"
#include "tests/dough.h"

static kn_held_element hold_of(const kn_material *m, double begin_pa)
{
    return (kn_held_element){.begin_pa = begin_pa,
                             .alpha_s = m->alpha_pa_s / m->k1_pa,
                             .c1_s = m->c1_pa_s / m->k1_pa,
                             .beta_per_pa = m->beta_per_pa,
                             .p0_pa = m->p0_pa,
                             .p1_pa = m->p1_pa};
}

// Return the largest relative difference between the closed form and the network, over six decades of time after a
// ramp.
static double apart(const kn_material *m, double rate, double *begin_pa)
{
    enum { TIMES = 61 };
    const double rise_s = 0.3 / rate;
    kn_network net = kn_network_of(m);
    kn_network_state at = {0};
    kn_drive ramp = {.kind = KN_DRIVE_STRAIN, .rate_per_s = rate};
    kn_drive held = {.kind = KN_DRIVE_STRAIN, .value = 0.3, .start_s = rise_s};
    double time_s[TIMES], stress_pa[TIMES], worst = 0;
    CHECK(kn_network_jump(&net, &at, &ramp) && kn_network_advance(&net, &at, &ramp, rise_s, 1e-12));
    CHECK(kn_network_jump(&net, &at, &held));
    *begin_pa = at.stress_pa;
    const kn_held_element hold = hold_of(m, at.stress_pa);
    for (int i = 0; i < TIMES; i++) time_s[i] = 0.001 * pow(10, 0.1 * i);
    kn_held_element_stress(&hold, TIMES, time_s, stress_pa);
    for (int i = 0; i < TIMES; i++) {
        // stop at each kink of the damper: a step across a kink is only first-order accurate
        for (int k = 0; k < 2; k++) {
            const double kink = k ? m->p0_pa : m->p1_pa,
                         when = kink < *begin_pa ? kn_held_element_until(&hold, kink) : INFINITY;
            if (when < time_s[i] && rise_s + when > at.time_s)
                CHECK(kn_network_advance(&net, &at, &held, rise_s + when, 1e-13));
        }
        CHECK(kn_network_advance(&net, &at, &held, rise_s + time_s[i], 1e-13));
        if (at.stress_pa > 1e-3 * *begin_pa) worst = fmax(worst, fabs(stress_pa[i] / at.stress_pa - 1));
    }
    return worst;
}

TEST("the exponential integral is what the tables say, on both sides of where its two forms meet")
{
    // Abramowitz and Stegun, table 5.1; the series and the continued fraction in 30 digits.
    static const double known[][2] = {{0.01, 4.037929576538114},  {0.5, 0.5597735947761608},
                                      {1, 0.21938393439552028},   {2, 0.04890051070806112},
                                      {10, 4.156968929685324e-6}, {100, 3.6835977616820322e-46}};
    for (int i = 0; i < 6; i++) CHECK_NEAR(kn_exponential_integral(known[i][0]) / known[i][1], 1, 2e-15);
    CHECK_NEAR(kn_exponential_integral(1 + 1e-9) - kn_exponential_integral(1), -1e-9 * exp(-1.0), 3e-16);
    CHECK(kn_exponential_integral(0) == INFINITY && isnan(kn_exponential_integral(-1)) &&
          kn_exponential_integral(1e4) == 0);
}

TEST("a held element relaxes as the network does, above P1, between P1 and P0, and below P0")
{
    double begin;
    CHECK_NEAR(apart(&dough, 0.02, &begin), 0, 1e-8);
    CHECK(begin > 2 * dough.p0_pa && begin < dough.p1_pa);
    kn_material soft = dough; // soft, so that the ramp ends above P1
    soft.p1_pa = 2000;
    CHECK_NEAR(apart(&soft, 0.02, &begin), 0, 1e-8);
    CHECK(begin > 1.1 * soft.p1_pa);
}

TEST("without c1, without thinning, and under stresses below P0 it relaxes as the network does")
{
    double begin;
    kn_material bare = dough, plain = dough, still = dough;
    bare.c1_pa_s = 1e-3;
    plain.beta_per_pa = 1e-12;
    still.p0_pa = 5e3;
    still.p1_pa = 1e6;
    CHECK_NEAR(apart(&bare, 0.02, &begin), 0, 1e-8);
    CHECK_NEAR(apart(&plain, 0.002, &begin), 0, 1e-8);
    CHECK_NEAR(apart(&still, 0.02, &begin), 0, 1e-8);
    CHECK(begin < still.p0_pa);
    const kn_held_element none = {.begin_pa = 1000, .alpha_s = 10, .p1_pa = INFINITY};
    double t = 20, p;
    kn_held_element_stress(&none, 1, &t, &p);
    CHECK_NEAR(p, 1000 * exp(-2.0), 1e-10);
}

TEST("from 55 gf/cm2 the papers' dough needs 20 s to 28.57; without its dashpot it would need 5.1 s")
{
    const double gf_cm2 = 98.0665;
    kn_held_element hold = hold_of(&dough, 55 * gf_cm2);
    CHECK_NEAR(kn_held_element_until(&hold, 28.57 * gf_cm2), 20.0, 0.02);
    hold.c1_s = 0;
    CHECK_NEAR(kn_held_element_until(&hold, 28.57 * gf_cm2), 5.1, 0.05);
}

TEST("the time to a stress and the stress at a time are each other's inverse, wherever a march begins")
{
    const kn_held_element hold = hold_of(&dough, 12000);
    for (double t = 1e-4; t < 1e5; t *= 3) {
        double p;
        kn_held_element_stress(&hold, 1, &t, &p);
        if (p > 1e-300) CHECK_NEAR(kn_held_element_until(&hold, p) / t, 1, 1e-9);
        if (p > 1e-300)
            CHECK_NEAR(kn_held_element_time(&hold, p) * (kn_held_element_until(&hold, p * (1 - 1e-6)) - t) /
                           pow(kn_held_element_time(&hold, p), 2),
                       1e-6, 1e-9);
    }
}

TEST("numbers at the end of what a search may try give a stress that falls, and no NaN")
{
    const double t[] = {0, 1e-3, 1, 1e3, 1e6};
    const kn_held_element odd[] = {
        {.begin_pa = 3e4, .alpha_s = 1e80, .beta_per_pa = 6e-3, .p1_pa = INFINITY},
        {.begin_pa = 1e6, .alpha_s = 1e-5, .beta_per_pa = 6e-3, .p1_pa = INFINITY},
        {.begin_pa = 1e-3, .alpha_s = 1, .c1_s = 1e5, .beta_per_pa = 1, .p0_pa = 10, .p1_pa = 20},
        {.begin_pa = 1e6, .alpha_s = 1, .beta_per_pa = 1e-3, .p0_pa = 10, .p1_pa = 20}};
    for (int i = 0; i < 4; i++) {
        double p[5];
        kn_held_element_stress(&odd[i], 5, t, p);
        CHECK_NEAR(p[0] / odd[i].begin_pa, 1, 1e-12);
        for (int k = 1; k < 5; k++) CHECK(p[k] >= 0 && p[k] <= p[k - 1] * (1 + 1e-12));
    }
}

TESTS_MAIN
