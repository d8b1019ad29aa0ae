// clients/identify/element_response.h compared with core/network.h. The two share only the equations.
#include "clients/identify/element_response.h"
#include "core/network.h"
#include "tests/check.h"

#define GF 98.0665 // Pa of 1 gf/cm^2

enum { READINGS = 433 };

static const kn_voigt_chain dough = {.voigts = 1,
                                     .k_pa = {470 * GF},
                                     .c_pa_s = {2500 * GF},
                                     .alpha_pa_s = 8.16e4 * GF,
                                     .beta_per_pa = 0.0815 / GF,
                                     .p0_pa = 9 * GF,
                                     .p1_pa = 80 * GF};

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

static void oracle(const kn_network *net, int steps, const kn_voigt_chain_step *step, kn_drive_kind kind,
                   const double *time_s, double *strain)
{
    kn_network_state s = {0};
    int next = 0;
    kn_drive d = {0};
    for (int i = 0; i < READINGS; i++) {
        // a reading at the time of a step belongs before the step
        for (; next < steps && step[next].time_s < time_s[i]; next++) {
            if (next > 0) CHECK(kn_network_advance(net, &s, &d, step[next].time_s, 1e-11));
            d = (kn_drive){.kind = kind, .value = step[next].value};
            CHECK(kn_network_jump(net, &s, &d));
        }
        CHECK(kn_network_advance(net, &s, &d, time_s[i], 1e-11));
        strain[i] = s.strain;
    }
}

static double furthest(const kn_voigt_chain *c, const char *expression, int steps, const kn_voigt_chain_step *step,
                       bool constant)
{
    static double time_s[READINGS], mine[READINGS], theirs[READINGS];
    kn_network net = network_of(c, expression);
    double worst = 0, largest = 0;
    for (int i = 0; i < READINGS; i++) time_s[i] = 0.3 * (i + 1);
    oracle(&net, steps, step, constant ? KN_DRIVE_STRESS : KN_DRIVE_LOAD, time_s, theirs);
    CHECK(kn_voigt_chain_creep(c, constant, steps, step, READINGS, time_s, mine));
    for (int i = 0; i < READINGS; i++) {
        worst = fmax(worst, fabs(mine[i] - theirs[i]));
        largest = fmax(largest, theirs[i]);
    }
    return worst / largest;
}

TEST("dough creeps and recovers as the network does, under every load of the paper")
{
    for (int load = 10; load <= 90; load += 20) {
        kn_voigt_chain_step step[2] = {{0, load * GF}, {60, 0}};
        CHECK_NEAR(furthest(&dough, "d-(s|d)", 2, step, false), 0, 2e-5);
    }
}

TEST("loads that come one upon the other, and an area that stays")
{
    kn_voigt_chain_step step[4] = {{0, 20 * GF}, {20, 45 * GF}, {40, 10 * GF}, {80, 0}};
    CHECK_NEAR(furthest(&dough, "d-(s|d)", 4, step, false), 0, 1e-6);
    CHECK_NEAR(furthest(&dough, "d-(s|d)", 4, step, true), 0, 1e-6);
}

TEST("Burgers and rows of two Voigt units, fast ones, too")
{
    kn_voigt_chain burgers = {.spring_pa = 3e5, .voigts = 1, .k_pa = {1e5}, .c_pa_s = {2e5}, .alpha_pa_s = 4e6};
    kn_voigt_chain row = {.spring_pa = 3e5, .voigts = 2, .k_pa = {1e5, 4e4}, .c_pa_s = {2e2, 2e5}};
    kn_voigt_chain_step step[2] = {{0, 50 * GF}, {60, 0}};
    CHECK_NEAR(furthest(&burgers, "d-s-(s|d)", 2, step, false), 0, 1e-6);
    CHECK_NEAR(furthest(&row, "s-(s|d)-(s|d)", 2, step, false), 0, 1e-6);
}

TEST("the stress of a ramp and a hold is the network's")
{
    static double time_s[600], stress[600];
    kn_network net = network_of(&dough, "d-(s|d)");
    kn_network_state s = {0};
    kn_drive d = {.kind = KN_DRIVE_STRAIN, .rate_per_s = 0.02};
    kn_voigt_chain_step step[2] = {{0, 0}, {15, 0.3}};
    for (int i = 0; i < 600; i++) time_s[i] = 0.5 * (i + 1) + 0.1;
    CHECK(kn_voigt_chain_stress(&dough, 2, step, 600, time_s, stress));
    CHECK(kn_network_jump(&net, &s, &d));
    bool held = false;
    for (int i = 0; i < 600; i++) {
        if (!held && time_s[i] > 15) {
            CHECK(kn_network_advance(&net, &s, &d, 15, 1e-11));
            d = (kn_drive){.kind = KN_DRIVE_STRAIN, .value = 0.3, .start_s = 15};
            held = kn_network_jump(&net, &s, &d);
        }
        CHECK(kn_network_advance(&net, &s, &d, time_s[i], 1e-11));
        CHECK_NEAR(stress[i] / s.stress_pa, 1, 5e-5);
    }
}

TEST("a jump of strain: Maxwell's stress falls exponentially, and a dashpot refuses it")
{
    kn_voigt_chain maxwell = {.spring_pa = 2e4, .alpha_pa_s = 1e5};
    kn_voigt_chain_step step[1] = {{0, 0.1}};
    double time_s[3] = {1, 5, 20}, stress[3];
    CHECK(kn_voigt_chain_stress(&maxwell, 1, step, 3, time_s, stress));
    for (int i = 0; i < 3; i++) CHECK_NEAR(stress[i], 2e3 * exp(-time_s[i] / 5), 1e-3);
    CHECK(!kn_voigt_chain_stress(&dough, 1, step, 3, time_s, stress));
}
TESTS_MAIN
