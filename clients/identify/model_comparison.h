#ifndef KN_CLIENTS_IDENTIFY_MODEL_COMPARISON_H
#define KN_CLIENTS_IDENTIFY_MODEL_COMPARISON_H
// A comparison of material models: each model of constitutive_models.h is fitted to the early part of the curves, and
// is judged by its prediction of the late part, which the fit does not use.
//
// clang-format off
//     relaxation   A residual is a difference of ln(stress), for the means of bins of ln(time), so every decade of time
//                  counts the same. If the readings span two decades of time, the early part ends at a tenth of the
//                  last time; otherwise it ends at half of the last time.
//     creep        A residual is a difference of strain, divided by the curve's noise or by KN_COMPARISON_COARSE times
//                  the curve's largest strain, whichever is larger. The early part is the first half of each span
//                  between two changes of load, with or without load.
// clang-format on
//
// The result is a table with one row for each model. The papers' damper has several rows: in relaxation, a row without
// c1, a row with c1, and a row with P0; in creep, a row without P0 and a row with P0. These rows are kept whatever
// their AICc (Akaike's criterion for small samples). Some fits share one row: in relaxation with P0, the fits with and
// without c1; in creep, the fits with and without P1. Such a row keeps the fit with the lower AICc on the early part.
// The error in relaxation is the mean of |model/measured - 1|. The error in creep is the root mean square deviation as
// a share of each curve's largest strain.
#include "clients/identify/constitutive_models.h"
#include <jansson.h>

// KN_COMPARISON_COARSE: least divisor of a creep residual, as a share of the curve's largest strain.
// KN_COMPARISON_FINE: averages and finite differences leave misfits up to this limit even for a perfect curve, so
// misfits below it count as equal. KN_COMPARISON_SAME: errors of the late part below this limit count as equal.
#define KN_COMPARISON_COARSE 0.003
#define KN_COMPARISON_FINE 1e-4
#define KN_COMPARISON_SAME 1e-3
#define KN_COMPARISON_MAX 12
// largest number of relaxation curves in one comparison; each curve adds an unknown stress to the models with the
// papers' damper
#define KN_COMPARISON_HOLDS 6

typedef struct kn_model_comparison_row {
    kn_constitutive_model model;
    int unknowns;                            // number of unknowns
    kn_fit_unknown unknown[KN_FIT_UNKNOWNS]; // [unknowns] the unknowns and their best values
    // whether the early readings leave the unknown undetermined: its best value is at a bound, or its standard
    // deviation is too large
    bool loose[KN_FIT_UNKNOWNS];
    bool fitted;
    double early, held; // relative errors of the early part and of the late part
    double aicc, runs;  // AICc of the fit; result of kn_fit_runs for the early residuals of all curves in succession
} kn_model_comparison_row;

typedef struct kn_model_comparison {
    int rows;                                       // number of rows of the table
    kn_model_comparison_row row[KN_COMPARISON_MAX]; // [rows] one row for each model
    bool relax;                                     // true: relaxation; false: creep
    // curves: number of curves; early, late: number of readings in the early part and in the late part
    int curves, early, late;
    double early_pa, late_pa;               // relaxation: least stress in the early part, and in the late part
    kn_compared_curve curve[KN_CURVES_MAX]; // [curves]
    double cut_s;                           // end of the early part of the first curve [s]
} kn_model_comparison;

// Run the comparison. The early part ends at `cut_s`, counted from the time at which the strain was reached
// (relaxation) or from each change of load (creep). If `cut_s` is 0, the end is chosen as described at the top of this
// file. Return false with one sentence in `error` if the early or the late part has too few readings, or if memory runs
// out. Call kn_model_comparison_free in any case.
bool kn_model_comparison_run(kn_model_comparison *m, int curves, const kn_curve *curve, double cut_s, char *error,
                             size_t error_size);
void kn_model_comparison_free(kn_model_comparison *models); // the struct may be all zeros

int kn_model_comparison_best(const kn_model_comparison *models); // return the index of the row with the least AICc

// Write one or two sentences on which models the data support and how well these models predict the late part.
void kn_model_comparison_verdict(const kn_model_comparison *models, char *text, size_t size);

void kn_model_comparison_print(const kn_model_comparison *models); // print the table and the verdict
// add the table to the JSON output under the name "models"
void kn_model_comparison_tell(const kn_model_comparison *models);

// Write the parameters of a row to `text` as one line, such as "tau1 12.3 s, k1 4.56 kPa".
void kn_model_comparison_numbers(const kn_model_comparison_row *row, char *text, size_t size);

#endif
