// Fits of the papers' element to relaxations computed by the network.
#include "clients/identify/relaxation_fit.h"
#include "tests/clients/made.h"
#include <time.h>

// Rise to a strain of 0.3 in 15 s, then hold for 300 s, with a reading every 0.1 s.
static kn_curve ramp_and_hold(void)
{
    static const kn_drive drive[] = {{.kind = KN_DRIVE_STRAIN, .rate_per_s = 0.02},
                                     {.kind = KN_DRIVE_STRAIN, .value = 0.3, .start_s = 15}};
    const kn_network net = kn_network_of(&dough);
    kn_curve c = curve_make(KN_CURVE_RELAX, 3150);
    c.other = calloc((size_t)c.count, sizeof *c.other);
    c.strain = 0.3;
    c.begin_s = 15;
    for (int i = 0; i < c.count; i++) c.time_s[i] = 0.1 * i;
    respond(&net, 2, drive, 1e-9, c.count, c.time_s, c.value, c.other);
    return c;
}

// A hold alone, after a rise of 2 %/s: equally many readings in each decade from 10 ms to 300 s.
static kn_curve hold(const kn_material *material, double strain, double rise_s)
{
    const kn_network net = kn_network_of(material);
    return curve_hold(&net, strain, rise_s, 269, 0.01 * pow(10, 0.5 / 60), 60);
}

static kn_relaxation_fit fit(const kn_curve *curve, int curves, bool constant, bool values)
{
    const kn_relaxation_fit_options how = {.confidence = 0.95, .constant_noise = constant, .no_intervals = values};
    char error[300] = "";
    kn_relaxation_fit r;
    if (!kn_relaxation_fit_run(&r, curves, curve, &how, error, sizeof error)) KN_TEST_FAIL("%s", error);
    return r;
}

static bool holds(const kn_parameter_estimate *n, double truth)
{
    return n->known == KN_KNOWN && n->interval.low <= truth && truth <= n->interval.high;
}

TEST("a slow ramp and a hold without noise give k1, c1, alpha, beta and P0 within 0.5 %, and bound P1 from below")
{
    static const double bound[] = {0.002, 0.002, 0.005, 0.002, 0.005};
    const double truth[] = {dough.k1_pa, dough.c1_pa_s, dough.alpha_pa_s, dough.beta_per_pa, dough.p0_pa};
    AT_END(kn_curve_free) kn_curve c = ramp_and_hold();
    AT_END(kn_relaxation_fit_free) kn_relaxation_fit r = fit(&c, 1, false, false);
    const kn_parameter_estimate *n = r.number, *p1 = &n[KN_ESTIMATE_P1];
    CHECK(r.scale == KN_RELAXATION_RISE && r.p0 && !r.p1);
    for (int i = 0; i <= KN_ESTIMATE_P0; i++) CHECK_NEAR(n[i].value / truth[i], 1, bound[i]);
    CHECK(p1->known == KN_AT_LEAST && p1->interval.low > 4000 && p1->interval.low < dough.p1_pa);
    CHECK(!kn_material_check(&r.material));
    // the fit stored is the best one, not the last one tried for an interval
    for (int i = 0; i < r.curve[0].hold.count; i++)
        CHECK_NEAR(r.curve[0].fit_pa[r.curve[0].rise.count + i] / r.curve[0].hold.value[i], 1, 5e-4);
}

// The profile likelihood of noise-free data at that noise gives these intervals: 458 .. 483, 2468 .. 2533, 7.7e4 ..
// 8.6e4, .0799 .. .0831, 8.77 .. 9.23 in the first paper's units. No seed may give values outside of twice that.
TEST("with noise of 1 % of the peak the errors of 20 data sets agree with the likelihood intervals")
{
    static const double half[] = {0.027, 0.013, 0.057, 0.02, 0.026};
    const double truth[] = {dough.k1_pa, dough.c1_pa_s, dough.alpha_pa_s, dough.beta_per_pa, dough.p0_pa};
    double square[5] = {0};
    AT_END(kn_curve_free) kn_curve clean = ramp_and_hold(), c = ramp_and_hold();
    c.noise = 0.01 * curve_largest(&clean);
    for (int set = 0; set < 20; set++) {
        curve_noise(&c, &clean, 0.01, 0);
        AT_END(kn_relaxation_fit_free) kn_relaxation_fit r = fit(&c, 1, true, true);
        for (int i = 0; i < 5; i++) {
            const double off = r.number[i].value / truth[i] - 1;
            CHECK_NEAR(off, 0, 2 * half[i]);
            square[i] += off * off / 20;
        }
    }
    for (int i = 0; i < 5; i++) { // half a 95 % interval is two standard deviations
        printf("     %-5s off by %.2f %%, a half interval of %.1f %%\n", kn_estimate_name[i], 100 * sqrt(square[i]),
               100 * half[i]);
        CHECK(sqrt(square[i]) < half[i]);
    }
}

TEST("95 % intervals of a hold contain the true value in 180 to 198 of 200 sets, or in at least 7 of 10")
{
    const double truth[] = {dough.c1_pa_s / dough.k1_pa, dough.alpha_pa_s / dough.k1_pa, dough.beta_per_pa,
                            dough.p0_pa};
    int inside[4] = {0};
    double took = 0;
    AT_END(kn_curve_free) kn_curve clean = hold(&dough, 0.3, 15), c = hold(&dough, 0.3, 15);
    const int sets = KN_LENGTH(10, 10, NIGHT_SETS);
    for (int set = 0; set < sets; set++) {
        curve_noise(&c, &clean, 0, 0.01);
        const clock_t from = clock();
        AT_END(kn_relaxation_fit_free) kn_relaxation_fit r = fit(&c, 1, false, false);
        took += (double)(clock() - from) / CLOCKS_PER_SEC / sets;
        const kn_parameter_estimate *number[] = {&r.ratio[0], &r.ratio[1], &r.number[KN_ESTIMATE_BETA],
                                                 &r.number[KN_ESTIMATE_P0]};
        for (int i = 0; i < 4; i++) inside[i] += holds(number[i], truth[i]);
    }
    printf("     of %d: c1/k1 %d, alpha/k1 %d, beta %d, P0 %d; %.0f ms each\n", sets, inside[0], inside[1], inside[2],
           inside[3], 1e3 * took);
    for (int i = 0; i < 4; i++) CHECK(sets < 200 ? inside[i] >= 7 : inside[i] >= 180 && inside[i] <= 198);
}

TEST("a hold alone gives the ratio c1/k1 and a lower bound of k1, and no k1 without a strain")
{
    AT_END(kn_curve_free) kn_curve c = hold(&dough, 0.3, 15);
    AT_END(kn_relaxation_fit_free) kn_relaxation_fit r = fit(&c, 1, false, false);
    const kn_parameter_estimate *k1 = &r.number[KN_ESTIMATE_K1];
    CHECK(r.scale == KN_RELAXATION_BOUND && k1->known == KN_AT_LEAST && k1->value < dough.k1_pa && k1->value > 2e3);
    CHECK_NEAR(r.material.c1_pa_s / r.material.k1_pa, 5.319, 0.05);
    c.strain = 0;
    AT_END(kn_relaxation_fit_free) kn_relaxation_fit none = fit(&c, 1, false, false);
    CHECK(none.scale == KN_RELAXATION_MODULUS && none.number[KN_ESTIMATE_K1].known == KN_UNKNOWN);
    CHECK_NEAR(none.ratio[0].value / r.ratio[0].value, 1, 1e-6);
}

TEST("two holds of one material give a narrower interval than one")
{
    kn_curve both[] = {hold(&dough, 0.3, 15), hold(&dough, 0.1, 2)};
    for (int k = 0; k < 2; k++) curve_noise(&both[k], &both[k], 0, 0.003);
    AT_END(kn_relaxation_fit_free) kn_relaxation_fit one = fit(both, 1, false, false), two = fit(both, 2, false, false);
    const kn_fit_interval *i1 = &one.ratio[0].interval, *i2 = &two.ratio[0].interval;
    CHECK(i2->high - i2->low < i1->high - i1->low);
    CHECK_NEAR(two.ratio[0].value, 5.319, 0.3);
    CHECK_NEAR(two.number[KN_ESTIMATE_BETA].value / dough.beta_per_pa, 1, 0.1);
    for (int k = 0; k < 2; k++) kn_curve_free(&both[k]);
}

TEST("for a material without c1 an upper bound of c1 is reported, and the fitted material is valid")
{
    kn_material bare = dough;
    bare.c1_pa_s = 0;
    AT_END(kn_curve_free) kn_curve c = hold(&bare, 0.3, 15);
    curve_noise(&c, &c, 0, 0.005);
    AT_END(kn_relaxation_fit_free) kn_relaxation_fit r = fit(&c, 1, false, false);
    CHECK(r.ratio[0].known == KN_AT_MOST && r.ratio[0].interval.high < 0.5);
    CHECK_NEAR(r.number[KN_ESTIMATE_BETA].value / dough.beta_per_pa, 1, 0.05);
    CHECK(!kn_material_check(&r.material) && r.material.c1_pa_s < 0.5 * r.material.k1_pa);
}

// From a place far beyond the interval, P0 used to come back below all stresses, where nothing pulls it up again. The
// sides towards that place were then 0.9999 and 0.9998 of the value. The expected numbers come from profiles walked
// in small steps from the best fit.
TEST("profile intervals close on both sides around the best fit and are equal in any unit of stress")
{
    kn_relaxation_fit r[2];
    for (int k = 0; k < 2; k++) {
        // exp(-(t/50 s)^0.5), from 0.1 to 100 s. The element cannot follow this curve, so the residual is not noise.
        AT_END(kn_curve_free) kn_curve c = curve_make(KN_CURVE_RELAX, 61);
        c.strain = 0.1;
        for (int i = 0; i < c.count; i++) {
            c.time_s[i] = 0.1 * pow(1000, i / 60.0);
            c.value[i] = (k ? 2e23 : 2000) * exp(-sqrt(c.time_s[i] / 50));
        }
        r[k] = fit(&c, 1, false, false);
    }
    static const double sides[2][2] = {{0.8552, 1.1904}, {0.9393, 1.0663}};
    CHECK(r[0].p0 && !r[0].p1);
    for (int i = 0; i < 2; i++) { // alpha/k1, beta
        const kn_parameter_estimate *n = i ? &r[0].number[KN_ESTIMATE_BETA] : &r[0].ratio[1];
        const kn_parameter_estimate *scaled = i ? &r[1].number[KN_ESTIMATE_BETA] : &r[1].ratio[1];
        CHECK_NEAR(n->interval.low / n->value, sides[i][0], 1e-3);
        CHECK_NEAR(n->interval.high / n->value, sides[i][1], 1e-3);
        CHECK_NEAR((i ? 1e20 : 1) * scaled->interval.low / n->interval.low, 1, 1e-3);
        CHECK_NEAR((i ? 1e20 : 1) * scaled->interval.high / n->interval.high, 1, 1e-3);
    }
    for (int k = 0; k < 2; k++) kn_relaxation_fit_free(&r[k]);
}

// Check that the curves are refused with these words.
static void refused(const kn_curve *curve, int curves, const char *words)
{
    const kn_relaxation_fit_options how = {.confidence = 0.95};
    AT_END(kn_relaxation_fit_free) kn_relaxation_fit r;
    char error[300] = "";
    CHECK(!kn_relaxation_fit_run(&r, curves, curve, &how, error, sizeof error));
    if (!strstr(error, words)) KN_TEST_FAIL("%s, expected: %s", error, words);
}

TEST("a stress below 0, fewer than 8 readings, and more than 6 curves are refused with a message")
{
    AT_END(kn_curve_free) kn_curve c = hold(&dough, 0.3, 15);
    kn_curve few = c;
    const kn_curve many[7] = {c};
    few.count = 5;
    refused(&few, 1, "8 or more");
    refused(many, 7, "at most 6");
    for (int i = 50; i < 55; i++) c.value[i] = -100;
    refused(&c, 1, "made.csv:53:1: a stress of -100 Pa on average, expected one above 0");
}

TESTS_MAIN
