#include "core/law.h"
#include "tests/check.h"
#include "tests/dough.h"

// The reference: s + A s/c2(s) = b, solved by bisection on [0, |b|] until the interval is two neighbouring doubles.
// The reference shares no code with the law; the damper's formula is repeated here.
static double damper(const kn_material *m, double s)
{
    if (m->damper == KN_DAMPER_CONSTANT) return m->c2_pa_s;
    double clamped = s < m->p0_pa ? m->p0_pa : s > m->p1_pa ? m->p1_pa : s;
    if (m->damper == KN_DAMPER_RAMP)
        return m->c_max_pa_s - (m->c_max_pa_s - m->c_min_pa_s) * (clamped - m->p0_pa) / (m->p1_pa - m->p0_pa);
    return m->alpha_pa_s * exp(-m->beta_per_pa * clamped);
}

static double bisect(const kn_material *m, double a, double b)
{
    double lo = 0, hi = fabs(b);
    for (;;) {
        double s = 0.5 * (lo + hi);
        if (s <= lo || s >= hi) return copysign(s, b);
        if (s + a * s / damper(m, s) > fabs(b)) hi = s;
        else lo = s;
    }
}

static kn_law law_of(const kn_material *m, double dt_s, bool exact)
{
    kn_law law;
    kn_law_build(&law, m, dt_s, exact);
    return law;
}

// Evaluate the table in f32 as the kernels do.
static float table(const kn_law *law, float b)
{
    float y = b / (float)law->b0_pa, yh = (float)(law->bh_pa / law->b0_pa), one = 1, in = fminf(fmaxf(y, 1), yh);
    unsigned bits, unit;
    memcpy(&bits, &in, 4);
    memcpy(&unit, &one, 4);
    unsigned i = (bits - unit) >> law->shift;
    float p = law->cubic[0][i] + in * (law->cubic[1][i] + in * (law->cubic[2][i] + in * law->cubic[3][i]));
    return (float)law->b0_pa * fmaxf((float)law->slope_flow * y, fminf((float)law->slope_rest * y, p));
}

// Return the largest relative error of the law, or of its table, on `points` places.
static double worst_of(const kn_law *law, bool of_table, double from, double to, int points)
{
    double worst = 0;
    for (int i = 0; i <= points; i++) {
        double b = from * pow(to / from, (double)i / points), right = bisect(&law->mat, law->a_pa_s, b);
        double own = of_table ? (double)table(law, (float)b) : kn_law_stress(law, b);
        worst = fmax(worst, fabs(own - right) / right);
    }
    return worst;
}

static double worst_exact(const kn_law *law, double from, double to) { return worst_of(law, false, from, to, 1000); }

static float table_slope(const kn_law *law, float y, int how)
{
    unsigned bits;
    memcpy(&bits, &y, 4);
    unsigned i = (bits - 0x3f800000u) >> law->shift;
    float root = law->slope[how][0][i] + y * (law->slope[how][1][i] + y * law->slope[how][2][i]);
    return root * root;
}

TEST("the stress of a flowing edge solves s + A g(s) = b within 1e-12 of bisection over twelve decades")
{
    static const double dt[] = {0, 1e-5, 1e-3, 0.1};
    for (int i = 0; i < 4; i++) {
        kn_law law = law_of(&dough, dt[i], true);
        CHECK(law.kind == KN_LAW_EXACT);
        CHECK_NEAR(law.a_pa_s, dough.c1_pa_s + dt[i] * dough.k1_pa, 1e-9 * law.a_pa_s);
        CHECK_NEAR(worst_exact(&law, 1e-3, 1e9), 0, 1e-12);
    }
}

TEST("the table of the identified dough follows the exact law within 1e-4 and states its own error")
{
    kn_law law = law_of(&dough, 1e-3, false);
    CHECK(law.kind == KN_LAW_TABLE);
    double worst = worst_of(&law, true, law.b0_pa * 0.01, 1e2 * law.bh_pa, 20000);
    CHECK_NEAR(worst, 0, 1e-4);
    CHECK(worst <= 1.1 * law.table_error + 1e-6);
    CHECK(law.table_error < 1e-4);
}

TEST("the exact law is odd and increasing, and so is the table")
{
    for (int exact = 0; exact < 2; exact++) {
        kn_law law = law_of(&dough, 1e-3, exact);
        double before = 0;
        float table_before = 0;
        for (int i = 0; i <= 5000; i++) {
            double b = 1.0 * pow(1e7, i / 5000.0), s = kn_law_stress(&law, b);
            CHECK(s > before && s <= b);
            CHECK(kn_law_stress(&law, -b) == -s);
            before = s;
            if (exact) continue;
            float t = table(&law, (float)b);
            CHECK(t > table_before);
            table_before = t;
        }
        CHECK(kn_law_stress(&law, 0) == 0);
    }
}

TEST("the kinks are exact: the resting line ends at p0, and the flowing line begins at p1")
{
    kn_law law = law_of(&dough, 1e-3, false);
    CHECK_NEAR(law.s0_pa, dough.p0_pa, 0);
    CHECK_NEAR(law.b0_pa, dough.p0_pa * (1 + law.a_pa_s / damper(&dough, dough.p0_pa)), 1e-9 * law.b0_pa);
    CHECK_NEAR(law.bh_pa, dough.p1_pa * (1 + law.a_pa_s / damper(&dough, dough.p1_pa)), 1e-9 * law.bh_pa);
    CHECK_NEAR(kn_law_stress(&law, law.b0_pa), dough.p0_pa, 1e-9 * dough.p0_pa);
    CHECK_NEAR(kn_law_stress(&law, law.bh_pa), dough.p1_pa, 1e-9 * dough.p1_pa);
    for (double eps = 1e-3; eps > 1e-7; eps /= 10) { // no jump on either side
        double step0 = kn_law_stress(&law, law.b0_pa * (1 + eps)) - kn_law_stress(&law, law.b0_pa * (1 - eps));
        double step1 = kn_law_stress(&law, law.bh_pa * (1 + eps)) - kn_law_stress(&law, law.bh_pa * (1 - eps));
        CHECK(step0 <= 2.01 * eps * law.b0_pa && step1 <= 2.01 * eps * law.bh_pa);
    }
    CHECK_NEAR(table(&law, (float)law.b0_pa), dough.p0_pa, 1e-5 * dough.p0_pa);
    CHECK_NEAR(table(&law, (float)law.bh_pa), dough.p1_pa, 1e-4 * dough.p1_pa);
}

TEST("the secant slope is s/b, the tangent slope is the derivative, and the blend is their mean")
{
    kn_law law = law_of(&dough, 1e-3, false);
    for (int i = 0; i <= 200; i++) {
        double b = 10 * pow(1e5, i / 200.0), s = kn_law_stress(&law, b);
        if (fabs(b / law.b0_pa - 1) < 1e-3 || fabs(b / law.bh_pa - 1) < 1e-3) continue; // the derivative jumps here
        double secant = kn_law_slope(&law, s, KN_LINEARIZATION_SECANT);
        double tangent = kn_law_slope(&law, s, KN_LINEARIZATION_TANGENT);
        double blend = kn_law_slope(&law, s, KN_LINEARIZATION_BLEND);
        double h = 1e-5 * b,
               difference = (bisect(&dough, law.a_pa_s, b + h) - bisect(&dough, law.a_pa_s, b - h)) / (2 * h);
        CHECK_NEAR(secant, s / b, 1e-9 * secant);
        CHECK_NEAR(tangent, difference, 1e-6 * tangent);
        CHECK_NEAR(blend, 0.5 * (secant + tangent), 1e-12);
        CHECK(0 < tangent && tangent <= secant * (1 + 1e-12) && secant <= 1);
        CHECK(kn_law_slope(&law, -s, KN_LINEARIZATION_BLEND) == blend);
    }
}

TEST("the slopes of the table are within 2 % of the exact slopes and never negative")
{
    kn_law law = law_of(&dough, 1e-3, false);
    double worst = 0;
    for (int how = 0; how < 3; how++)
        for (int i = 1; i < 5000; i++) {
            double y = pow(law.bh_pa / law.b0_pa, i / 5000.0);
            double exact = kn_law_slope(&law, kn_law_stress(&law, y * law.b0_pa), (kn_linearization)how);
            double slope = (double)table_slope(&law, (float)y, how);
            CHECK(slope > 0 && slope <= 1);
            worst = fmax(worst, fabs(slope - exact) / exact);
        }
    CHECK_NEAR(worst, 0, 0.02);
}

TEST("without a damper the law is the Voigt line s = b")
{
    kn_law law = law_of(&(kn_material){.k1_pa = 5e3, .c1_pa_s = 20, .damper = KN_DAMPER_NONE}, 1e-3, false);
    CHECK(law.kind == KN_LAW_VOIGT);
    CHECK(kn_law_stress(&law, 123.5) == 123.5 && kn_law_stress(&law, -123.5) == -123.5);
    CHECK(kn_law_slope(&law, 50, KN_LINEARIZATION_BLEND) == 1);
}

TEST("a constant damper gives the straight line of c1 + dt k1 in series with c2, also for k1 = 0 and c1 = 0")
{
    const kn_material clay = {.c1_pa_s = 4e4, .damper = KN_DAMPER_CONSTANT, .c2_pa_s = 4e4};
    const kn_material maxwell = {.k1_pa = 3e4, .damper = KN_DAMPER_CONSTANT, .c2_pa_s = 60};
    kn_material soft = dough;
    soft.c1_pa_s = 0;
    // the last two: the explicit law of a spring alone, s = k1 u
    kn_law a = law_of(&clay, 1e-3, false), b = law_of(&maxwell, 1e-3, false), c = law_of(&maxwell, 0, false);
    kn_law d = law_of(&soft, 0, true);
    CHECK(a.kind == KN_LAW_LINEAR);
    CHECK_NEAR(kn_law_stress(&a, 1000), 500, 1e-9); // c1 = c2 = 2c: half
    CHECK_NEAR(b.a_pa_s, 30, 1e-12);
    CHECK_NEAR(kn_law_stress(&b, 90), 60, 1e-9);
    CHECK_NEAR(kn_law_stress(&c, 90), 90, 1e-12);
    CHECK_NEAR(kn_law_stress(&d, 5e3), 5e3, 1e-9);
}

TEST("a law too wide for sixteen table segments is solved exactly instead; with p0 = 0 it is followed within 1e-4")
{
    kn_material wide = dough, early = dough;
    wide.beta_per_pa *= 10; // c2 falls by a factor of e^58
    early.p0_pa = 0;        // starts to thin at zero stress
    kn_law a = law_of(&wide, 1e-3, false), b = law_of(&early, 1e-3, true);
    CHECK(a.kind == KN_LAW_EXACT);
    CHECK_NEAR(worst_exact(&a, 1e-3, 1e12), 0, 1e-12);
    CHECK_NEAR(worst_exact(&b, 1e-3, 1e8), 0, 1e-4);
}

TEST("every law with a table is within 1.05e-3, over eight decades of k1, c1 and alpha, and p1 of 1.5 to 17.5 p0")
{
    static const double scale[5] = {1e-4, 1e-2, 1, 1e2, 1e4};
    int tables = 0;
    for (int i = 0; i < 5 * 5 * 5 * 5; i++) {
        kn_material m = dough;
        m.k1_pa *= scale[i % 5];
        m.c1_pa_s *= scale[i / 5 % 5];
        m.alpha_pa_s *= scale[i / 25 % 5];
        m.p1_pa = m.p0_pa * (1.5 + 4 * (i / 125));
        kn_law law = law_of(&m, 1e-3, false);
        tables += law.kind == KN_LAW_TABLE;
        if (law.kind != KN_LAW_TABLE) CHECK_NEAR(worst_exact(&law, 1, 1e8), 0, 1e-12);
        else CHECK_NEAR(worst_of(&law, true, 0.5 * law.b0_pa, 2 * law.bh_pa, 2000), 0, 1.05e-3);
    }
    CHECK(tables > 100);
    printf("     %d tables, %d solved exactly\n", tables, 625 - tables);
}

// Return dough whose two plateaus are joined by a straight line.
static kn_material ramp(double c_max, double c_min, double p0, double p1)
{
    kn_material m = dough;
    m.damper = KN_DAMPER_RAMP;
    m.c_max_pa_s = c_max * GF_CM2;
    m.c_min_pa_s = c_min * GF_CM2;
    m.p0_pa = p0 * GF_CM2;
    m.p1_pa = p1 * GF_CM2;
    return m;
}

TEST("a ramp is solved exactly to 1e-12 and by its table to 1e-3; the stress increases and the kinks are exact")
{
    const kn_material m[] = {ramp(39190, 120, 9, 80), ramp(39190, 20000, 9, 80), ramp(3919, 120, 0, 80),
                             ramp(500, 499, 1, 2)};
    for (int i = 0; i < 4; i++) {
        kn_law exact = law_of(&m[i], 1e-3, true), fast = law_of(&m[i], 1e-3, false);
        CHECK(exact.kind == KN_LAW_EXACT);
        // With p0 = 0 the law has no resting line. Below 1e-4 of the ramp the law takes the resting line.
        CHECK_NEAR(worst_exact(&exact, 1e-3, 1e9), 0, m[i].p0_pa > 0 ? 1e-12 : 1e-4);
        printf("     ramp %d: %s, table error %.1e\n", i, fast.kind == KN_LAW_TABLE ? "table" : "exact",
               fast.table_error);
        double worst = 0, before = 0, slope_off = 0;
        for (int k = 0; k <= 4000; k++) {
            double b = 0.5 * fast.b0_pa * pow(4 * fast.bh_pa / fast.b0_pa, k / 4000.0), s = kn_law_stress(&fast, b);
            CHECK(s > before);
            before = s;
            if (fast.kind == KN_LAW_TABLE) worst = fmax(worst, fabs((double)table(&fast, (float)b) - s) / s);
            if (fabs(b / fast.b0_pa - 1) < 1e-3 || fabs(b / fast.bh_pa - 1) < 1e-3) continue;
            double h = 1e-6 * b, rise = (kn_law_stress(&exact, b + h) - kn_law_stress(&exact, b - h)) / (2 * h);
            slope_off = fmax(slope_off, fabs(kn_law_slope(&exact, s, KN_LINEARIZATION_TANGENT) / rise - 1));
        }
        CHECK_NEAR(worst, 0, 1.05e-3);
        CHECK_NEAR(slope_off, 0, 1e-4);
        CHECK_NEAR(kn_law_stress(&fast, fast.bh_pa), m[i].p1_pa, 1e-9 * m[i].p1_pa);
    }
}
