#ifndef KN_CLIENTS_IDENTIFY_SPECTRUM_H
#define KN_CLIENTS_IDENTIFY_SPECTRUM_H
// Storage and loss modulus over frequency -> the springs and dampers of the first paper's figure 2, a row for each
// class that an experiment can tell apart (core/oneport.h), in its Voigt form.
//
// Residuals are of ln G' and ln G'', all alike, so that decades of modulus count the same. Swings are small: what the
// papers' damper is beyond c2 at rest, its c_max, no such experiment knows.
#include "clients/identify/curve.h"
#include "clients/identify/identified.h"
#include "core/network.h"

#define KN_SPECTRUM_ROWS 8
#define KN_SPECTRUM_PARTS 4
#define KN_SPECTRUM_NEAR 4 // from there on the data speak against it (Burnham and Anderson, Model selection, 2.6)

typedef struct kn_spectrum_row {
    char expression[KN_ELEMENT_TEXT]; // "(s|d)-d"
    char letters[16];                 // "d f"
    const char *name;                 // "Jeffreys"; NULL: none
    kn_network net;                   // with the numbers found
    bool fitted, is_material;         // whether a scene can have it
    kn_material material;             // if so
    int parts;
    kn_identified number[KN_SPECTRUM_PARTS]; // by leaf; of a material k1, c1, c2
    double error;                            // mean of |model/measured - 1|, of both moduli
    double aicc, runs;
} kn_spectrum_row;

typedef struct kn_spectrum {
    int rows, readings; // readings: frequencies
    kn_spectrum_row row[KN_SPECTRUM_ROWS];
    // Numbers of rows: the one with the fewest numbers whose AICc is within KN_SPECTRUM_NEAR of the least, of all and
    // of those that a scene can have.
    int best, material;
} kn_spectrum;

// scale: of the moduli, 3 where they are of shear and the numbers shall be of compression. confidence: 0.95. False: no
// memory, or no element comes near.
bool kn_spectrum_fit(kn_spectrum *s, int curves, const kn_curve *curve, double scale, double confidence);

void kn_spectrum_modulus(const kn_spectrum_row *row, double frequency_hz, double *storage_pa, double *loss_pa);

#endif
