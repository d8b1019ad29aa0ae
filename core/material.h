#ifndef KN_CORE_MATERIAL_H
#define KN_CORE_MATERIAL_H
// Material of a rheological object: a Voigt part (spring k1 beside dashpot c1) in series with a damper c2.
//
//          +--- k1 ---+
//     o----|          |----[ c2(|s|) ]----o        s: stress carried by both parts
//          +--- c1 ---+
//
// All three are moduli, i.e. per unit strain: a cube of side h made of this material has the stiffness k1*h.
// One law covers three kinds of object:
//     viscoelastic  damper NONE                the deformation is lost wholly
//     plastic       k1 = 0, c1 = c2 = 2c       the deformation stays wholly; c is the viscosity of the pair
//     rheological   everything finite          a part comes back, the rest stays

typedef enum kn_damper {
    KN_DAMPER_NONE,       // 1/c2 = 0: the damper is rigid, nothing stays
    KN_DAMPER_CONSTANT,   // c2 constant
    KN_DAMPER_EXPONENTIAL // c2(s) = alpha exp(-beta clamp(|s|, p0, p1)): stiff at rest, flowing under load
} kn_damper;

typedef struct kn_material {
    double k1_pa;   // >= 0
    double c1_pa_s; // >= 0; k1 and c1 not both 0
    kn_damper damper;
    double c2_pa_s;     // CONSTANT: > 0
    double alpha_pa_s;  // EXPONENTIAL: > 0
    double beta_per_pa; // EXPONENTIAL: >= 0 (shear thinning)
    double p0_pa;       // EXPONENTIAL: 0 <= p0 < p1
    double p1_pa;
} kn_material;

// c2 at a stress of either sign, Pa s. INFINITY for KN_DAMPER_NONE.
double kn_material_c2(const kn_material *mat, double stress_pa);

// Flow rate of the damper g(s) = s / c2(|s|), 1/s: odd and increasing, 0 for KN_DAMPER_NONE.
double kn_material_flow(const kn_material *mat, double stress_pa);

// Creep compliance after that long under a stress so small that the damper stays as stiff as at rest, 1/Pa.
double kn_material_compliance(const kn_material *mat, double seconds);

// NULL if the parameters can be simulated, else one sentence that says which cannot.
const char *kn_material_check(const kn_material *mat);

#endif
