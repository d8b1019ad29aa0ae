// Elements on a one-dimensional bench, compared with closed forms, with their impedance, and with the papers' dough.
// Relaxation at constant length: clients.element_response.
#include "core/network.h"
#include "core/oneport.h"
#include "tests/check.h"
#include "tests/dough.h"

typedef struct bench { // an element under a drive
    kn_network net;
    kn_network_state state;
    kn_drive drive;
} bench;

static bench bench_of(const char *text, const double *moduli)
{
    bench b = {0};
    char error[160];
    int leaf;
    if (!kn_element_parse(&b.net.element, text, error, sizeof error)) KN_TEST_FAIL("%s: %s", text, error);
    for (int i = 0; i < b.net.element.leaves; i++) b.net.part[i].modulus = moduli[i];
    CHECK(kn_network_check(&b.net, &leaf) == NULL);
    return b;
}

static void take(bench *b, kn_drive drive)
{
    b->drive = drive;
    CHECK(kn_network_jump(&b->net, &b->state, &drive));
}

static void follow(bench *b, double until_s)
{
    CHECK(kn_network_advance(&b->net, &b->state, &b->drive, until_s, 1e-9));
}

// Strain of a Voigt unit in creep: constant stress S from rest for `hold` s, then no load.
static double voigt_creep(double s, double k, double c, double t, double hold)
{
    double loaded = s / k * (1 - exp(-k / c * fmin(t, hold)));
    return t > hold ? loaded * exp(-k / c * (t - hold)) : loaded;
}

TEST("creep and recovery of linear elements follow their closed forms to 1e-7")
{
    static const struct {
        const char *text;
        double m[4];
        int voigts;            // number of Voigt units, which come first
        double spring, damper; // moduli of the others in series, or 0
    } table[] = {
        {"(s|d)-s", {2e4, 3e4, 5e4}, 1, 5e4, 0},        {"s-d", {2e4, 3e5}, 0, 2e4, 3e5},
        {"(s|d)-d", {2e4, 3e3, 4e5}, 1, 0, 4e5},        {"(s|d)-s-d", {2e4, 3e4, 5e4, 2e5}, 1, 5e4, 2e5},
        {"(s|d)-(s|d)", {2e4, 3e2, 5e4, 2e6}, 2, 0, 0},
    };
    for (int e = 0; e < COUNT(table); e++) {
        const double *m = table[e].m, s = 7e3, hold = 5;
        bench b = bench_of(table[e].text, m);
        double most = 0;
        take(&b, (kn_drive){KN_DRIVE_STRESS, .value = s});
        CHECK_NEAR(b.state.strain, table[e].spring > 0 ? s / table[e].spring : 0, 1e-12);
        for (int i = 1; i <= 100; i++) {
            double t = 0.1 * i, strain = 0;
            if (i == 51) take(&b, (kn_drive){.kind = KN_DRIVE_STRESS});
            follow(&b, t);
            for (int v = 0; v < table[e].voigts; v++) strain += voigt_creep(s, m[2 * v], m[2 * v + 1], t, hold);
            if (table[e].spring > 0 && i <= 50) strain += s / table[e].spring; // at the release it has already returned
            if (table[e].damper > 0) strain += s / table[e].damper * fmin(t, hold);
            most = fmax(most, b.state.strain);
            CHECK_NEAR(b.state.strain, strain, 1e-7 * most);
            CHECK_NEAR(b.state.stress_pa, i > 50 ? 0 : s, 1e-6);
        }
        printf("     %-12s %ld steps, %ld rejected\n", table[e].text, b.state.steps, b.state.rejected);
    }
}

TEST("after a strain step Maxwell elements relax exponentially; an element with a dashpot that blocks the step refuses "
     "it")
{
    const double m[] = {1e4, 3e4, 2e4, 5e3, 4e4};
    const kn_drive step = {KN_DRIVE_STRAIN, .value = 0.2};
    bench b = bench_of("s|(s-d)|(s-d)", m);
    take(&b, step);
    CHECK_NEAR(b.state.stress_pa, 0.2 * (m[0] + m[1] + m[3]), 1e-6);
    for (int i = 1; i <= 40; i++) {
        follow(&b, 0.25 * i);
        double t = 0.25 * i, s = m[0] + m[1] * exp(-t * m[1] / m[2]) + m[3] * exp(-t * m[3] / m[4]);
        CHECK_NEAR(b.state.stress_pa, 0.2 * s, 1e-6 * 0.2 * s);
        CHECK_NEAR(b.state.strain, 0.2, 1e-14);
    }
    static const char *const blocked[] = {"s|d", "(s|d)-d", "d", "(s-d)|d"};
    for (int i = 0; i < 4; i++) {
        b = bench_of(blocked[i], m);
        CHECK(!kn_network_jump(&b.net, &b.state, &step));
        CHECK(b.state.strain == 0 && b.state.part_strain[0] == 0);
    }
}

TEST("the integrator is of order 4")
{
    const double m[] = {2e4, 3e4, 5e4, 2e5};
    double error[3];
    for (int i = 0; i < 3; i++) {
        bench b = bench_of("(s|d)-s-d", m), exact;
        int steps = 10 << i;
        take(&b, (kn_drive){KN_DRIVE_STRAIN, .amplitude = 0.1, .omega = 2});
        exact = b;
        for (int k = 1; k <= steps; k++) {
            b.state.step_s = 4.0 / steps; // any error is allowed: the test sets the steps
            CHECK(kn_network_advance(&b.net, &b.state, &b.drive, 4.0 * k / steps, 1e12));
        }
        CHECK(b.state.steps == steps);
        CHECK(kn_network_advance(&exact.net, &exact.state, &exact.drive, 4, 1e-13));
        error[i] = fabs(b.state.stress_pa - exact.state.stress_pa);
    }
    printf("     observed %.2f, %.2f\n", log2(error[0] / error[1]), log2(error[1] / error[2]));
    CHECK_NEAR(log2(error[1] / error[2]), 4, 0.3);
}

TEST("an oscillated element of three or four primitives has the storage and loss modulus of its impedance to 1e-6")
{
    static const char *const few[] = {"s", "d", "(s|d)", "(s-d)"};
    static const double moduli[] = {2e4, 3e4, 5e4, 1.5e4};
    enum { SAMPLES = 64, OMEGA = 3 };
    const double amplitude = 0.01, period = 2 * acos(-1.0) / OMEGA;
    int swung = 0;
    for (int i = 0; i < 64 * 4; i++) { // a op b op (c op d), reducible ones included
        char text[64], error[64];
        kn_element e;
        snprintf(text, sizeof text, "(%s%c%s)%c%s", few[i & 3], i >> 6 & 1 ? '|' : '-', few[i >> 2 & 3],
                 i >> 7 & 1 ? '|' : '-', few[i >> 4 & 3]);
        if (!kn_element_parse(&e, text, error, sizeof error) || e.leaves < 3 || e.leaves > 4) continue;
        // as an instrument does: Fourier sums over one period, after 30 periods
        double measured[2] = {0}, expected[2];
        bench b = bench_of(text, moduli);
        take(&b, (kn_drive){KN_DRIVE_STRAIN, .amplitude = amplitude, .omega = OMEGA});
        follow(&b, 30 * period);
        for (int k = 1; k <= SAMPLES; k++) {
            follow(&b, period * (30 + (double)k / SAMPLES));
            measured[0] += 2 * b.state.stress_pa * sin(OMEGA * b.state.time_s) / (SAMPLES * amplitude);
            measured[1] += 2 * b.state.stress_pa * cos(OMEGA * b.state.time_s) / (SAMPLES * amplitude);
        }
        kn_oneport_modulus(&e, e.root, moduli, OMEGA, &expected[0], &expected[1]);
        double off = hypot(measured[0] - expected[0], measured[1] - expected[1]) / hypot(expected[0], expected[1]);
        if (!(off <= 1e-6)) KN_TEST_FAIL("%s: off by %.2g of the modulus", text, off);
        swung++;
    }
    printf("     %d elements\n", swung);
    CHECK(swung > 40);
}

TEST("under 10 to 90 gf for 60 s and no load for 70 s the dough's creep, recovery and residual deformation match an "
     "independent integration")
{
    static const double load[] = {10, 30, 50, 70, 90}, strain[] = {0.0363, 0.210, 0.473, 0.648, 0.746},
                        stress[] = {9.64, 23.7, 26.3, 24.6, 22.8}, residual[] = {0.0158, 0.159, 0.416, 0.594, 0.696},
                        recovered[] = {0.0205, 0.051, 0.058, 0.054, 0.050};
    for (int i = 0; i < 5; i++) {
        bench b = {.net = kn_network_of(&dough)};
        take(&b, (kn_drive){KN_DRIVE_LOAD, .value = load[i] * GF_CM2});
        follow(&b, 60);
        double loaded = b.state.strain;
        CHECK_NEAR(loaded, strain[i], i ? 6e-4 : 6e-5);
        CHECK_NEAR(b.state.stress_pa / GF_CM2, stress[i], i ? 0.06 : 0.006);
        if (load[i] == 50) { // the papers' case
            CHECK_NEAR(b.state.stress_pa / GF_CM2, 26.33, 0.005);
            CHECK_NEAR(1 - loaded, 0.5266, 0.00005); // height of a 1 cm cube
        }
        take(&b, (kn_drive){.kind = KN_DRIVE_STRESS});
        follow(&b, 130);
        CHECK_NEAR(b.state.strain, residual[i], i ? 6e-4 : 6e-5);
        CHECK_NEAR(loaded - b.state.strain, recovered[i], i ? 6e-4 : 6e-5);
    }
}

TEST("a force-dependent damper alone carries the stress at which it flows at the imposed rate")
{
    const kn_material *m = &dough;
    for (double stress = GF_CM2; stress < 200 * GF_CM2; stress += GF_CM2) { // across both kinks
        bench b = bench_of("d", (const double[]){1});
        b.net.part[0] =
            (kn_part){.modulus = m->alpha_pa_s, .beta_per_pa = m->beta_per_pa, .p0_pa = m->p0_pa, .p1_pa = m->p1_pa};
        take(&b, (kn_drive){KN_DRIVE_STRAIN, .rate_per_s = kn_material_flow(m, stress)});
        CHECK_NEAR(b.state.stress_pa, stress, 1e-9 * stress);
        follow(&b, 1);
        CHECK_NEAR(b.state.stress_pa, stress, 1e-9 * stress);
    }
}

TEST("every material is the element (s|d)-d without the missing parts; these elements convert back, and others are "
     "refused")
{
    kn_material back;
    for (int i = 1; i < 16; i++) {
        kn_material some = dough;
        if (!(i & 1)) some.k1_pa = 0;
        if (!(i & 2)) some.c1_pa_s = 0;
        some.damper = i & 4 ? KN_DAMPER_EXPONENTIAL : i & 8 ? KN_DAMPER_CONSTANT : KN_DAMPER_NONE;
        some.c2_pa_s = 1e5;
        if (kn_material_check(&some)) continue;
        kn_network net = kn_network_of(&some);
        CHECK(kn_network_material(&net, &back));
        CHECK(back.damper == some.damper && back.k1_pa == some.k1_pa);
        for (double s = 0; s < 1e4; s += 1e3) CHECK(kn_material_c2(&back, s) == kn_material_c2(&some, s));
    }
    static const char *const others[] = {"(s-d)|s", "(s|d)-s", "(s|d)-s-d", "(s-d)|d",
                                         "s-s",     "(s|s)-d", "d|d",       "d-d-d"};
    for (int i = 0; i < 8; i++) {
        bench b = bench_of(others[i], (const double[]){1, 2, 3, 4});
        CHECK(!kn_network_material(&b.net, &back));
    }
}
