// The comparison of models on curves of known models.
#include "clients/identify/model_comparison.h"
#include "tests/clients/made.h"

static kn_network burgers(void)
{
    kn_network net = {0};
    char error[64];
    CHECK(kn_element_parse(&net.element, "s-(s|d)-d", error, sizeof error));
    const double modulus[] = {2e4, 1e4, 5e4, 1e6};
    for (int i = 0; i < 4; i++) net.part[i].modulus = modulus[i];
    return net;
}

// A step of strain, 3 %, read from 10 ms to 350 s with that share of noise.
static kn_curve hold(double noise)
{
    const kn_network net = burgers();
    kn_curve c = curve_hold(&net, 0.03, 0, 201, 0.01, 44);
    curve_noise(&c, &c, 0, noise);
    return c;
}

// A load for 60 s, then 65 s without, every 0.5 s.
static kn_curve creep(const kn_network *net, double load_pa, double noise)
{
    kn_curve c = curve_creep(net, load_pa, 60, 249, 0.5);
    c.noise = fmax(noise * curve_largest(&c), 1e-6);
    curve_noise(&c, &c, noise, 0);
    return c;
}

static kn_model_comparison compare(int curves, const kn_curve *curve)
{
    char error[200] = "";
    kn_model_comparison m;
    if (!kn_model_comparison_run(&m, curves, curve, 0, error, sizeof error)) KN_TEST_FAIL("%s", error);
    return m;
}

static const kn_model_comparison_row *row_of(const kn_model_comparison *m, const char *name)
{
    for (int i = 0; i < m->rows; i++)
        if (!strcmp(m->row[i].model.name, name)) return &m->row[i];
    KN_TEST_FAIL("no model called %s", name);
    return &m->row[0];
}

static double number(const kn_model_comparison_row *row, const char *name)
{
    for (int i = 0; i < row->unknowns; i++)
        if (!strcmp(row->unknown[i].name, name)) return row->unknown[i].value;
    return NAN;
}

static const char *verdict(const kn_model_comparison *m)
{
    static char text[1000];
    kn_model_comparison_verdict(m, text, sizeof text);
    return text;
}

TEST("every element of the catalogue has a row in relaxation and in creep, and indistinguishable elements share one")
{
    static const char *const held[] = {"a", "b d f", "c e i", "g h j k"};
    static const char *const creeping[] = {"a", "b", "c e", "d f", "g h j k", "i"};
    kn_constitutive_model law[KN_CONSTITUTIVE_MAX];
    CHECK(kn_constitutive_models(law, true) <= KN_CONSTITUTIVE_MAX);
    for (int i = 0; i < 4; i++) CHECK_STR(law[i].letters, held[i]);
    CHECK(kn_constitutive_models(law, false) <= KN_CONSTITUTIVE_MAX);
    for (int i = 0; i < 6; i++) CHECK_STR(law[i].letters, creeping[i]);
    CHECK_STR(law[4].name, "(s|d)-s-d");
}

TEST("the relaxation of a Burgers element is identified as two Maxwell units, with the right sum of springs")
{
    AT_END(kn_curve_free) kn_curve c = hold(0.005);
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &c);
    const kn_model_comparison_row *row = row_of(&m, "two Maxwell units");
    CHECK(&m.row[kn_model_comparison_best(&m)] == row);
    CHECK_NEAR(number(row, "k1") + number(row, "k2"), 2e4, 300); // both springs respond to the step at once
    CHECK(row->held < 0.01 && row->runs < 3);
    CHECK(strstr(verdict(&m), "the data support two Maxwell units (g h j k)") && !strstr(verdict(&m), "yardstick"));
    CHECK(row_of(&m, "Maxwell unit")->held > 0.1 && row_of(&m, "a - b ln t")->held > 0.1);
}

TEST("the creep of a Burgers element is identified, with its four parameters within 5 %")
{
    const kn_network net = burgers();
    AT_END(kn_curve_free) kn_curve c = creep(&net, 3000, 0.002);
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &c);
    const kn_model_comparison_row *row = row_of(&m, "(s|d)-s-d");
    CHECK(&m.row[kn_model_comparison_best(&m)] == row);
    CHECK_NEAR(number(row, "k0") / 2e4, 1, 0.05);
    CHECK_NEAR(number(row, "k1") / 1e4, 1, 0.05);
    CHECK_NEAR(number(row, "tau1") / 5, 1, 0.05);
    CHECK_NEAR(number(row, "c") / 1e6, 1, 0.05);
    CHECK(row->held < 0.005);
}

TEST("creep of the papers' dough under three loads is identified as the thinning element alone")
{
    const kn_network net = kn_network_of(&dough);
    kn_curve curve[] = {creep(&net, 981, 0.005), creep(&net, 4903, 0.005), creep(&net, 8826, 0.005)};
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(3, curve);
    const kn_model_comparison_row *row = row_of(&m, "(s|d)-d thinning");
    CHECK_NEAR(number(row, "k1") / dough.k1_pa, 1, 0.03);
    CHECK_NEAR(number(row, "alpha") / dough.alpha_pa_s, 1, 0.03);
    CHECK_NEAR(number(row, "beta") / dough.beta_per_pa, 1, 0.03);
    CHECK(row->held < 0.01);
    for (int i = 0; i < m.rows; i++)
        if (!strstr(m.row[i].model.name, "thinning"))
            CHECK(m.row[i].aicc > row->aicc + 100 && m.row[i].held > 2 * row->held);
    CHECK(strstr(verdict(&m), "thinning") && !strstr(verdict(&m), "yardstick"));
    for (int i = 0; i < 3; i++) kn_curve_free(&curve[i]);
}

// A relaxation like fish muscle's, made as fractional Maxwell. It spans five decades and falls three to four fold in
// each three of them.
static kn_curve muscle(double noise)
{
    const kn_fractional_maxwell f = {.v_pa_s = 1.1e6, .v_order = 0.7, .g_pa_s = 2.2e4, .g_order = 0.11};
    kn_curve c = curve_make(KN_CURVE_RELAX, 560);
    for (int i = 0; i < c.count; i++) c.time_s[i] = 0.014 * pow(10, i * 4.85 / 560);
    kn_fractional_maxwell_relax(&f, 0, c.count, c.time_s, c.value);
    curve_noise(&c, &c, 0, noise);
    return c;
}

TEST("the verdict names a yardstick that fits best, and the thinning element predicts better than the Maxwell units")
{
    AT_END(kn_curve_free) kn_curve c = muscle(0.003);
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &c);
    const kn_model_comparison_row *row = row_of(&m, "fractional Maxwell"),
                                  *thins = row_of(&m, "(s|d)-d thinning, c1 = 0");
    CHECK(&m.row[kn_model_comparison_best(&m)] == row);
    CHECK_NEAR(number(row, "a"), 0.7, 0.05);
    CHECK_NEAR(number(row, "G") / 2.2e4, 1, 0.02);
    CHECK(row->held < 0.02 && row->runs < 3);
    CHECK(strstr(verdict(&m), "a yardstick wins") && !strstr(verdict(&m), "none of them describes the material"));
    CHECK(thins->held < 0.2 && row_of(&m, "Maxwell unit")->held > 3 * thins->held);
    CHECK(row_of(&m, "two Maxwell units")->held > 2 * thins->held);
}

TEST("without noise, rounding errors of the means do not decide between the models")
{
    AT_END(kn_curve_free) kn_curve c = hold(0);
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &c);
    const kn_model_comparison_row *row = row_of(&m, "two Maxwell units");
    CHECK(row->early < KN_COMPARISON_FINE);
    CHECK_NEAR(row->aicc, kn_fit_aicc(m.early, 4, m.early * KN_COMPARISON_FINE * KN_COMPARISON_FINE), 1e-9);
    CHECK(strstr(verdict(&m), "the data support two Maxwell units (g h j k): ") != NULL);
    for (int i = 0; i < 4; i++) CHECK(!row->loose[i]);
}

TEST("under more changes of load than the superposition takes, only the yardsticks have no fit")
{
    const kn_network net = burgers();
    AT_END(kn_curve_free) kn_curve c = creep(&net, 3000, 0.002);
    c.steps = KN_SUPERPOSITION_STEPS + 1;
    for (int k = 2; k < c.steps; k++) c.step[k] = (kn_curve_step){.time_s = 60 + k, .stress_pa = 0};
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &c);
    for (int i = 0; i < m.rows; i++) CHECK(m.row[i].fitted == !m.row[i].model.yardstick);
}

TEST("the verdict says so if no model explains the curve")
{
    AT_END(kn_curve_free) kn_curve c = muscle(0.0005);
    for (int i = 0; i < c.count; i++) c.value[i] *= 1 + 0.03 * sin(6 * log(c.time_s[i]));
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &c);
    CHECK(strstr(verdict(&m), "none of them describes the material"));
}

// Check that the curves are refused with these words.
static void refused(const kn_curve *curve, int curves, const char *words)
{
    AT_END(kn_model_comparison_free) kn_model_comparison m;
    char error[200] = "";
    CHECK(!kn_model_comparison_run(&m, curves, curve, 0, error, sizeof error));
    if (!strstr(error, words)) KN_TEST_FAIL("%s, expected: %s", error, words);
}

TEST("too few readings, a stress of 0 or below, and more than six curves are refused with a message")
{
    AT_END(kn_curve_free) kn_curve c = hold(0);
    kn_curve few = c;
    const kn_curve many[7] = {c, c, c, c, c, c, c};
    few.count = 9;
    refused(&few, 1, "too few");
    refused(many, 7, "at most 6");
    for (int i = 100; i < 110; i++) c.value[i] = -1;
    refused(&c, 1, "falls to 0");
}

TESTS_MAIN
