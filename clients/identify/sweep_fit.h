#ifndef KN_CLIENTS_IDENTIFY_SWEEP_FIT_H
#define KN_CLIENTS_IDENTIFY_SWEEP_FIT_H
// A fit of the springs and dampers of the first paper's figure 2 to storage and loss modulus over frequency. Elements
// that no experiment can tell apart form one class (core/oneport.h). Each class has one row in the table of results and
// is represented by its Voigt form.
//
// The residuals are differences of ln G' and ln G'' with equal weights, so that all decades of the modulus count the
// same. The oscillations are small, so the experiment shows the papers' force-dependent damper only near zero stress,
// where its damping c2 is c_max.
#include "clients/identify/measured_curve.h"
#include "clients/identify/parameter_estimate.h"
#include "core/network.h"

#define KN_SWEEP_FIT_ROWS KN_CATALOGUE
#define KN_SWEEP_FIT_PARTS 4
// AICc difference from which the data speak against a model (Burnham and Anderson, Model selection, 2.6)
#define KN_SWEEP_FIT_NEAR 4

typedef struct kn_sweep_fit_row {
    char expression[KN_ELEMENT_TEXT]; // the element as an expression of springs s and dampers d, such as "(s|d)-d"
    char letters[16];                 // letters of the elements in the first paper's figure 2, such as "d f"
    const char *name;                 // name of the model, such as "Jeffreys"; NULL: the model has no name
    kn_network net;                   // the element with the fitted parameters
    bool fitted, is_material;         // is_material: whether a scene can have this element
    kn_material material;             // the fitted material; set if is_material is true
    int parts;                        // number of springs and dampers
    // [parts] values of the springs and dampers; for a material k1, c1, c2
    kn_parameter_estimate number[KN_SWEEP_FIT_PARTS];
    double error;      // mean of |model/measured - 1| over both moduli
    double aicc, runs; // AICc of the fit; result of kn_fit_runs for the residuals
} kn_sweep_fit_row;

typedef struct kn_sweep_fit {
    int rows, readings; // number of rows in row[]; number of measured frequencies
    kn_sweep_fit_row row[KN_SWEEP_FIT_ROWS];
    // Indices of rows; -1: no row. `best`: the row with the fewest parameters among all rows whose AICc exceeds the
    // least AICc by at most KN_SWEEP_FIT_NEAR. `material`: the row chosen by the same rule among the rows that a scene
    // can have.
    int best, material;
} kn_sweep_fit;

// Run the fit. `scale` multiplies the moduli: a scale of 3 converts shear moduli to parameters for compression.
// `confidence` is the confidence of the intervals, such as 0.95. Return false if memory runs out, or if no element
// could be fitted.
bool kn_sweep_fit_run(kn_sweep_fit *s, int curves, const kn_curve *curve, double scale, double confidence);

// Compute storage and loss modulus of a row's fitted element at one frequency.
void kn_sweep_fit_modulus(const kn_sweep_fit_row *row, double frequency_hz, double *storage_pa, double *loss_pa);

#endif
