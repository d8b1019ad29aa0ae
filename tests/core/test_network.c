// Elements on a one-dimensional bench, compared with closed forms, with their impedance, and with the papers' dough.
#include "core/network.h"
#include "core/oneport.h"
#include "tests/check.h"
#include "tests/physics/press.h"

#define TOLERANCE 1e-9

static kn_network network(const char *text, const double *moduli)
{
    kn_network net = {0};
    char error[160];
    int leaf;
    if (!kn_element_parse(&net.element, text, error, sizeof error)) KN_TEST_FAIL("%s: %s", text, error);
    for (int i = 0; i < net.element.leaves; i++) net.part[i].modulus = moduli[i];
    CHECK(kn_network_check(&net, &leaf) == NULL);
    return net;
}

static void follow(const kn_network *net, kn_network_state *state, const kn_drive *drive, double until_s)
{
    if (!kn_network_advance(net, state, drive, until_s, TOLERANCE)) KN_TEST_FAIL("no step converges");
}

static void take(const kn_network *net, kn_network_state *state, const kn_drive *drive)
{
    if (!kn_network_jump(net, state, drive)) KN_TEST_FAIL("a jump is refused");
}

// Strain of a Voigt unit, a spring and a damper in creep: constant stress S from rest for `hold` s, then no load.
static double voigt_creep(double s, double k, double c, double t, double hold)
{
    double loaded = s / k * (1 - exp(-k / c * fmin(t, hold)));
    return t > hold ? loaded * exp(-k / c * (t - hold)) : loaded;
}

static double damper_creep(double s, double c, double t, double hold) { return s / c * fmin(t, hold); }

static void check_creep(const char *text, const double *moduli,
                        double (*strain)(const double *, double, double, double))
{
    kn_network net = network(text, moduli);
    kn_network_state state = {0};
    kn_drive load = {KN_DRIVE_STRESS, .value = 7e3}, rest = {.kind = KN_DRIVE_STRESS};
    double most = 0;
    take(&net, &state, &load);
    CHECK_NEAR(state.strain, strain(moduli, 7e3, 0, 5), 1e-12);
    for (int i = 1; i <= 100; i++) {
        if (i == 51) take(&net, &state, &rest);
        follow(&net, &state, i > 50 ? &rest : &load, 0.1 * i);
        most = fmax(most, state.strain);
        CHECK_NEAR(state.strain, strain(moduli, 7e3, 0.1 * i, 5), 1e-7 * most);
        CHECK_NEAR(state.stress_pa, i > 50 ? 0 : 7e3, 1e-6);
    }
    printf("     %-12s %ld steps, %ld rejected\n", text, state.steps, state.rejected);
}

static double zener_creep(const double *m, double s, double t, double hold) // (s1|d1)-s2
{
    return voigt_creep(s, m[0], m[1], t, hold) + (t <= hold ? s / m[2] : 0);
}
static double jeffreys_creep(const double *m, double s, double t, double hold)
{
    return voigt_creep(s, m[0], m[1], t, hold) + damper_creep(s, m[2], t, hold);
}
static double burgers_creep(const double *m, double s, double t, double hold) // (s1|d1)-s2-d2
{
    return zener_creep(m, s, t, hold) + damper_creep(s, m[3], t, hold);
}
static double voigt_pair_creep(const double *m, double s, double t, double hold)
{
    return voigt_creep(s, m[0], m[1], t, hold) + voigt_creep(s, m[2], m[3], t, hold);
}
static double maxwell_creep(const double *m, double s, double t, double hold) // s1-d1
{
    return (t <= hold ? s / m[0] : 0) + damper_creep(s, m[1], t, hold);
}

TEST("creep and recovery of linear elements follow their closed forms to 1e-7")
{
    // At the moment of release the spring has already returned.
    check_creep("(s|d)-s", (const double[]){2e4, 3e4, 5e4}, zener_creep);
    check_creep("s-d", (const double[]){2e4, 3e5}, maxwell_creep);
    check_creep("(s|d)-d", (const double[]){2e4, 3e3, 4e5}, jeffreys_creep);
    check_creep("(s|d)-s-d", (const double[]){2e4, 3e4, 5e4, 2e5}, burgers_creep);
    check_creep("(s|d)-(s|d)", (const double[]){2e4, 3e2, 5e4, 2e6}, voigt_pair_creep);
}

TEST("after a strain step Maxwell elements relax exponentially; an element with a dashpot that blocks the step refuses "
     "it")
{
    double m[] = {1e4, 3e4, 2e4, 5e3, 4e4};
    kn_network net = network("s|(s-d)|(s-d)", m);
    kn_network_state state = {0};
    kn_drive step = {KN_DRIVE_STRAIN, .value = 0.2};
    take(&net, &state, &step);
    CHECK_NEAR(state.stress_pa, 0.2 * (m[0] + m[1] + m[3]), 1e-6);
    for (int i = 1; i <= 40; i++) {
        follow(&net, &state, &step, 0.25 * i);
        double t = 0.25 * i, s = m[0] + m[1] * exp(-t * m[1] / m[2]) + m[3] * exp(-t * m[3] / m[4]);
        CHECK_NEAR(state.stress_pa, 0.2 * s, 1e-6 * 0.2 * s);
        CHECK_NEAR(state.strain, 0.2, 1e-14);
    }
    static const char *const refused[] = {"s|d", "(s|d)-d", "d", "(s-d)|d"};
    for (int i = 0; i < 4; i++) {
        net = network(refused[i], m);
        state = (kn_network_state){0};
        CHECK(!kn_network_jump(&net, &state, &step));
        CHECK(state.strain == 0 && state.part_strain[0] == 0);
    }
}

TEST("the integrator is of order 4")
{
    double m[] = {2e4, 3e4, 5e4, 2e5}, error[3];
    kn_network net = network("(s|d)-s-d", m);
    for (int i = 0; i < 3; i++) {
        kn_network_state state = {0};
        kn_drive swing = {KN_DRIVE_STRAIN, .amplitude = 0.1, .omega = 2}, fine = swing;
        int steps = 10 << i;
        take(&net, &state, &swing);
        kn_network_state exact = state;
        for (int k = 1; k <= steps; k++) {
            state.step_s = 4.0 / steps; // any error is allowed: the test sets the steps
            CHECK(kn_network_advance(&net, &state, &swing, 4.0 * k / steps, 1e12));
        }
        CHECK(state.steps == steps);
        CHECK(kn_network_advance(&net, &exact, &fine, 4, 1e-13));
        error[i] = fabs(state.stress_pa - exact.stress_pa);
    }
    double order[2] = {log2(error[0] / error[1]), log2(error[1] / error[2])};
    printf("     observed %.2f, %.2f\n", order[0], order[1]);
    CHECK_NEAR(order[1], 4, 0.3);
}

// Measure storage and loss modulus by oscillation, as an instrument does: Fourier sums over one period, after 30
// periods.
static void swing(const kn_network *net, double omega, double amplitude, double *storage, double *loss)
{
    enum { SAMPLES = 64 };
    const double period = 2 * acos(-1.0) / omega;
    kn_network_state state = {0};
    kn_drive drive = {KN_DRIVE_STRAIN, .amplitude = amplitude, .omega = omega};
    take(net, &state, &drive);
    follow(net, &state, &drive, 30 * period);
    *storage = *loss = 0;
    for (int i = 1; i <= SAMPLES; i++) {
        follow(net, &state, &drive, period * (30 + (double)i / SAMPLES));
        *storage += 2 * state.stress_pa * sin(omega * state.time_s) / (SAMPLES * amplitude);
        *loss += 2 * state.stress_pa * cos(omega * state.time_s) / (SAMPLES * amplitude);
    }
}

// Visit every element of up to four primitives, including reducible ones.
static void for_each_element(int leaves, void (*visit)(const char *))
{
    static const char *const few[] = {"s", "d", "(s|d)", "(s-d)"};
    char text[64];
    for (int i = 0; i < 64 * 4; i++) { // a op b op (c op d), and its other bracketing
        const char *a = few[i & 3], *b = few[i >> 2 & 3], *c = few[i >> 4 & 3];
        char first = i >> 6 & 1 ? '|' : '-', second = i >> 7 & 1 ? '|' : '-';
        snprintf(text, sizeof text, "(%s%c%s)%c%s", a, first, b, second, c);
        kn_element e;
        char error[64];
        if (kn_element_parse(&e, text, error, sizeof error) && e.leaves == leaves) visit(text);
    }
}

static int swung;

static void check_modulus(const char *text)
{
    static const double moduli[] = {2e4, 3e4, 5e4, 1.5e4};
    kn_network net = network(text, moduli);
    double measured[2], expected[2];
    swing(&net, 3, 0.01, &measured[0], &measured[1]);
    kn_oneport_modulus(&net.element, net.element.root, moduli, 3, &expected[0], &expected[1]);
    double size = hypot(expected[0], expected[1]), error = hypot(measured[0] - expected[0], measured[1] - expected[1]);
    if (!(error <= 1e-6 * size)) KN_TEST_FAIL("%s: off by %.2g of the modulus", text, error / size);
    swung++;
}

TEST("an oscillated element of three or four primitives has the storage and loss modulus of its impedance to 1e-6")
{
    for (int leaves = 3; leaves <= 4; leaves++) for_each_element(leaves, check_modulus);
    printf("     %d elements\n", swung);
    CHECK(swung > 40);
}

// --- the papers' dough

typedef struct creep {
    // stress and height at release; recovered and residual strain after the rest
    double stress_pa, height, recovered, residual;
} creep;

static creep dough_creep(double load_gf, double rest_s)
{
    kn_material mat = dough;
    kn_network net = kn_network_of(&mat);
    kn_network_state state = {0};
    kn_drive load = {KN_DRIVE_LOAD, .value = load_gf * GF_CM2}, rest = {.kind = KN_DRIVE_STRESS};
    take(&net, &state, &load);
    follow(&net, &state, &load, 60);
    creep c = {.stress_pa = state.stress_pa, .height = 1 - state.strain};
    take(&net, &state, &rest);
    follow(&net, &state, &rest, 60 + rest_s);
    c.residual = state.strain;
    c.recovered = 1 - c.height - c.residual;
    return c;
}

TEST("a 1 cm cube of dough carries 26.33 gf/cm^2 and is 0.5266 cm high after 60 s under 50 gf")
{
    creep c = dough_creep(50, 70);
    CHECK_NEAR(c.stress_pa / GF_CM2, 26.33, 0.005);
    CHECK_NEAR(c.height, 0.5266, 0.00005);
}

TEST("under 10 to 90 gf the dough's creep, recovery and residual deformation match an independent integration")
{
    static const double load[] = {10, 30, 50, 70, 90}, strain[] = {0.0363, 0.210, 0.473, 0.648, 0.746},
                        stress[] = {9.64, 23.7, 26.3, 24.6, 22.8}, residual[] = {0.0158, 0.159, 0.416, 0.594, 0.696},
                        recovered[] = {0.0205, 0.051, 0.058, 0.054, 0.050};
    for (int i = 0; i < 5; i++) {
        creep c = dough_creep(load[i], 70);
        CHECK_NEAR(1 - c.height, strain[i], i ? 6e-4 : 6e-5);
        CHECK_NEAR(c.stress_pa / GF_CM2, stress[i], i ? 0.06 : 0.006);
        CHECK_NEAR(c.residual, residual[i], i ? 6e-4 : 6e-5);
        CHECK_NEAR(c.recovered, recovered[i], i ? 6e-4 : 6e-5);
    }
}

static double e1(double x) // exponential integral by its series, good for x < 10
{
    double sum = -0.57721566490153286 - log(x), term = -1;
    for (int k = 1; k < 80; k++) {
        term *= -x / k;
        sum += term / k;
    }
    return sum;
}

TEST("dough held at constant length relaxes from 55 to 28.57 gf/cm^2 in 20.0 s, as the closed form with c1 says")
{
    kn_material m = dough;
    kn_network net = kn_network_of(&m);
    double high = 55 * GF_CM2, beta = m.beta_per_pa;
    double at_rest = high + m.c1_pa_s * kn_material_flow(&m, high); // the value of k1 x at which the two rates cancel
    kn_network_state state = {.part_strain = {at_rest / m.k1_pa, at_rest / m.k1_pa, 0.1}};
    kn_drive hold = {KN_DRIVE_STRAIN, .value = at_rest / m.k1_pa + 0.1};
    take(&net, &state, &hold);
    CHECK_NEAR(state.stress_pa, high, 1e-6 * high);
    for (double t = 2; t <= 80; t += 2) {
        follow(&net, &state, &hold, t);
        double s = state.stress_pa, closed = m.alpha_pa_s / m.k1_pa * (e1(beta * s) - e1(beta * high)) +
                                             m.c1_pa_s / m.k1_pa * (log(high / s) + beta * (high - s));
        CHECK(s > m.p0_pa);
        CHECK_NEAR(closed, t, 1e-6 * t);
        if (t == 20) CHECK_NEAR(s / GF_CM2, 28.57, 0.01);
    }
}

TEST("a force-dependent damper alone carries the stress at which it flows at the imposed rate")
{
    kn_material m = dough;
    kn_network net = network("d", (const double[]){1});
    net.part[0] = (kn_part){.modulus = m.alpha_pa_s, .beta_per_pa = m.beta_per_pa, .p0_pa = m.p0_pa, .p1_pa = m.p1_pa};
    for (double stress = 1; stress < 200; stress += 1) { // across both kinks, starting from rest each time
        kn_drive pressed = {KN_DRIVE_STRAIN, .rate_per_s = kn_material_flow(&m, stress * GF_CM2)};
        kn_network_state state = {0};
        take(&net, &state, &pressed);
        CHECK_NEAR(state.stress_pa, stress * GF_CM2, 1e-9 * stress * GF_CM2);
        follow(&net, &state, &pressed, 1);
        CHECK_NEAR(state.stress_pa, stress * GF_CM2, 1e-9 * stress * GF_CM2);
    }
}

TEST("every material is the element (s|d)-d without the missing parts; these elements convert back, and others are "
     "refused")
{
    kn_material m = dough, back;
    for (int i = 1; i < 16; i++) {
        kn_material some = m;
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
    double moduli[] = {1, 2, 3, 4};
    static const char *const refused[] = {"(s-d)|s", "(s|d)-s", "(s|d)-s-d", "(s-d)|d",
                                          "s-s",     "(s|s)-d", "d|d",       "d-d-d"};
    for (int i = 0; i < 8; i++) {
        kn_network net = network(refused[i], moduli);
        CHECK(!kn_network_material(&net, &back));
    }
}

TESTS_MAIN
