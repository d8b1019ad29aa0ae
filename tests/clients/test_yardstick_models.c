// The Mittag-Leffler function by Talbot's contour, compared with closed forms and with its spectrum. Creep from a
// compliance is compared with the network.
#include "clients/identify/constitutive_models.h"
#include "tests/clients/made.h"

// Return E_a(-x) as the relaxation of a spring beside a springpot: order 0 in g.
static double mittag_leffler(double a, double x)
{
    const kn_fractional_maxwell f = {.v_pa_s = 1 / x, .v_order = a, .g_pa_s = 1, .g_order = 0};
    const double t = 1;
    double out;
    kn_fractional_maxwell_relax(&f, 0, 1, &t, &out);
    return out;
}

// Return the same value from its spectrum of exponentials, by the trapezoidal rule over ln r.
static double by_spectrum(double a, double x)
{
    const double pi = acos(-1.0), t = pow(x, 1 / a), h = 0.01, wide = 45 / a;
    double sum = 0;
    for (double u = -wide; u < wide; u += h) {
        const double power = exp(a * u);
        sum += h * sin(a * pi) / pi * power / (power * power + 2 * power * cos(a * pi) + 1) * exp(-exp(u) * t);
    }
    return sum;
}

TEST("the Mittag-Leffler function of order 1/2 is exp(x^2) erfc(x), and that of other orders the integral over its "
     "spectrum")
{
    CHECK_NEAR(mittag_leffler(0.5, 1), 0.427583576155807, 1e-10);
    for (double x = 0.01; x < 20; x *= 2) CHECK_NEAR(mittag_leffler(0.5, x) / (exp(x * x) * erfc(x)), 1, 1e-8);
    for (double a = 0.2; a < 0.95; a += 0.1)
        for (double x = 0.01; x < 2000; x *= 10) CHECK_NEAR(mittag_leffler(a, x) / by_spectrum(a, x), 1, 1e-8);
}

TEST("a fractional model of order 1 relaxes exponentially like a Maxwell element, after a step and after a ramp")
{
    const kn_fractional_maxwell f = {.v_pa_s = 5, .v_order = 1, .g_pa_s = 2, .g_order = 0};
    const double t[] = {0.01, 0.1, 1, 5, 10}, tau = 2.5, ramp = 0.7;
    double step[5], ramped[5];
    kn_fractional_maxwell_relax(&f, 0, 5, t, step);
    kn_fractional_maxwell_relax(&f, ramp, 5, t, ramped);
    for (int i = 0; i < 5; i++) {
        CHECK_NEAR(step[i], 2 * exp(-t[i] / tau), 1e-9);
        CHECK_NEAR(ramped[i], 2 * exp(-t[i] / tau) * (1 - exp(-ramp / tau)) * tau / ramp, 1e-9);
    }
}

TEST("two springpots relax by one power law at short times and by the other at long times")
{
    const kn_fractional_maxwell f = {.v_pa_s = 3, .v_order = 0.7, .g_pa_s = 2, .g_order = 0.2};
    const double t[] = {1e-9, 1e9};
    double g[2];
    kn_fractional_maxwell_relax(&f, 0, 2, t, g);
    CHECK_NEAR(g[0] * tgamma(0.8) * pow(t[0], 0.2) / 2, 1, 1e-3);
    CHECK_NEAR(g[1] * tgamma(0.3) * pow(t[1], 0.7) / 3, 1, 1e-3);
}

typedef struct row { // (s|d)-d: J = (1 - exp(-t k/c))/k + t/d
    double k, c, d;
} row;

static void compliance(const void *of, int count, const double *lag, const double *ln_lag, double *j, double *integral)
{
    const row *r = of;
    (void)ln_lag;
    for (int i = 0; i < count; i++) {
        const double tau = r->c / r->k, gone = -expm1(-lag[i] / tau);
        j[i] = gone / r->k + lag[i] / r->d;
        integral[i] = (lag[i] - tau * gone) / r->k + lag[i] * lag[i] / (2 * r->d);
    }
}

// Return the largest difference between the strain and the network's strain, under two loads and a rest.
static double apart(bool constant_area)
{
    const row r = {4e4, 2e5, 5e5};
    double time_s[130], strain[130], theirs[130], worst = 0;
    const kn_curve curve = {.constant_area = constant_area,
                            .steps = 3,
                            .step = {{0, 3000, 0, 0}, {30, 5000, 30, 30}, {60, 0, 60, 60}},
                            .count = 130,
                            .time_s = time_s};
    kn_drive drive[3];
    AT_END(kn_superposition_close) kn_superposition m = {0};
    kn_network net = {.part = {{.modulus = r.k}, {.modulus = r.c}, {.modulus = r.d}}};
    char error[64];
    CHECK(kn_element_parse(&net.element, "(s|d)-d", error, sizeof error));
    for (int i = 0; i < 3; i++)
        drive[i] = (kn_drive){.kind = constant_area ? KN_DRIVE_STRESS : KN_DRIVE_LOAD,
                              .value = curve.step[i].stress_pa,
                              .start_s = curve.step[i].time_s};
    for (int i = 0; i < 130; i++) time_s[i] = i + 0.5;
    CHECK(kn_superposition_open(&m, &curve));
    CHECK(kn_superposition_creep(&m, compliance, &r, 130, time_s, strain));
    respond(&net, 3, drive, 1e-10, 130, time_s, NULL, theirs);
    for (int i = 0; i < 130; i++) worst = fmax(worst, fabs(strain[i] - theirs[i]));
    CHECK(theirs[129] > 0.2);
    return worst;
}

TEST("creep from a compliance agrees with the network at constant stress and at constant load")
{
    CHECK_NEAR(apart(true), 0, 1e-5);
    CHECK_NEAR(apart(false), 0, 1e-4);
}

TESTS_MAIN
