// The law as the kernels compute it in f64, sixteen edges at a time, compared with the scalar law.
#define KN_KERNEL_BASE 1
#pragma GCC diagnostic ignored "-Wpsabi"           // these vectors never cross into another file
#pragma GCC diagnostic ignored "-Wunused-function" // this test calls only the law among the kernels' parts
#include "core/solve/kernel_law.h"
#include "tests/lattice.h"

typedef struct errors {
    double stress, slope;
} errors;

// Return the largest relative errors on both sides of 0, over four decades more than the table's range.
static errors worst_of(const kn_model *model, kn_linearization how)
{
    enum { POINTS = 20000 };
    _Alignas(64) law_tables t;
    law_tables_build(&t, model);
    const kn_law *law = &model->law;
    errors worst = {0, 0};
    for (int i = 0; i < POINTS; i += KN_LANES) {
        _Alignas(64) real at[KN_LANES], stress[KN_LANES], root[KN_LANES];
        lanes s, c;
        for (int l = 0; l < KN_LANES; l++)
            at[l] = (l % 2 ? 1 : -1) * 0.01 * law->b0_pa * pow(1e4 * law->bh_pa / law->b0_pa, (i + l) / (double)POINTS);
        law_of(model, &t, t.kind, how, lanes_load(at), &s, &c);
        lanes_store(stress, s);
        lanes_store(root, c);
        for (int l = 0; l < KN_LANES; l++) {
            double exact = kn_law_stress(law, at[l]), slope = kn_law_slope(law, exact, how);
            worst.stress = fmax(worst.stress, fabs(stress[l] / exact - 1));
            worst.slope = fmax(worst.slope, fabs(root[l] * root[l] / slope - 1));
        }
    }
    return worst;
}

TEST("in f64 the vector law is exact to 1e-11, to 1e-14 for the identified c1, and its slope to 0.3 %, over twelve "
     "decades of c1")
{
    static const double c1[] = {1e-6, 1e-3, 1, 10, 1e3, 1e6};
    for (int i = 0; i < 6; i++)
        for (kn_linearization how = KN_LINEARIZATION_BLEND; how <= KN_LINEARIZATION_TANGENT; how++) {
            kn_model_def def = press_def(1);
            def.solver.precision = KN_PRECISION_F64;
            def.material.c1_pa_s *= c1[i];
            OWN(kn_model) *model = build(&def);
            CHECK(model->law.kind == KN_LAW_EXACT && kn_law_in_lanes(&model->law));
            errors worst = worst_of(model, how);
            printf("     c1 times %g, linearisation %d: stress %.1e, slope %.1e\n", c1[i], how, worst.stress,
                   worst.slope);
            CHECK_NEAR(worst.stress, 0, c1[i] == 1 ? 1e-14 : 1e-11);
            CHECK_NEAR(worst.slope, 0, 3e-3);
        }
}

TEST("the reciprocal square root is exact to 2.3e-16 from 1e-300 to 1e300")
{
    double worst = 0;
    for (int i = 0; i < 100000; i += KN_LANES) {
        _Alignas(64) real at[KN_LANES], root[KN_LANES];
        for (int l = 0; l < KN_LANES; l++) at[l] = pow(10, (i + l) * 6e-3 - 300);
        lanes_store(root, lanes_inverse_root(lanes_load(at)));
        for (int l = 0; l < KN_LANES; l++) {
            long double exact = 1 / sqrtl((long double)at[l]);
            worst = fmax(worst, (double)fabsl((long double)root[l] / exact - 1));
        }
    }
    printf("     worst %.2g\n", worst);
    CHECK_NEAR(worst, 0, 2.3e-16);
}
