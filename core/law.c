#include "core/law.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

// Return ds/db for a damper with constant c2: 1/(1 + A/c2). An infinite c2 gives 1.
static double slope_of(const kn_law *law, double c2) { return 1.0 / (1.0 + law->a_pa_s / c2); }

static float float_of(unsigned bits)
{
    float f;
    memcpy(&f, &bits, sizeof f);
    return f;
}

static unsigned bits_of(float f)
{
    unsigned bits;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

#define ONE_BITS 0x3f800000u // bits of the float 1.0f

// Evaluate the f32 table as the kernels do. The result serves to measure the table's error and to start Newton's
// method.
static double table_stress(const kn_law *law, double b)
{
    // clamp to the table, find the segment from the float's bits, evaluate the cubic, and limit it by the straight ends
    float yh = (float)(law->bh_pa / law->b0_pa), y = (float)(b / law->b0_pa);
    float yc = fminf(fmaxf(y, 1.0f), yh);
    unsigned i = (bits_of(yc) - ONE_BITS) >> law->shift;
    float p = law->cubic[0][i] + yc * (law->cubic[1][i] + yc * (law->cubic[2][i] + yc * law->cubic[3][i]));
    return law->b0_pa * fmax(law->slope_flow * (double)y, fmin(law->slope_rest * (double)y, (double)p));
}

double kn_law_stress(const kn_law *law, double b_pa)
{
    double b = fabs(b_pa), s;
    if (b <= law->b0_pa || law->kind == KN_LAW_VOIGT || law->kind == KN_LAW_LINEAR) {
        s = law->slope_rest * b;
    } else if (b >= law->bh_pa) {
        s = law->slope_flow * b;
    } else {
        // Newton on ln(s (1 + A/c2(s)) / b), which is nearly straight in ln s. The bracket [lo, hi]
        // holds the root at all times.
        double lo = law->s0_pa, hi = law->s1_pa;
        s = fmin(fmax(law->seeded ? table_stress(law, b) : 0.5 * (law->slope_rest + law->slope_flow) * b, lo), hi);
        for (int i = 0; i < 60; i++) {
            double r = law->a_pa_s / kn_material_c2(&law->mat, s);
            double f = log(s * (1.0 + r) / b);
            if (fabs(f) <= 4e-16) break; // stop: f is as small as the rounding errors of the logarithm's argument
            // narrow the bracket, then take Newton's step or, if it leaves the bracket, bisect
            if (f > 0) hi = s;
            else lo = s;
            double next = s - f / (1.0 / s + kn_material_thinning(&law->mat, s) * r / (1.0 + r));
            if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
            if (next == s) break;
            s = next;
        }
    }
    return copysign(s, b_pa);
}

// Evaluate the f64 table as the kernels do.
static double fine_stress(const kn_law *law, double b)
{
    double yh = law->bh_pa / law->b0_pa, y = b / law->b0_pa, yc = fmin(fmax(y, 1), yh), p = 0;
    uint64_t bits;
    memcpy(&bits, &yc, sizeof bits);
    // keep the exponent bits and the top mantissa bits that a float has, so that the index equals the index in the f32
    // table
    uint64_t i = ((bits >> 29) - ((uint64_t)1023 << 23)) >> law->shift;
    for (int k = KN_LAW_FINE; k >= 0; k--) p = p * (yc - law->middle[i]) + law->fine[k][i];
    return law->b0_pa * fmax(law->slope_flow * y, fmin(law->slope_rest * y, p));
}

bool kn_law_in_lanes(const kn_law *law) { return law->kind == KN_LAW_EXACT && law->seeded && law->fine_error <= 1e-10; }

double kn_law_slope(const kn_law *law, double stress_pa, kn_linearization how)
{
    double s = fabs(stress_pa);
    if (law->kind == KN_LAW_VOIGT || law->kind == KN_LAW_LINEAR || s <= law->s0_pa) return law->slope_rest;
    if (s >= law->s1_pa) return law->slope_flow;
    double r = law->a_pa_s / kn_material_c2(&law->mat, s);
    double secant = 1.0 / (1.0 + r);
    // the tangent is 1/(1 + A g') with g' = (1 - s dln(c2)/ds)/c2
    double tangent = 1.0 / (1.0 + r * (1.0 + kn_material_thinning(&law->mat, s) * s));
    switch (how) {
    case KN_LINEARIZATION_SECANT: return secant;
    case KN_LINEARIZATION_TANGENT: return tangent;
    default: return 0.5 * (secant + tangent);
    }
}

double kn_law_stop(const kn_law *law, double stress_pa, double b_pa, double inwards, double outwards)
{
    double per_strain = law->a_pa_s / law->dt_s;
    double in = inwards > KN_LAW_STROKE_ENDS ? per_strain * inwards : 0;
    double out = outwards > KN_LAW_STROKE_ENDS ? per_strain * outwards : 0;
    return fmax(b_pa - out, fmin(stress_pa, b_pa + in));
}

// Find the coefficients of the polynomial of `degree` through (at, value).
static void fit(int degree, const double *value, const double *at, double *monomial)
{
    double newton[KN_LAW_FINE + 1], product[KN_LAW_FINE + 2] = {1};
    // divided differences give Newton's form
    for (int i = 0; i <= degree; i++) newton[i] = value[i];
    for (int level = 1; level <= degree; level++)
        for (int i = degree; i >= level; i--) newton[i] = (newton[i] - newton[i - 1]) / (at[i] - at[i - level]);
    // expand Newton's products into monomials
    for (int i = 0; i <= degree; i++) monomial[i] = 0;
    for (int i = 0; i <= degree; i++) {
        for (int k = 0; k <= i; k++) monomial[k] += newton[i] * product[k];
        for (int k = i + 1; k > 0; k--) product[k] = product[k - 1] - at[i] * product[k];
        product[0] *= -at[i];
    }
}

// Fill `at` with the Chebyshev-Lobatto points of [y0, y1]. They include both ends, so neighbouring segments join.
static void lobatto(int degree, double y0, double y1, double *at)
{
    static const double quadratic[3] = {-1, 0, 1}, cubic[4] = {-1, -0.5, 0.5, 1};
    // cos(pi i/13), written out, because a compiler and a library may compute a cosine differently
    static const double fine[KN_LAW_FINE + 1] = {-1,
                                                 -0.97094181742605202716,
                                                 -0.88545602565320989590,
                                                 -0.74851074817110109863,
                                                 -0.56806474673115580251,
                                                 -0.35460488704253562597,
                                                 -0.12053668025532305335,
                                                 0.12053668025532305335,
                                                 0.35460488704253562597,
                                                 0.56806474673115580251,
                                                 0.74851074817110109863,
                                                 0.88545602565320989590,
                                                 0.97094181742605202716,
                                                 1};
    const double *node = degree == 2 ? quadratic : degree == 3 ? cubic : fine;
    for (int i = 0; i <= degree; i++) at[i] = 0.5 * (y0 + y1) + 0.5 * (y1 - y0) * node[i];
}

// Return sqrt(ds/db) at y between the two straight branches. At b0 and bh, where the slope jumps, take the value on the
// inner side.
static double root_at(const kn_law *law, double y, unsigned how)
{
    double s = kn_law_stress(law, y * law->b0_pa);
    s = fmin(fmax(s, law->s0_pa * (1 + 1e-12)), law->s1_pa * (1 - 1e-12));
    return sqrt(kn_law_slope(law, s, (kn_linearization)how));
}

// Fit one segment of the f32 table: a cubic for the stress, quadratics for the roots of the slopes.
static void fit_segment(kn_law *law, int segment, double y0, double y1)
{
    double at[4], value[4], monomial[4];
    lobatto(3, y0, y1, at);
    for (int i = 0; i < 4; i++) value[i] = kn_law_stress(law, at[i] * law->b0_pa) / law->b0_pa;
    fit(3, value, at, monomial);
    for (int k = 0; k < 4; k++) law->cubic[k][segment] = (float)monomial[k];
    lobatto(2, y0, y1, at);
    for (unsigned how = 0; how < 3; how++) {
        for (int i = 0; i < 3; i++) value[i] = root_at(law, at[i], how);
        fit(2, value, at, monomial);
        for (int k = 0; k < 3; k++) law->slope[how][k][segment] = (float)monomial[k];
    }
}

// Fit one segment of the f64 table. The variable is y minus the middle of the segment, so that a high degree loses no
// digits.
static void fit_fine(kn_law *law, int segment, double y0, double y1)
{
    double middle = law->middle[segment] = 0.5 * (y0 + y1);
    double at[KN_LAW_FINE + 1], value[KN_LAW_FINE + 1], monomial[KN_LAW_FINE + 1];
    lobatto(KN_LAW_FINE, y0 - middle, y1 - middle, at);
    for (int i = 0; i <= KN_LAW_FINE; i++) value[i] = kn_law_stress(law, (middle + at[i]) * law->b0_pa) / law->b0_pa;
    fit(KN_LAW_FINE, value, at, monomial);
    for (int k = 0; k <= KN_LAW_FINE; k++) law->fine[k][segment] = monomial[k];
    lobatto(3, y0 - middle, y1 - middle, at);
    for (unsigned how = 0; how < 3; how++) {
        for (int i = 0; i < 4; i++) value[i] = root_at(law, middle + at[i], how);
        fit(3, value, at, monomial);
        for (int k = 0; k < 4; k++) law->fine_slope[how][k][segment] = monomial[k];
    }
}

// Return the largest |table - exact|/exact of s over [b0, bh].
static double error_of(const kn_law *law, double (*table)(const kn_law *, double))
{
    double worst = 0;
    for (int i = 0; i <= 4000; i++) {
        double b = law->b0_pa * pow(law->bh_pa / law->b0_pa, i / 4000.0), exact = kn_law_stress(law, b);
        worst = fmax(worst, fabs(table(law, b) - exact) / exact);
    }
    return worst;
}

// Build the table. With half an octave of b per segment, 16 segments cover 8 octaves. If the law has a wider range of
// b, each segment covers one, two or four octaves.
static void build_table(kn_law *law, bool exact)
{
    // choose the width of the segments; a law that needs segments of more than four octaves has no table
    float yh = (float)(law->bh_pa / law->b0_pa);
    law->shift = 22;
    while (law->shift < 25 && (bits_of(yh) - ONE_BITS) >> law->shift >= KN_LAW_SEGMENTS) law->shift++;
    unsigned used = ((bits_of(yh) - ONE_BITS) >> law->shift) + 1;
    if (used > KN_LAW_SEGMENTS) {
        law->table_error = 1;
        return;
    }
    for (unsigned i = 0; i < used; i++) {
        double y0 = float_of(ONE_BITS + (i << law->shift)), y1 = float_of(ONE_BITS + ((i + 1) << law->shift));
        // yh == y0 happens if the table ends exactly where the last segment begins: this segment is empty
        if (yh > y0) fit_segment(law, (int)i, y0, fmin(y1, yh));
        if (exact && yh > y0) fit_fine(law, (int)i, y0, fmin(y1, law->bh_pa / law->b0_pa));
    }
    // measure the error; the kernels use a table only if its error is small enough
    law->table_error = error_of(law, table_stress);
    law->seeded = law->table_error <= 1e-3;
    if (exact) law->fine_error = error_of(law, fine_stress);
}

void kn_law_init(kn_law *law, const kn_material *mat, double dt_s)
{
    *law = (kn_law){.mat = *mat, .dt_s = dt_s, .a_pa_s = mat->c1_pa_s + dt_s * mat->k1_pa};
    // a law without damper or with a constant damper is a straight line
    law->slope_rest = law->slope_flow = slope_of(law, kn_material_c2(mat, 0));
    if (kn_material_stroke(mat, &law->in, &law->out)) {
        law->kind = KN_LAW_VOIGT;
        return;
    }
    law->stroke = mat->stroke[1] > 0;
    double thinning = kn_material_thinning(mat, mat->p0_pa);
    if (mat->damper == KN_DAMPER_CONSTANT || thinning == 0 || law->a_pa_s == 0) {
        law->kind = KN_LAW_LINEAR;
        return;
    }
    law->kind = KN_LAW_EXACT;
    // the flowing branch begins at p1
    law->slope_flow = slope_of(law, kn_material_c2(mat, mat->p1_pa));
    law->s1_pa = mat->p1_pa;
    law->bh_pa = law->s1_pa / law->slope_flow;
    // The resting branch ends at p0. With p0 = 0 the law has no straight branch. The part where beta s is below 1e-4 is
    // then taken as straight, because exp(-beta s) is 1 to within 1e-4 there.
    law->s0_pa = fmin(fmax(mat->p0_pa, 1e-4 / thinning), 0.5 * mat->p1_pa);
    if (mat->p0_pa >= law->s0_pa) law->s0_pa = mat->p0_pa;
    law->b0_pa = law->s0_pa / slope_of(law, kn_material_c2(mat, law->s0_pa));
    law->slope_rest = law->s0_pa / law->b0_pa;
}

void kn_law_build(kn_law *law, const kn_material *mat, double dt_s, bool exact)
{
    kn_law_init(law, mat, dt_s);
    if (law->kind != KN_LAW_EXACT) return;
    build_table(law, exact);
    if (law->seeded && !exact) law->kind = KN_LAW_TABLE;
}
