// clients/identify/element_response.h compared with core/network.h, which steps through time. The two share only the
// equations and the coefficients of the time integration (kn_sdirk_row).
#include "clients/identify/element_response.h"
#include "tests/clients/made.h"

enum { READINGS = 433 };

// Return the same chain as a network: the series damper, then the spring, then the (s|d) elements.
static kn_network network_of(const kn_voigt_chain *c, const char *expression)
{
    kn_network net = {0};
    char error[200];
    CHECK(kn_element_parse(&net.element, expression, error, sizeof error));
    int leaf = 0;
    if (c->alpha_pa_s > 0)
        net.part[leaf++] =
            (kn_part){.modulus = c->alpha_pa_s, .beta_per_pa = c->beta_per_pa, .p0_pa = c->p0_pa, .p1_pa = c->p1_pa};
    if (c->spring_pa > 0) net.part[leaf++].modulus = c->spring_pa;
    for (int i = 0; i < c->voigts; i++) {
        net.part[leaf++].modulus = c->k_pa[i];
        net.part[leaf++].modulus = c->c_pa_s[i];
    }
    return net;
}

static double furthest(const kn_voigt_chain *c, const char *expression, int steps, const kn_voigt_chain_step *step,
                       bool constant)
{
    static double time_s[READINGS], mine[READINGS], theirs[READINGS];
    kn_network net = network_of(c, expression);
    kn_drive drive[4];
    double worst = 0, largest = 0;
    for (int i = 0; i < steps; i++)
        drive[i] = (kn_drive){
            .kind = constant ? KN_DRIVE_STRESS : KN_DRIVE_LOAD, .value = step[i].value, .start_s = step[i].time_s};
    for (int i = 0; i < READINGS; i++) time_s[i] = 0.3 * (i + 1);
    respond(&net, steps, drive, 1e-11, READINGS, time_s, NULL, theirs);
    CHECK(kn_voigt_chain_creep(c, constant, steps, step, READINGS, time_s, mine));
    for (int i = 0; i < READINGS; i++) {
        worst = fmax(worst, fabs(mine[i] - theirs[i]));
        largest = fmax(largest, theirs[i]);
    }
    return worst / largest;
}

TEST("chains of dough, of Burgers and of a spring with two Voigt elements creep and recover like the network, through "
     "any sequence of loads")
{
    const kn_voigt_chain chain = kn_voigt_chain_of(&dough),
                         burgers = {.spring_pa = 3e5, .voigts = 1, .k_pa = {1e5}, .c_pa_s = {2e5}, .alpha_pa_s = 4e6},
                         row = {.spring_pa = 3e5, .voigts = 2, .k_pa = {1e5, 4e4}, .c_pa_s = {2e2, 2e5}}; // one is fast
    const kn_voigt_chain_step pressed[2] = {{0, 50 * GF_CM2}, {60, 0}},
                              many[4] = {{0, 20 * GF_CM2}, {20, 45 * GF_CM2}, {40, 10 * GF_CM2}, {80, 0}};
    for (int load = 10; load <= 90; load += 20)
        CHECK_NEAR(furthest(&chain, "d-(s|d)", 2, (kn_voigt_chain_step[]){{0, load * GF_CM2}, {60, 0}}, false), 0,
                   2e-5);
    for (int constant = 0; constant < 2; constant++)
        CHECK_NEAR(furthest(&chain, "d-(s|d)", 4, many, constant), 0, 1e-6);
    CHECK_NEAR(furthest(&burgers, "d-s-(s|d)", 2, pressed, false), 0, 1e-6);
    CHECK_NEAR(furthest(&row, "s-(s|d)-(s|d)", 2, pressed, false), 0, 1e-6);
}

TEST("the stress of the chain in a ramp and a hold is the stress of the network")
{
    static const kn_drive drive[] = {{.kind = KN_DRIVE_STRAIN, .rate_per_s = 0.02},
                                     {.kind = KN_DRIVE_STRAIN, .value = 0.3, .start_s = 15}};
    static double time_s[600], mine[600], theirs[600];
    const kn_voigt_chain chain = kn_voigt_chain_of(&dough);
    const kn_network net = network_of(&chain, "d-(s|d)");
    const kn_voigt_chain_step step[2] = {{0, 0}, {15, 0.3}};
    for (int i = 0; i < 600; i++) time_s[i] = 0.5 * (i + 1) + 0.1;
    CHECK(kn_voigt_chain_stress(&chain, 2, step, 600, time_s, mine));
    respond(&net, 2, drive, 1e-11, 600, time_s, theirs, NULL);
    for (int i = 0; i < 600; i++) CHECK_NEAR(mine[i] / theirs[i], 1, 5e-5);
}

TEST("after a strain jump a Maxwell chain's stress decays exponentially; a chain without a series spring is refused")
{
    const kn_voigt_chain chain = kn_voigt_chain_of(&dough);
    kn_voigt_chain maxwell = {.spring_pa = 2e4, .alpha_pa_s = 1e5};
    kn_voigt_chain_step step[1] = {{0, 0.1}};
    double time_s[3] = {1, 5, 20}, stress[3];
    CHECK(kn_voigt_chain_stress(&maxwell, 1, step, 3, time_s, stress));
    for (int i = 0; i < 3; i++) CHECK_NEAR(stress[i], 2e3 * exp(-time_s[i] / 5), 1e-3);
    CHECK(!kn_voigt_chain_stress(&chain, 1, step, 3, time_s, stress));
}

// ---- a held element

// Return the largest relative difference between the closed form and the network, over six decades of time after a
// ramp.
static double apart_held(const kn_material *m, double rate, double *begin_pa)
{
    enum { TIMES = 61 };
    const double rise_s = 0.3 / rate;
    const kn_network net = kn_network_of(m);
    kn_drive drive[4] = {{.kind = KN_DRIVE_STRAIN, .rate_per_s = rate},
                         {.kind = KN_DRIVE_STRAIN, .value = 0.3, .start_s = rise_s}};
    double time_s[TIMES], theirs[TIMES], mine[TIMES], worst = 0;
    kn_network_state at = {0};
    CHECK(kn_network_jump(&net, &at, &drive[0]) && kn_network_advance(&net, &at, &drive[0], rise_s, 1e-12) &&
          kn_network_jump(&net, &at, &drive[1]));
    *begin_pa = at.stress_pa;
    const kn_held_element hold = kn_held_element_of(m, *begin_pa);
    // stop at each kink of the damper: a step across a kink is only first-order accurate
    int drives = 2;
    for (int k = 0; k < 2; k++) {
        const double kink = k ? m->p0_pa : m->p1_pa;
        if (kink >= *begin_pa) continue;
        drive[drives] = drive[1];
        drive[drives++].start_s += kn_held_element_until(&hold, kink);
    }
    for (int i = 0; i < TIMES; i++) time_s[i] = 0.001 * pow(10, 0.1 * i);
    kn_held_element_stress(&hold, TIMES, time_s, mine);
    for (int i = 0; i < TIMES; i++) time_s[i] += rise_s;
    respond(&net, drives, drive, 1e-13, TIMES, time_s, theirs, NULL);
    for (int i = 0; i < TIMES; i++)
        if (theirs[i] > 1e-3 * *begin_pa) worst = fmax(worst, fabs(mine[i] / theirs[i] - 1));
    return worst;
}

TEST("the exponential integral agrees with the tables and is smooth where its two forms meet")
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

TEST("a held element relaxes like the network above P1, between P1 and P0, and below P0")
{
    double begin;
    CHECK_NEAR(apart_held(&dough, 0.02, &begin), 0, 1e-8);
    CHECK(begin > 2 * dough.p0_pa && begin < dough.p1_pa);
    kn_material soft = dough; // soft, so that the ramp ends above P1
    soft.p1_pa = 2000;
    CHECK_NEAR(apart_held(&soft, 0.02, &begin), 0, 1e-8);
    CHECK(begin > 1.1 * soft.p1_pa);
}

TEST("an element without c1, without thinning or with stresses below P0 relaxes like the network")
{
    double begin;
    kn_material bare = dough, plain = dough, still = dough;
    bare.c1_pa_s = 1e-3;
    plain.beta_per_pa = 1e-12;
    still.p0_pa = 5e3;
    still.p1_pa = 1e6;
    CHECK_NEAR(apart_held(&bare, 0.02, &begin), 0, 1e-8);
    CHECK_NEAR(apart_held(&plain, 0.002, &begin), 0, 1e-8);
    CHECK_NEAR(apart_held(&still, 0.02, &begin), 0, 1e-8);
    CHECK(begin < still.p0_pa);
    const kn_held_element none = {.begin_pa = 1000, .alpha_s = 10, .p1_pa = INFINITY};
    double t = 20, p;
    kn_held_element_stress(&none, 1, &t, &p);
    CHECK_NEAR(p, 1000 * exp(-2.0), 1e-10);
}

TEST("the papers' dough relaxes from 55 to 28.57 gf/cm2 in 20 s, and without its dashpot c1 in 5.1 s")
{
    const double gf_cm2 = 98.0665;
    kn_held_element hold = kn_held_element_of(&dough, 55 * gf_cm2);
    CHECK_NEAR(kn_held_element_until(&hold, 28.57 * gf_cm2), 20.0, 0.02);
    hold.c1_s = 0;
    CHECK_NEAR(kn_held_element_until(&hold, 28.57 * gf_cm2), 5.1, 0.05);
}

TEST("the time until a stress is the inverse of the stress at a time")
{
    const kn_held_element hold = kn_held_element_of(&dough, 12000);
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

TEST("extreme parameters give a finite stress that never rises")
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
