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
//     viscoelastic  damper NONE, or a_min = a_max   all of the deformation is lost
//     plastic       k1 = 0, c1 = c2 = 2c            all of the deformation stays; c = c1 c2/(c1 + c2) of the pair;
//                   or c1 >> c2(s)                  then c is c2(s), to within a share of c2/(c1 + c2) (equation 8)
//     rheological   everything finite               a part comes back, the rest stays
//
// Damper (second paper, equation 7). c2 is c_max up to the stress p0 and c_min from p1 on. Between them it is
// continuous: alpha exp(-beta |s|) (first paper, equation 6: c_max = alpha exp(-beta p0), c_min = alpha exp(-beta p1))
// or a straight line. The second paper's text leaves the middle open; the exponential is the one that the same authors
// identified.
//
// Stroke. The second paper bounds the ratio a = p/L of the Voigt part's length to the edge's by a_min <= a <= a_max.
// Here the damper has end stops. Take an edge whose Voigt part has relaxed to its own length a0 L0. With the damper
// pushed in to its stop, the edge has the ratio a_max; pulled out to its stop, a_min. The damper moves within q_min <=
// q <= q_max and no farther. So an edge that is left alone is a0/a_max to a0/a_min times as long as when it was made.
// The bounds are the limits of the permanent strain, and a_min = a_max leaves none. A damper at its stop is rigid until
// it is pushed the other way. Rejected: resetting the ratio a to its bounds after the step, as the paper says, with the
// force of the free damper. The object is then 26 times too soft if c2 is small, with 29 times the work in the balance.
// Rejected, too: stops on a = p/L itself. Such stops engage and release with every step (900 times in 16 s, with a
// 30-fold change of force), because p moves too.

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
    double alpha_pa_s;  // EXPONENTIAL: factor alpha of c2 = alpha exp(-beta P), > 0; it is c2 at zero stress if p0 = 0
    double beta_per_pa; // EXPONENTIAL: fall of ln c2 per stress, >= 0 (shear thinning)
    double p0_pa;       // EXPONENTIAL, RAMP: stress up to which c2 is constant, 0 <= p0 < p1
    double p1_pa;       // EXPONENTIAL, RAMP: stress from which c2 is constant again
    double c_max_pa_s;  // RAMP: c2 up to p0; >= c_min, since a damper that thickens could flow slower under more load
    double c_min_pa_s;  // RAMP: c2 from p1 on, > 0
    double ratio;       // a0, share of the Voigt part in a new edge's length, a_min .. a_max; unused without a stroke
    double stroke[2];   // bounds a_min, a_max of the ratio a, in 0 .. 1; {0, 0}: the damper has no stops
} kn_material;

// Return c2 at a stress of either sign, Pa s. INFINITY for KN_DAMPER_NONE.
double kn_material_c2(const kn_material *mat, double stress_pa);

// Return the flow rate of the damper g(s) = s / c2(|s|), 1/s: odd and increasing, 0 for KN_DAMPER_NONE.
double kn_material_flow(const kn_material *mat, double stress_pa);

// Return -d ln c2/d|s| at a stress >= 0, 1/Pa. It is 0 outside [p0, p1]; both ends belong to the range.
double kn_material_thinning(const kn_material *mat, double stress_pa);

// Store the range of the damper from its position as made, in shares of an edge's rest length: in <= 0 <= out. The two
// values are the limits of the permanent strain, a0/a_max - 1 and a0/a_min - 1. They are infinite without a stroke.
// Return true if the damper cannot move at all.
bool kn_material_stroke(const kn_material *mat, double *in, double *out);

// Return the creep compliance after `seconds`, 1/Pa. The stress is taken as so small that the damper stays as stiff as
// at rest.
double kn_material_compliance(const kn_material *mat, double seconds);

// Return NULL if the parameters can be simulated, else one sentence that names the wrong one.
const char *kn_material_check(const kn_material *mat);

#endif
