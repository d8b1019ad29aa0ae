#ifndef KN_CORE_MATERIAL_H
#define KN_CORE_MATERIAL_H
// Material of a rheological object: a Voigt part (spring k1 beside dashpot c1) in series with a damper c2.
//
//          +--- k1 ---+
//     o----|          |----[ c2(|s|) ]----o        s: stress carried by both parts
//          +--- c1 ---+
//
// k1, c1 and c2 are moduli, i.e. per unit strain: a cube of side h made of this material has the stiffness k1*h.
// One law covers three kinds of object. The equations are those of the second of the two papers that this project
// follows (for the first paper see element.h):
//     viscoelastic  damper NONE, or a_min = a_max   the object recovers its whole shape
//     plastic       k1 = 0, c1 = c2 = 2c            all of the deformation stays; the pair acts as one damper
//                   or c1 >> c2(s)                  c = c1 c2/(c1 + c2), in the second case c2(s) (equation 8)
//     rheological   everything finite               a part of the deformation comes back, the rest stays
//
// Damper (second paper, equation 7). c2 is c_max up to the stress p0 and c_min from p1 on. Between them it is
// continuous: alpha exp(-beta |s|) (first paper, equation 6: c_max = alpha exp(-beta p0), c_min = alpha exp(-beta p1))
// or a straight line. The second paper's text leaves the middle open; the exponential is the one that the same authors
// identified.
//
// Stroke. The second paper bounds the ratio a = p/L of the Voigt part's length to the edge's length: a_min <= a <=
// a_max. Here the damper has end stops instead. Take an edge whose Voigt part has relaxed to its own length a0 L0. If
// the damper is pushed in to its stop, the edge has the ratio a_max. If the damper is pulled out to its stop, the edge
// has the ratio a_min. So an edge that is left alone is a0/a_max to a0/a_min times as long as when it was made. These
// are the limits of the permanent strain; with a_min = a_max no deformation stays. A damper at a stop is rigid until it
// is pushed the other way. Rejected: resetting the ratio a to its bounds after the step, as the paper says, with the
// force of the free damper. The object is then 26 times too soft if c2 is small, with 29 times the work in the balance.
// Also rejected: stops on a = p/L itself. Such stops engage and release with every step (900 times in 16 s, with a
// 30-fold change of force), because p moves too.
//
// A material is plain data of the caller, in SI units. All functions are real-time safe.

#include <stdbool.h>

typedef enum kn_damper {
    KN_DAMPER_NONE,        // 1/c2 = 0: the damper is rigid, no deformation stays
    KN_DAMPER_CONSTANT,    // c2 does not depend on the stress
    KN_DAMPER_EXPONENTIAL, // c2(s) = alpha exp(-beta clamp(|s|, p0, p1)): stiff at rest, flowing under load
    KN_DAMPER_RAMP         // c2(s) = c_max - (c_max - c_min) (clamp(|s|, p0, p1) - p0)/(p1 - p0)
} kn_damper;

typedef struct kn_material {
    double k1_pa;   // modulus of the spring, >= 0
    double c1_pa_s; // modulus of the dashpot, >= 0; k1 and c1 must not both be 0
    kn_damper damper;
    double c2_pa_s;     // CONSTANT: modulus c2 of the damper, > 0
    double alpha_pa_s;  // EXPONENTIAL: factor alpha, > 0; if p0 = 0, it is c2 at zero stress
    double beta_per_pa; // EXPONENTIAL: factor beta, decrease of ln c2 per unit of stress, >= 0
    double p0_pa;       // EXPONENTIAL, RAMP: stress up to which c2 is constant, 0 <= p0 < p1
    double p1_pa;       // EXPONENTIAL, RAMP: stress from which c2 is constant again
    double c_max_pa_s;  // RAMP: c2 at stresses up to p0; >= c_min, so that more load never slows the flow
    double c_min_pa_s;  // RAMP: c2 at stresses of p1 and above, > 0
    // a0: share of the Voigt part in the length of a new edge, from a_min to a_max; unused if the damper has no stops
    double ratio;
    // bounds a_min, a_max of the share of the Voigt part in an edge's length, from 0 to 1; {0, 0}: the damper has no
    // stops
    double stroke[2];
} kn_material;

// Return c2 at a stress of either sign, Pa s. Return INFINITY if the damper cannot move.
double kn_material_c2(const kn_material *mat, double stress_pa);

// Return the flow rate of the damper g(s) = s / c2(|s|), 1/s. The function is odd and increasing. If the damper cannot
// move, return 0.
double kn_material_flow(const kn_material *mat, double stress_pa);

// Return the thinning, -d ln c2/d|s|, in 1/Pa. `stress_pa` must be >= 0. The thinning is 0 if the stress is below p0 or
// above p1.
double kn_material_thinning(const kn_material *mat, double stress_pa);

// Store how far the damper can move inwards and outwards from its position in a new edge, divided by the edge's rest
// length: in <= 0 <= out. The two values are the limits of the permanent strain, a0/a_max - 1 and a0/a_min - 1. Without
// stops they are infinite. Return true if the damper cannot move at all.
bool kn_material_stroke(const kn_material *mat, double *in, double *out);

// Return the creep compliance after `seconds`, 1/Pa: strain divided by stress, for a stress so small that c2 has its
// value at zero stress.
double kn_material_compliance(const kn_material *mat, double seconds);

// Return NULL if the material can be simulated, else a static sentence that names the wrong parameter.
const char *kn_material_check(const kn_material *mat);

#endif
