#ifndef KN_CORE_LAW_H
#define KN_CORE_LAW_H
// The constitutive law of one implicit step: one increasing function per material and time step.
//
// In stress units every edge of every length obeys the same law. With strain u = (p - p0)/(gamma L0) of the Voigt part
// and rate w = L'/(gamma L0) of the whole edge, backward Euler gives for the stress s = t/(gamma kappa L0)
//
//     s + A g(s) = b,     A = c1 + dt k1,     b = A w + k1 u,     g(s) = s/c2(|s|)                       (1)
//
// g is odd and increasing, so there is exactly one s, sign(s) = sign(b), |s| <= |b|: s = T(b), a fixed function.
// c2 is never taken at the previous stress: that chatters with period 2 at every time step (52 % force error).
// Then u += dt (s - k1 u)/A, and the slope the solver needs, ds/dw, is A/(1 + A g') (tangent) or A/(1 + A/c2) (secant).
//
// Stroke. With strain l = (L - L0)/(gamma L0) of the edge after the step, the damper's is z = l - u, and stops hold it
// in z_in <= z <= z_out. The step with the stop in it, solved and not projected, is
//
//     s = max(b - (A/dt) (z_out - z), min(T(b), b + (A/dt) (z - z_in))),   u <- max(l - z_out, min(l - z_in, u_T))  (2)
//
// z before the step and u_T what T would make of u: the free law where the damper stays between its stops, and where it
// would not just so much that it lands on one. It is increasing in b, and at a stop s = b, rigid: no flow, no work.
//
// Table. y = |b|/b0 with b0 = T^-1(p0). Below y = 1 and above yh = T^-1(p1)/b0 the law is a straight line, between them
// 16 cubics in y whose index is read off the float's exponent and top mantissa bits, which fit one vector register
// each. sqrt(slope) is a quadratic on the same segments. Kinks are exact: s = max(sh y, min(sl y, P(clamp(y, 1, yh)))).
// f64 has polynomials of degree 13 there, which leave rounding where a segment is half an octave and 1e-11 where it is
// a whole one, and cubics for sqrt(slope), to 1e-3: no exponential, quotient or root per edge.
#include "core/material.h"
#include <stdbool.h>

#define KN_LAW_SEGMENTS 16
#define KN_LAW_FINE 13 // degree in f64

typedef enum kn_law_kind {
    KN_LAW_VOIGT,  // no damper, or one that cannot move: s = A w + k1 u, u from the length itself; no state per edge
    KN_LAW_LINEAR, // constant c2: s = b / (1 + A/c2)
    KN_LAW_TABLE,  // force-dependent c2 through the table
    KN_LAW_EXACT   // force-dependent c2 to rounding: F64, and laws too wide for the table
} kn_law_kind;

// How the solver linearises the law around its guess.
typedef enum kn_linearization {
    KN_LINEARIZATION_BLEND,  // mean of the two: accurate and does not chatter up to a few thousand nodes
    KN_LINEARIZATION_SECANT, // s/b: never chatters, a little less accurate
    KN_LINEARIZATION_TANGENT // chatters from about 2 500 nodes
} kn_linearization;

typedef struct kn_law {
    kn_material mat;
    kn_law_kind kind;
    double dt_s;
    double a_pa_s;  // A
    bool stroke;    // the damper has stops and can move between them
    double in, out; // gamma z_in, gamma z_out: residual strains, as kn_material_stroke has them
    // The two straight ends, where tangent and secant agree; one and the same for a linear law.
    double slope_rest;   // ds/db for |b| <= b0
    double slope_flow;   // ds/db for |b| >= bh
    double s0_pa, b0_pa; // end of the resting branch (p0 of the material; a small stress when p0 = 0)
    double s1_pa, bh_pa; // begin of the flowing branch (p1)
    // Table, in y = |b|/b0; the segment of y in [1, yh] is (bits(y) - bits(1)) >> shift of an IEEE f32.
    int shift;
    float cubic[4][KN_LAW_SEGMENTS];    // s/b0 = c0 + y (c1 + y (c2 + y c3))
    float slope[3][3][KN_LAW_SEGMENTS]; // [kn_linearization]: sqrt(ds/db) = c0 + y (c1 + y c2)
    bool seeded;                        // the table is good to 1e-3: the kernels may use it, and Newton starts from it
    double table_error;                 // largest |table - exact|/exact of s over [b0, bh], measured when built
    // For KN_LAW_EXACT in f64: in x = y - middle of the segment, so that a high degree loses no digits.
    double middle[KN_LAW_SEGMENTS], fine[KN_LAW_FINE + 1][KN_LAW_SEGMENTS];
    double fine_slope[3][4][KN_LAW_SEGMENTS]; // [kn_linearization]
    double fine_error;                        // as table_error
} kn_law;

// Builds the law for one step length; exact = true asks for KN_LAW_EXACT where the damper depends on force.
// A range of b wider than the table can hold to 1e-3 also becomes KN_LAW_EXACT. dt_s >= 0 (0: for an explicit
// method).
void kn_law_build(kn_law *law, const kn_material *mat, double dt_s, bool exact);

// KN_LAW_EXACT in f64 without leaving the lanes: the fine table is good to 1e-10. Others take Newton edge by edge, some
// 40 times the time.
bool kn_law_in_lanes(const kn_law *law);

// s = T(b) to rounding: closed form outside [p0, p1], safeguarded Newton on ln(s (1 + A/c2)/b) inside: the table's
// oracle.
double kn_law_stress(const kn_law *law, double b_pa);

// (2): what a stop makes of the stress s = T(b), where the damper could go inwards by the strain z - z_in and outwards
// by z_out - z before the step; used up below KN_LAW_STROKE_ENDS. For dt > 0.
#define KN_LAW_STROKE_ENDS 1e-9
double kn_law_stop(const kn_law *law, double stress_pa, double b_pa, double inwards, double outwards);

// ds/db at stress s; ds/dw is A times this.
double kn_law_slope(const kn_law *law, double stress_pa, kn_linearization how);

#endif
