// The comparison of models on curves of known models.
#include "clients/identify/model_comparison.h"
#include "core/network.h"
#include "tests/check.h"
#include "tests/clients/made.h"
#include "tests/dice.h"
#include "tests/dough.h"

static uint64_t seed = 1;

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
static void hold(made *m, const kn_network *net, double noise)
{
    kn_network_state at = {0};
    kn_drive d = {.kind = KN_DRIVE_STRAIN, .value = 0.03};
    made_begin(m, KN_CURVE_RELAX, 0.03);
    CHECK(kn_network_jump(net, &at, &d));
    for (int i = 0; i <= 200; i++) {
        const double t = 0.01 * pow(10, i / 44.0);
        CHECK(kn_network_advance(net, &at, &d, t, 1e-9));
        made_put(m, t, at.stress_pa * (1 + noise * kn_dice_normal(&seed)), 0);
    }
}

// A load for 60 s, then 65 s without, every 0.5 s.
static void creep(made *m, const kn_network *net, double load_pa, double noise)
{
    kn_network_state at = {0};
    kn_curve *c = made_begin(m, KN_CURVE_CREEP, 0);
    c->steps = 2;
    c->step[0] = (kn_curve_step){.time_s = 0, .stress_pa = load_pa};
    c->step[1] = (kn_curve_step){.time_s = 60, .stress_pa = 0};
    kn_drive d = {.kind = KN_DRIVE_LOAD, .value = load_pa};
    CHECK(kn_network_jump(net, &at, &d));
    for (int i = 1; i < 250; i++) {
        if (i == 121) {
            d.value = 0;
            CHECK(kn_network_jump(net, &at, &d));
        }
        CHECK(kn_network_advance(net, &at, &d, 0.5 * i, 1e-9));
        made_put(m, 0.5 * i, at.strain, 0);
    }
    double most = 0;
    for (int i = 0; i < c->count; i++) most = fmax(most, c->value[i]);
    for (int i = 0; i < c->count; i++) c->value[i] += noise * most * kn_dice_normal(&seed);
    c->noise = fmax(noise * most, 1e-6);
}

static kn_model_comparison compare(int curves, const kn_curve *curve)
{
    char error[200] = "";
    kn_model_comparison m;
    CHECK(kn_model_comparison_run(&m, curves, curve, 0, error, sizeof error));
    CHECK_STR(error + (*error ? strlen(error) : 0), "");
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
    static made data;
    const kn_network net = burgers();
    hold(&data, &net, 0.005);
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &data.curve);
    const kn_model_comparison_row *row = row_of(&m, "two Maxwell units");
    CHECK(&m.row[kn_model_comparison_best(&m)] == row);
    CHECK_NEAR(number(row, "k1") + number(row, "k2"), 2e4, 300); // both springs respond to the step at once
    CHECK(row->held < 0.01 && row->runs < 3);
    CHECK(strstr(verdict(&m), "the data support two Maxwell units (g h j k)") && !strstr(verdict(&m), "yardstick"));
    CHECK(row_of(&m, "Maxwell unit")->held > 0.1 && row_of(&m, "a - b ln t")->held > 0.1);
}

TEST("the creep of a Burgers element is identified, with its four parameters within 5 %")
{
    static made data;
    const kn_network net = burgers();
    creep(&data, &net, 3000, 0.002);
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &data.curve);
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
    static made data[3];
    kn_curve curve[3];
    const double load[] = {981, 4903, 8826};
    const kn_network net = kn_network_of(&dough);
    for (int i = 0; i < 3; i++) {
        creep(&data[i], &net, load[i], 0.005);
        curve[i] = data[i].curve;
    }
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
}

// A relaxation like fish muscle's, made as fractional Maxwell. It spans five decades and falls three to four fold in
// each three of them.
static void muscle(made *m, double noise)
{
    const kn_fractional_maxwell f = {.v_pa_s = 1.1e6, .v_order = 0.7, .g_pa_s = 2.2e4, .g_order = 0.11};
    made_begin(m, KN_CURVE_RELAX, 0);
    for (int i = 0; i < 560; i++) {
        const double t = 0.014 * pow(10, i * 4.85 / 560);
        double g;
        kn_fractional_maxwell_relax(&f, 0, 1, &t, &g);
        made_put(m, t, g * (1 + noise * kn_dice_normal(&seed)), 0);
    }
}

TEST("the verdict names a yardstick that fits best, and the thinning element predicts better than the Maxwell units")
{
    static made data;
    muscle(&data, 0.003);
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &data.curve);
    const kn_model_comparison_row *row = row_of(&m, "fractional Maxwell"),
                                  *thins = row_of(&m, "(s|d)-d thinning, c1 = 0");
    CHECK(&m.row[kn_model_comparison_best(&m)] == row);
    CHECK_NEAR(number(row, "a"), 0.7, 0.05);
    CHECK_NEAR(number(row, "G") / 2.2e4, 1, 0.02);
    CHECK(row->held < 0.02 && row->runs < 3);
    CHECK(strstr(verdict(&m), "a yardstick wins") && !strstr(verdict(&m), "none of them is the material"));
    CHECK(thins->held < 0.2 && row_of(&m, "Maxwell unit")->held > 3 * thins->held);
    CHECK(row_of(&m, "two Maxwell units")->held > 2 * thins->held);
}

TEST("without noise, rounding errors of the means do not decide between the models")
{
    static made data;
    const kn_network net = burgers();
    hold(&data, &net, 0);
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &data.curve);
    const kn_model_comparison_row *row = row_of(&m, "two Maxwell units");
    CHECK(row->early < KN_COMPARISON_FINE);
    CHECK_NEAR(row->aicc, kn_fit_aicc(m.early, 4, m.early * KN_COMPARISON_FINE * KN_COMPARISON_FINE), 1e-9);
    CHECK(strstr(verdict(&m), "the data support two Maxwell units (g h j k): ") != NULL);
    for (int i = 0; i < 4; i++) CHECK(!row->loose[i]);
}

TEST("under more changes of load than the superposition takes, only the yardsticks have no fit")
{
    static made data;
    const kn_network net = burgers();
    creep(&data, &net, 3000, 0.002);
    data.curve.steps = KN_SUPERPOSITION_STEPS + 1;
    for (int k = 2; k < data.curve.steps; k++) data.curve.step[k] = (kn_curve_step){.time_s = 60 + k, .stress_pa = 0};
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &data.curve);
    for (int i = 0; i < m.rows; i++) CHECK(m.row[i].fitted == !m.row[i].model.yardstick);
}

TEST("the verdict says so if no model explains the curve")
{
    static made data;
    muscle(&data, 0.0005);
    for (int i = 0; i < data.curve.count; i++) data.value[i] *= 1 + 0.03 * sin(6 * log(data.time_s[i]));
    AT_END(kn_model_comparison_free) kn_model_comparison m = compare(1, &data.curve);
    CHECK(strstr(verdict(&m), "none of them is the material"));
}

TEST("too few readings, a stress of 0 or below, and more than six curves are refused with a message")
{
    static made data;
    kn_model_comparison m;
    char error[200];
    const kn_network net = burgers();
    hold(&data, &net, 0);
    data.curve.count = 9;
    CHECK(!kn_model_comparison_run(&m, 1, &data.curve, 0, error, sizeof error) && strstr(error, "too few"));
    kn_model_comparison_free(&m);
    hold(&data, &net, 0);
    for (int i = 100; i < 110; i++) data.value[i] = -1;
    CHECK(!kn_model_comparison_run(&m, 1, &data.curve, 0, error, sizeof error) && strstr(error, "falls to 0"));
    kn_model_comparison_free(&m);
    kn_curve many[7];
    for (int i = 0; i < 7; i++) many[i] = data.curve;
    CHECK(!kn_model_comparison_run(&m, 7, many, 0, error, sizeof error) && strstr(error, "at most 6"));
    kn_model_comparison_free(&m);
}

TESTS_MAIN
