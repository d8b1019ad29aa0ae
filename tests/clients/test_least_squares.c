// clients/identify/least_squares.h: the minimum, its intervals, and the signs that a fit is doubtful.
#include "clients/identify/least_squares.h"
#include "tests/check.h"
#include "tests/dice.h"

enum { READINGS = 60 };

static uint64_t seed = 1;
static const double truth[3] = {2, 1.3, 0.5};

// a exp(-b t) + c, and a fourth unknown without any effect.
typedef struct decay {
    double y[READINGS];
} decay;

static double at(int i) { return 0.1 * i; }

static bool misfit(void *of, const double *v, double *residual)
{
    decay *d = of;
    for (int i = 0; i < READINGS; i++) residual[i] = (v[0] * exp(-v[1] * at(i)) + v[2] - d->y[i]) / 0.01;
    return true;
}

static decay d; // the data of the last fit

// Fit new data of 2 exp(-1.3 t) + 0.5 with noise. b_high: upper bound of b.
static kn_fit fit_of(double noise, int unknowns, double b_high)
{
    for (int i = 0; i < READINGS; i++) d.y[i] = 2 * exp(-1.3 * at(i)) + 0.5 + noise * kn_dice_normal(&seed);
    kn_fit fit = {.unknowns = unknowns,
                  .readings = READINGS,
                  .misfit = misfit,
                  .of = &d,
                  .unknown = {{.name = "a", .value = 1, .low = 1e-3, .high = 1e3},
                              {.name = "b", .value = 0.1, .low = 1e-3, .high = b_high},
                              {.name = "c", .value = 0.1, .low = 1e-6, .high = 1e3},
                              {.name = "idle", .value = 3, .low = 1, .high = 10}}};
    CHECK(kn_fit_run(&fit));
    return fit;
}

TEST("without noise the fit returns the true parameters")
{
    kn_fit fit = fit_of(0, 3, 1e3);
    for (int i = 0; i < 3; i++) CHECK_NEAR(fit.unknown[i].value, truth[i], 1e-8);
    CHECK(!fit.singular);
}

TEST("intervals by curvature and by profile agree if the curve determines the parameters well")
{
    kn_fit fit = fit_of(0.01, 3, 1e3);
    for (int i = 0; i < 3; i++) {
        kn_fit_interval c = kn_fit_interval_by(&fit, i, 0.95, KN_FIT_CURVATURE);
        kn_fit_interval p = kn_fit_interval_by(&fit, i, 0.95, KN_FIT_PROFILE);
        double width = c.high - c.low;
        CHECK_NEAR(p.low, c.low, 0.03 * width);
        CHECK_NEAR(p.high, c.high, 0.03 * width);
        CHECK(!p.open_low && !p.open_high);
    }
}

TEST("a parameter without effect has an interval open at both ends, and the others keep their covariance")
{
    kn_fit with = fit_of(0.01, 4, 1e3), without = with;
    without.unknowns = 3;
    CHECK(kn_fit_run(&without));
    kn_fit_interval idle = kn_fit_interval_of(&with, 3, 0.95);
    CHECK(with.singular);
    CHECK(idle.open_low && idle.open_high);
    for (int i = 0; i < 3; i++) CHECK_NEAR(with.covariance[i][i] / without.covariance[i][i], 1, 1e-6);
}

TEST("95 % intervals contain the true value in 95 % of the data sets, within the tolerance for their number")
{
    int held[3] = {0}, runs = 400;
    for (int k = 0; k < runs; k++) {
        kn_fit fit = fit_of(0.02, 3, 1e3); // not the 0.01 told to the residuals: the fit estimates the scale itself
        for (int i = 0; i < 3; i++) {
            kn_fit_interval c = kn_fit_interval_of(&fit, i, 0.95);
            held[i] += c.low <= truth[i] && truth[i] <= c.high;
        }
    }
    for (int i = 0; i < 3; i++) CHECK(held[i] >= 0.92 * runs && held[i] <= 0.98 * runs);
}

TEST("a parameter stays within its bound and is flagged at the bound")
{
    kn_fit fit = fit_of(0.01, 3, 0.7);
    CHECK(fit.unknown[1].at_bound && fit.unknown[1].value <= 0.7);
}

static bool two_valleys(void *of, const double *v, double *residual)
{
    (void)of;
    for (int i = 0; i < 4; i++) residual[i] = sin(3 * v[0]) + 0.2 * (v[0] - 4);
    return true;
}

TEST("the fit from several starts keeps the deepest minimum")
{
    kn_fit fit = {.unknowns = 1,
                  .readings = 4,
                  .misfit = two_valleys,
                  .unknown = {{.name = "x", .low = -10, .high = 20, .linear = true}}};
    static const double starts[3][KN_FIT_UNKNOWNS] = {{12}, {-6}, {4.1}};
    CHECK(kn_fit_run_from(&fit, 3, starts));
    CHECK_NEAR(fit.sum, 0, 1e-12);
}

static bool nowhere(void *of, const double *v, double *residual)
{
    (void)of;
    residual[0] = residual[1] = v[0];
    return false;
}

TEST("a model that returns no result makes the fit fail")
{
    kn_fit fit = {
        .unknowns = 1, .readings = 2, .misfit = nowhere, .unknown = {{.name = "x", .value = 1, .low = 0.1, .high = 9}}};
    CHECK(!kn_fit_run(&fit));
}

TEST("the runs statistic accepts noise, rejects a bend and is NaN for 10 readings")
{
    double residual[200];
    for (int i = 0; i < 200; i++) residual[i] = kn_dice_normal(&seed);
    CHECK(kn_fit_runs(200, residual) < 3);
    for (int i = 0; i < 200; i++) residual[i] += 2 * sin(i / 20.0);
    CHECK(kn_fit_runs(200, residual) > 3);
    CHECK(isnan(kn_fit_runs(10, residual)));
}

TEST("Student's quantiles agree with the tables")
{
    CHECK_NEAR(kn_fit_student(0.95, 1), 12.706, 1e-3);
    CHECK_NEAR(kn_fit_student(0.95, 10), 2.22814, 1e-5);
    CHECK_NEAR(kn_fit_student(0.99, 30), 2.75000, 1e-4);
    CHECK_NEAR(kn_fit_student(0.95, 1e6), 1.95996, 1e-5);
}

TEST("AICc adds more than 2 for each further parameter")
{
    CHECK(kn_fit_aicc(50, 4, 10) > kn_fit_aicc(50, 3, 10) + 2);
    CHECK(!isfinite(kn_fit_aicc(5, 4, 10)));
}
TESTS_MAIN
