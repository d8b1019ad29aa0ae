#include "core/material.h"
#include "tests/check.h"
#include "tests/dough.h"

static const kn_material ramp = {.k1_pa = 470 * GF_CM2,
                                 .c1_pa_s = 2500 * GF_CM2,
                                 .damper = KN_DAMPER_RAMP,
                                 .c_max_pa_s = 39190 * GF_CM2,
                                 .c_min_pa_s = 120 * GF_CM2,
                                 .p0_pa = 9 * GF_CM2,
                                 .p1_pa = 80 * GF_CM2};

TEST("the identified dough's damper falls from 39 190 to 120 gf s/cm^3, through 8 330 at 28 gf/cm^2 and 1 387 at 50; a "
     "ramp falls linearly from p0 to p1")
{
    static const struct {
        const kn_material *m;
        double stress, c2, bound; // gf/cm^2, gf s/cm^3
    } table[] = {{&dough, 0, 39190, 10},     {&dough, 9, 39190, 10},    {&dough, 28, 8330, 5},  {&dough, 50, 1387, 1},
                 {&dough, 80, 120.3, 0.1},   {&dough, 1e7, 120.3, 0.1}, {&ramp, 0, 39190, 0},   {&ramp, -9, 39190, 0},
                 {&ramp, 44.5, 19655, 1e-6}, {&ramp, 80, 120, 1e-6},    {&ramp, 1e7, 120, 1e-6}};
    for (int i = 0; i < COUNT(table); i++)
        CHECK_NEAR(kn_material_c2(table[i].m, table[i].stress * GF_CM2) / GF_CM2, table[i].c2, table[i].bound);
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
    const kn_material none = {.k1_pa = 1e3, .damper = KN_DAMPER_NONE};
    const kn_material constant = {.k1_pa = 1e3, .damper = KN_DAMPER_CONSTANT, .c2_pa_s = 250};
    CHECK(isinf(kn_material_c2(&none, 5)) && kn_material_flow(&none, 1e6) == 0);
    CHECK(kn_material_c2(&constant, 1e6) == 250);
    CHECK_NEAR(kn_material_flow(&constant, 1000), 4, 1e-12);
}

TEST("every invalid parameter is named in the error, and dough and the limits of its law are accepted")
{
    static const struct {
        const char *name;
        size_t offset;
        bool zero; // 0 is accepted
    } fields[] = {
        {"k1", offsetof(kn_material, k1_pa), true},          {"c1", offsetof(kn_material, c1_pa_s), true},
        {"alpha", offsetof(kn_material, alpha_pa_s), false}, {"beta", offsetof(kn_material, beta_per_pa), true},
        {"p0", offsetof(kn_material, p0_pa), true},          {"p1", offsetof(kn_material, p1_pa), false}};
    static const double values[] = {0, -1, NAN, INFINITY};
    CHECK(!kn_material_check(&dough));
    for (int i = 0; i < COUNT(fields) * COUNT(values); i++) {
        kn_material m = dough;
        memcpy((char *)&m + fields[i / 4].offset, &values[i % 4], sizeof *values);
        const char *why = kn_material_check(&m);
        CHECK(i % 4 == 0 ? !why == fields[i / 4].zero : why && strstr(why, fields[i / 4].name));
    }
    kn_material none = dough, constant = {.k1_pa = 1, .damper = KN_DAMPER_CONSTANT}, rising = ramp;
    none.k1_pa = none.c1_pa_s = 0;
    CHECK(kn_material_check(&none));
    none = dough, none.p1_pa = none.p0_pa;
    CHECK(kn_material_check(&none));
    CHECK(kn_material_check(&constant)); // c2 = 0
    constant.c2_pa_s = 1;
    CHECK(!kn_material_check(&constant));
    rising.c_min_pa_s = 1.1 * rising.c_max_pa_s;
    CHECK(kn_material_check(&rising) && strstr(kn_material_check(&rising), "c_min <= c_max"));
    rising.c_min_pa_s = 0;
    CHECK(kn_material_check(&rising));
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

TEST("the stops limit the permanent strain to a0/a_max - 1 and a0/a_min - 1; equal stops make the damper rigid")
{
    kn_material m = dough;
    double in, out;
    CHECK(!kn_material_stroke(&m, &in, &out) && isinf(in) && isinf(out));
    m.ratio = 0.2, m.stroke[0] = 0.02, m.stroke[1] = 0.98;
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
