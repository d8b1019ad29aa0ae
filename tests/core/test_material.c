#include "core/material.h"
#include "tests/check.h"
#include "tests/dough.h"

TEST("the identified dough's damper falls from 39 190 to 120 gf s/cm^3, through 8 330 at 28 gf/cm^2 and 1 387 at 50")
{
    CHECK_NEAR(kn_material_c2(&dough, 0) / GF_CM2, 39190, 10);
    CHECK_NEAR(kn_material_c2(&dough, 9 * GF_CM2) / GF_CM2, 39190, 10);
    CHECK_NEAR(kn_material_c2(&dough, 28 * GF_CM2) / GF_CM2, 8330, 5);
    CHECK_NEAR(kn_material_c2(&dough, 50 * GF_CM2) / GF_CM2, 1387, 1);
    CHECK_NEAR(kn_material_c2(&dough, 80 * GF_CM2) / GF_CM2, 120.3, 0.1);
    CHECK_NEAR(kn_material_c2(&dough, 1e9) / GF_CM2, 120.3, 0.1);
}

TEST("the damper's viscosity does not depend on the sign of the stress, and its flow follows the sign")
{
    for (double s = 1; s < 1e6; s *= 3) {
        CHECK(kn_material_c2(&dough, -s) == kn_material_c2(&dough, s));
        CHECK(kn_material_flow(&dough, -s) == -kn_material_flow(&dough, s));
        CHECK_NEAR(kn_material_flow(&dough, s) * kn_material_c2(&dough, s), s, 1e-12 * s);
    }
}

TEST("the flow grows with the stress, without a jump at p0 or p1")
{
    double before = 0;
    for (int i = 1; i <= 20000; i++) {
        double s = i * 0.5, flow = kn_material_flow(&dough, s);
        CHECK(flow > before);
        if (i > 1) CHECK(flow < before * (1 + 3 / s + 5e-3));
        before = flow;
    }
}

TEST("a rigid damper does not flow, and a constant damper flows in proportion to the stress")
{
    kn_material m = {.k1_pa = 1e3, .damper = KN_DAMPER_NONE};
    CHECK(isinf(kn_material_c2(&m, 5)) && kn_material_flow(&m, 1e6) == 0);
    m.damper = KN_DAMPER_CONSTANT;
    m.c2_pa_s = 250;
    CHECK(kn_material_c2(&m, 1e6) == 250);
    CHECK_NEAR(kn_material_flow(&m, 1000), 4, 1e-12);
}

static const char *spoilt(double *field, kn_material *m, double value)
{
    double was = *field;
    *field = value;
    const char *complaint = kn_material_check(m);
    *field = was;
    return complaint;
}

TEST("every invalid parameter is named in the error, and dough and the limits of its law are accepted")
{
    kn_material m = dough;
    CHECK(!kn_material_check(&m));
    double *fields[] = {&m.k1_pa, &m.c1_pa_s, &m.alpha_pa_s, &m.beta_per_pa, &m.p0_pa, &m.p1_pa};
    const char *names[] = {"k1", "c1", "alpha", "beta", "p0", "p1"};
    for (int i = 0; i < 6; i++) {
        double bad[] = {-1, (double)NAN, (double)INFINITY};
        for (int k = 0; k < 3; k++) {
            const char *complaint = spoilt(fields[i], &m, bad[k]);
            CHECK(complaint && strstr(complaint, names[i]));
        }
    }
    CHECK(spoilt(&m.alpha_pa_s, &m, 0));
    CHECK(spoilt(&m.p1_pa, &m, m.p0_pa));
    CHECK(!spoilt(&m.k1_pa, &m, 0) && !spoilt(&m.c1_pa_s, &m, 0) && !spoilt(&m.beta_per_pa, &m, 0));
    CHECK(!spoilt(&m.p0_pa, &m, 0));
    m.k1_pa = m.c1_pa_s = 0;
    CHECK(kn_material_check(&m));
    kn_material constant = {.k1_pa = 1, .damper = KN_DAMPER_CONSTANT};
    CHECK(kn_material_check(&constant)); // c2 = 0
    constant.c2_pa_s = 1;
    CHECK(!kn_material_check(&constant));
}

static const kn_material ramp = {.k1_pa = 470 * GF_CM2,
                                 .c1_pa_s = 2500 * GF_CM2,
                                 .damper = KN_DAMPER_RAMP,
                                 .c_max_pa_s = 39190 * GF_CM2,
                                 .c_min_pa_s = 120 * GF_CM2,
                                 .p0_pa = 9 * GF_CM2,
                                 .p1_pa = 80 * GF_CM2};

TEST("a ramp falls linearly from c_max at p0 to c_min at p1 and is constant outside")
{
    CHECK(kn_material_c2(&ramp, 0) == ramp.c_max_pa_s && kn_material_c2(&ramp, -9 * GF_CM2) == ramp.c_max_pa_s);
    CHECK_NEAR(kn_material_c2(&ramp, 44.5 * GF_CM2) / GF_CM2, (39190 + 120) / 2.0, 1e-6);
    CHECK_NEAR(kn_material_c2(&ramp, 80 * GF_CM2) / GF_CM2, 120, 1e-6);
    CHECK_NEAR(kn_material_c2(&ramp, 1e9) / GF_CM2, 120, 1e-6);
}

TEST("the thinning is -d ln c2/d stress for both laws, and 0 where the damper is constant")
{
    const kn_material *m[] = {&dough, &ramp};
    for (int i = 0; i < 2; i++)
        for (double s = 10 * GF_CM2; s < 79 * GF_CM2; s += 100) {
            double fall = log(kn_material_c2(m[i], s - 0.1) / kn_material_c2(m[i], s + 0.1)) / 0.2;
            CHECK_NEAR(kn_material_thinning(m[i], s) / fall, 1, 1e-5);
        }
    CHECK(kn_material_thinning(&dough, 0) == 0 && kn_material_thinning(&ramp, 81 * GF_CM2) == 0);
}

TEST("a ramp that rises is refused")
{
    kn_material m = ramp;
    m.c_min_pa_s = 1.1 * m.c_max_pa_s;
    CHECK(kn_material_check(&m) && strstr(kn_material_check(&m), "c_min <= c_max"));
    m.c_min_pa_s = 0;
    CHECK(kn_material_check(&m));
}

TEST("the stops limit the permanent strain to a0/a_max - 1 and a0/a_min - 1; equal stops make the damper rigid")
{
    kn_material m = dough;
    double in, out;
    CHECK(!kn_material_stroke(&m, &in, &out) && isinf(in) && isinf(out));
    m.ratio = 0.2;
    m.stroke[0] = 0.02;
    m.stroke[1] = 0.98;
    CHECK(!kn_material_check(&m) && !kn_material_stroke(&m, &in, &out));
    CHECK_NEAR(in, 0.2 / 0.98 - 1, 1e-12);
    CHECK_NEAR(out, 9, 1e-12);
    m.ratio = 0.99; // outside the allowed range
    CHECK(kn_material_check(&m) && strstr(kn_material_check(&m), "ratio"));
    m.ratio = m.stroke[0] = m.stroke[1] = 1;
    CHECK(!kn_material_check(&m) && kn_material_stroke(&m, &in, &out));
    CHECK(isinf(kn_material_c2(&m, 0)) && kn_material_flow(&m, 1e6) == 0);
    m.stroke[0] = 1.1;
    CHECK(kn_material_check(&m) && strstr(kn_material_check(&m), "stroke"));
}

TESTS_MAIN
