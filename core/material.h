#ifndef KN_CORE_MATERIAL_H
#define KN_CORE_MATERIAL_H
// Material of a rheological object: a Voigt part (spring k1 beside dashpot c1) in series with a damper c2.
//
//          +--- k1 ---+
//     o----|          |----[ c2(|s|) ]----o        s: stress carried by both parts
//          +--- c1 ---+
//
// All three are moduli, i.e. per unit strain: a cube of side h made of this material has the stiffness k1*h.
// One law covers three kinds of object (second paper):
//     viscoelastic  damper NONE, or a_min = a_max   the deformation is lost wholly
//     plastic       k1 = 0, c1 = c2 = 2c            the deformation stays wholly; c = c1 c2/(c1 + c2) of the pair;
//                   or c1 >> c2(s)                  then c is c2(s) within c2/(c1 + c2) of it (equation 8)
//     rheological   everything finite               a part comes back, the rest stays
//
// Damper (second paper, equation 7): c_max up to the stress p0, c_min from p1 on, and between them, continuously, alpha
// exp(-beta |s|) (first paper, equation 6: c_max = alpha exp(-beta p0), c_min = alpha exp(-beta p1)) or a straight
// line. The paper's text leaves the middle open; the exponential is the same authors' identified one.
//
// Stroke. The second paper bounds the ratio a = p/L of the Voigt part's length to the edge's by a_min <= a <= a_max.
// Here the damper has end stops, where the ratio of an edge whose Voigt part has relaxed to its own length a0 L0 would
// be a_max (damper pushed in) or a_min (pulled out): it moves within q_min <= q <= q_max and neither farther. So an
// edge that is left alone is a0/a_max to a0/a_min times as long as when it was made: the bounds are the limit of the
// permanent strain, and a_min = a_max leaves none. A damper at its stop is rigid until it is pushed the other way.
// Rejected: setting a back into its bounds after the step, as the paper says, with the force of the free damper: 26
// times too soft where c2 is small, with 29 times the work in the balance; and stops on a = p/L itself: they hold and
// let go with every step (900 times in 16 s, force up and down 30-fold), because p moves too.

#include <stdbool.h>

typedef enum kn_damper {
    KN_DAMPER_NONE,        // 1/c2 = 0: the damper is rigid, nothing stays
    KN_DAMPER_CONSTANT,    // c2 constant
    KN_DAMPER_EXPONENTIAL, // c2(s) = alpha exp(-beta clamp(|s|, p0, p1)): stiff at rest, flowing under load
    KN_DAMPER_RAMP         // c2(s) = c_max - (c_max - c_min) (clamp(|s|, p0, p1) - p0)/(p1 - p0)
} kn_damper;

typedef struct kn_material {
    double k1_pa;   // >= 0
    double c1_pa_s; // >= 0; k1 and c1 not both 0
    kn_damper damper;
    double c2_pa_s;     // CONSTANT: > 0
    double alpha_pa_s;  // EXPONENTIAL: > 0
    double beta_per_pa; // EXPONENTIAL: >= 0 (shear thinning)
    double p0_pa;       // EXPONENTIAL, RAMP: 0 <= p0 < p1
    double p1_pa;
    double c_max_pa_s; // RAMP: >= c_min; one that thickens under load could flow slower the harder it is pressed
    double c_min_pa_s; // RAMP: > 0
    double ratio;      // a0, share of the Voigt part in an edge as made, a_min .. a_max; says nothing without a stroke
    double stroke[2];  // a_min, a_max in 0..1; {0, 0}: no stops
} kn_material;

// c2 at a stress of either sign, Pa s. INFINITY for KN_DAMPER_NONE.
double kn_material_c2(const kn_material *mat, double stress_pa);

// Flow rate of the damper g(s) = s / c2(|s|), 1/s: odd and increasing, 0 for KN_DAMPER_NONE.
double kn_material_flow(const kn_material *mat, double stress_pa);

// -d ln c2/d|s| at a stress >= 0, 1/Pa; between p0 and p1 both included, 0 outside.
double kn_material_thinning(const kn_material *mat, double stress_pa);

// How far the damper can go from where it was made, as shares of an edge's rest length: in <= 0 <= out; these are the
// limits of the permanent strain, a0/a_max - 1 and a0/a_min - 1. Infinite without a stroke. True when it cannot go at
// all.
bool kn_material_stroke(const kn_material *mat, double *in, double *out);

// Creep compliance after that long under a stress so small that the damper stays as stiff as at rest, 1/Pa.
double kn_material_compliance(const kn_material *mat, double seconds);

// NULL if the parameters can be simulated, else one sentence that says which cannot.
const char *kn_material_check(const kn_material *mat);

#endif
