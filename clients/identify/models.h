#ifndef KN_CLIENTS_IDENTIFY_MODELS_H
#define KN_CLIENTS_IDENTIFY_MODELS_H
// A comparison of models: all laws of laws.h are fitted to the early part of the curves and judged by the later part,
// which they have not seen.
//
// clang-format off
//     relaxation   residuals are of ln(stress), of bins.h: every decade counts the same.
//                  Early is up to a tenth of the last time if the readings span two decades, else up to half of it
//     creep        residuals are of strain, in units of each curve's noise, or of KN_MODELS_COARSE of its largest
//                  strain if that is more. Early is the first half of the time under each load, and of each without
// clang-format on
//
// The papers' damper has several rows: in relaxation without c1, with c1, and with P0; in creep without P0 and with P0.
// These rows are kept whatever their AICc (Akaike's criterion for small samples). Some fits share one row: in
// relaxation with P0, the fits with and without c1; in creep, the fits with and without P1. The row keeps the fit with
// the lower AICc on the early part. The error in relaxation is the mean of |model/measured - 1|. The error in creep is
// the root mean square deviation as a share of each curve's largest strain.
#include "clients/identify/laws.h"
#include <jansson.h>

// Averages and finite differences leave misfits up to KN_MODELS_FINE even for a perfect curve. Misfits below this limit
// count as equal. Errors of the late part that differ by less than KN_MODELS_SAME count as equal.
#define KN_MODELS_COARSE 0.003
#define KN_MODELS_FINE 1e-4
#define KN_MODELS_SAME 1e-3
#define KN_MODELS_MAX 12
#define KN_MODELS_HOLDS 6 // most relaxation curves at once; each adds an unknown stress to the papers' damper

typedef struct kn_models_row {
    kn_fit_law law;
    int unknowns, readings;                  // number of unknowns, and of readings in the early part
    kn_fit_unknown unknown[KN_FIT_UNKNOWNS]; // the best values
    // whether the early readings leave the unknown undetermined: it is at a bound, or its standard deviation is too
    // large
    bool loose[KN_FIT_UNKNOWNS];
    bool fitted;
    double early, held; // errors of the early and of the late part, as shares
    double aicc, runs;  // kn_fit_runs of the early residuals of all curves, one after the other
} kn_models_row;

typedef struct kn_models_options {
    // end of the early part, counted from the time at which the strain was reached or from each change of load; 0: as
    // above
    double cut_s;
} kn_models_options;

typedef struct kn_models {
    int rows;
    kn_models_row row[KN_MODELS_MAX];
    bool relax;
    int curves, early, late;  // number of curves, and of early and late readings
    double early_pa, late_pa; // relax: least stress of the early and of the late part
    kn_fit_law_curve curve[KN_CURVES_MAX];
    double cut_s; // end of the early part of the first curve
    double took_s;
} kn_models;

// Run the comparison. Return false with one sentence in `error` if either part has too few readings, or if memory runs
// out. Call kn_models_free in any case.
bool kn_models_compare(kn_models *models, int curves, const kn_curve *curve, const kn_models_options *options,
                       char *error, size_t error_size);
void kn_models_free(kn_models *models); // a zeroed struct is fine

int kn_models_best(const kn_models *models); // index of the row with the least AICc

// Write one or two sentences on which models the data support and how well these models predict the late part.
void kn_models_verdict(const kn_models *models, char *text, size_t size);

void kn_models_print(const kn_models *models); // the table and the verdict
void kn_models_tell(const kn_models *models);  // --json: "models"

// Write a row's parameters in one line: "tau1 12.3 s, k1 4.56 kPa".
void kn_models_numbers(const kn_models_row *row, char *text, size_t size);

#endif
