#ifndef KN_CORE_LAW_H
#define KN_CORE_LAW_H
// The constitutive law of one implicit step: one increasing function per material and time step.
//
// Written with stresses and strains, the law is the same for edges of all lengths. An edge has the tension t, the
// length L, the rest length L0 and the scales kappa and gamma (grid.h). p is the length of its Voigt part, p0 the
// natural length of that part. Let u = (p - p0)/(gamma L0) be the strain of the Voigt part and w = L'/(gamma L0) the
// rate of the whole edge. Then backward Euler gives for the stress s = t/(gamma kappa L0)
//
//     s + A g(s) = b,     A = c1 + dt k1,     b = A w + k1 u,     g(s) = s/c2(|s|)                       (1)
//
// g is odd and increasing. So there is exactly one solution s = T(b), with sign(s) = sign(b) and |s| <= |b|. T depends
// on the material and on dt only. Rejected: taking c2 at the previous stress. The force then alternates from step to
// step, with an error of 52 %. After the stress s is known, the strain advances: u += dt (s - k1 u)/A. The solver needs
// the slope ds/dw: A/(1 + A g') (tangent) or A/(1 + A/c2) (secant).
//
// Stroke. Let l = (L - L0)/(gamma L0) be the strain of the edge after the step. The damper's strain is z = l - u, and
// end stops keep z_in <= z <= z_out. The equation of the step contains the stops; z is not clipped afterwards:
//
//     s = max(b - (A/dt) (z_out - z), min(T(b), b + (A/dt) (z - z_in))),   u <- max(l - z_out, min(l - z_in, u_T))  (2)
//
// Here z is the strain before the step, and u_T is the u that follows from s = T(b). While the damper stays between its
// stops, (2) gives s = T(b). If the damper would pass a stop, it ends the step at the stop. s is increasing in b. At a
// stop s = b: the damper is rigid, without flow or work.
//
// Table. y = |b|/b0 with b0 = T^-1(p0). Below y = 1 and above yh = T^-1(p1)/b0 the law is a straight line. Between the
// two lines it is 16 cubics in y, one per segment. The exponent and the top mantissa bits of the float y give the index
// of the segment. The 16 values of one coefficient fit one vector register. sqrt(slope) is a quadratic on the same
// segments. The kinks are exact: s = max(sh y, min(sl y, P(clamp(y, 1, yh)))), where P is the cubic, sl the slope below
// y = 1 and sh the slope above yh. In f64 the segments have polynomials of degree 13. Their error is that of rounding
// if a segment is half an octave, and 1e-11 if a segment is a whole octave. sqrt(slope) is a cubic in f64, with an
// error of at most 1e-3. So no edge needs an exponential, a quotient or a root.
//
// A kn_law is plain data of the caller. All functions but kn_law_build are real-time safe.
#include "core/material.h"
#include <stdbool.h>

#define KN_LAW_SEGMENTS 16
#define KN_LAW_FINE 13 // degree of the polynomials in f64

typedef enum kn_law_kind {
    KN_LAW_VOIGT,  // no damper, or a damper that cannot move: s = A w + k1 u, and u follows from the edge's length
    KN_LAW_LINEAR, // constant c2: s = b / (1 + A/c2)
    KN_LAW_TABLE,  // force-dependent c2, by the f32 table
    KN_LAW_EXACT   // force-dependent c2, exact but for rounding: in F64, and in F32 if the table would be too inexact
} kn_law_kind;

// In each step the solver replaces the law by a straight line near the guessed velocity. This type tells the line's
// slope.
typedef enum kn_linearization {
    KN_LINEARIZATION_BLEND,  // mean of secant and tangent: accurate; no chatter up to a few thousand nodes
    KN_LINEARIZATION_SECANT, // slope s/b: the force never chatters, but the step is a little less accurate
    KN_LINEARIZATION_TANGENT // slope ds/db: the force chatters if the lattice has about 2 500 nodes or more
} kn_linearization;

typedef struct kn_law {
    kn_material mat;
    kn_law_kind kind;
    double dt_s;
    double a_pa_s;  // A = c1 + dt k1
    bool stroke;    // the damper has end stops and can move between them
    double in, out; // gamma z_in and gamma z_out: permanent strains at the damper's stops, see kn_material_stroke
    // The law's two straight branches: resting (|b| <= b0) and flowing (|b| >= bh). In a linear law, both slopes are
    // equal.
    double slope_rest; // ds/db for |b| <= b0
    double slope_flow; // ds/db for |b| >= bh
    // s and b at the end of the resting branch; s is the material's p0, or a small stress if p0 = 0
    double s0_pa, b0_pa;
    double s1_pa, bh_pa; // s and b at the start of the flowing branch; s is the material's p1
    // Table for f32, in y = |b|/b0. The segment of a y in [1, yh] is (bits(y) - bits(1)) >> shift, where bits(y) are
    // the bits of y as an IEEE f32.
    int shift;
    float cubic[4][KN_LAW_SEGMENTS];    // s/b0 = c0 + y (c1 + y (c2 + y c3))
    float slope[3][3][KN_LAW_SEGMENTS]; // [kn_linearization]: sqrt(ds/db) = c0 + y (c1 + y c2)
    bool seeded; // table_error is at most 1e-3: the kernels may use the table, and Newton's method starts from it
    double table_error; // largest |table - exact|/exact of s over [b0, bh], measured during the build
    // Table for KN_LAW_EXACT in f64. Its polynomials are in x = y - middle of the segment, so that rounding loses no
    // digits despite the high degree.
    double middle[KN_LAW_SEGMENTS], fine[KN_LAW_FINE + 1][KN_LAW_SEGMENTS];
    double fine_slope[3][4][KN_LAW_SEGMENTS]; // [kn_linearization]: coefficients of sqrt(ds/db), a cubic in x
    double fine_error;                        // largest |table - exact|/exact of s for the f64 table
} kn_law;

// Build the law of a material that kn_material_check accepts. dt_s >= 0 is the step length; 0 is for an explicit
// method. exact = true asks for the kind KN_LAW_EXACT if the damper depends on force. With exact = false the kind still
// becomes KN_LAW_EXACT if the range of b is too wide for a table with an error of at most 1e-3.
void kn_law_build(kn_law *law, const kn_material *mat, double dt_s, bool exact);

// Build the law without its tables, a thousand times as fast, for kn_law_stress and kn_law_slope only.
void kn_law_init(kn_law *law, const kn_material *mat, double dt_s);

// Return true if the law is KN_LAW_EXACT and its f64 table has an error of at most 1e-10. Kernels in f64 then use the
// table. Other exact laws need Newton's method edge by edge, which takes some 40 times as long.
bool kn_law_in_lanes(const kn_law *law);

// Return s = T(b), Pa, exact but for rounding. Outside p0 <= |s| <= p1 there is a closed formula. In this range, a
// safeguarded Newton's method solves ln(s (1 + A/c2)/b) = 0. The tables are built from this function and tested against
// it.
double kn_law_stress(const kn_law *law, double b_pa);

#define KN_LAW_STROKE_ENDS 1e-9 // strain; a stop that is nearer is reached

// Apply the stops to the stress s = T(b) by equation (2), and return the new stress. `inwards` and `outwards` are the
// strains z - z_in and z_out - z by which the damper can still move at the beginning of the step. If one of them is
// below KN_LAW_STROKE_ENDS, it is taken as 0. Requires dt > 0.
double kn_law_stop(const kn_law *law, double stress_pa, double b_pa, double inwards, double outwards);

// Return the slope ds/db of the law at stress s. The slope ds/dw is A ds/db.
double kn_law_slope(const kn_law *law, double stress_pa, kn_linearization how);

#endif
