#ifndef KN_CLIENTS_IDENTIFY_SPECTRUM_H
#define KN_CLIENTS_IDENTIFY_SPECTRUM_H
// A fit of the springs and dampers of the first paper's figure 2 to storage and loss modulus over frequency. Elements
// that no experiment can tell apart form one class (core/oneport.h). Each class has one row, in its Voigt form.
//
// The residuals are differences of ln G' and ln G'' with equal weights, so that all decades of the modulus count the
// same. The oscillations are small, so the experiment shows the papers' damper only at rest, with the damping c2 =
// c_max.
#include "clients/identify/curve.h"
#include "clients/identify/identified.h"
#include "core/network.h"

#define KN_SPECTRUM_ROWS 8
#define KN_SPECTRUM_PARTS 4
// AICc difference from which the data speak against a model (Burnham and Anderson, Model selection, 2.6)
#define KN_SPECTRUM_NEAR 4

typedef struct kn_spectrum_row {
    char expression[KN_ELEMENT_TEXT]; // "(s|d)-d"
    char letters[16];                 // "d f"
    const char *name;                 // "Jeffreys"; NULL: none
    kn_network net;                   // with the fitted parameters
    bool fitted, is_material;         // is_material: whether a scene can have this element
    kn_material material;             // if is_material
    int parts;
    kn_identified number[KN_SPECTRUM_PARTS]; // one for each spring and damper; for a material k1, c1, c2
    double error;                            // mean of |model/measured - 1| over both moduli
    double aicc, runs;
} kn_spectrum_row;

typedef struct kn_spectrum {
    int rows, readings; // readings: number of frequencies
    kn_spectrum_row row[KN_SPECTRUM_ROWS];
    // Indices of rows. `best`: the row with the fewest parameters among all rows whose AICc is within KN_SPECTRUM_NEAR
    // of the least. `material`: the same among the rows that a scene can have.
    int best, material;
} kn_spectrum;

// Run the fit. `scale` multiplies the moduli: 3 converts shear moduli to parameters for compression. `confidence`:
// 0.95. Return false if memory runs out, or if no element comes near.
bool kn_spectrum_fit(kn_spectrum *s, int curves, const kn_curve *curve, double scale, double confidence);

void kn_spectrum_modulus(const kn_spectrum_row *row, double frequency_hz, double *storage_pa, double *loss_pa);

#endif
