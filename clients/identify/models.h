#ifndef KN_CLIENTS_IDENTIFY_MODELS_H
#define KN_CLIENTS_IDENTIFY_MODELS_H
// Which model the data can support: all of laws.h fitted to the early part of curves and judged by the later one, which
// they have not seen.
//
// clang-format off
//     relaxation   residuals are of ln(stress), of bins.h: every decade counts the same.
//                  Early is up to a tenth of the last time where the readings span two decades, else up to half of it
//     creep        residuals are of strain, in units of each curve's noise, or of KN_MODELS_COARSE of its largest
//                  strain where that is more. Early is the first half of the time under each load, and of each without
// clang-format on
//
// What the papers' damper has beyond its first numbers has rows of its own, which stay, whatever their AICc: relaxation
// without c1, with it, and above P0; creep without P0 and above it. Two fits are of one name, c1 or none above P0 in
// relaxation, P1 or none in creep: of those the one stays that has the lower AICc, Akaike's criterion for small
// samples, on the early part. Errors: relaxation, mean of |model/measured - 1|; creep, root mean square of the
// deviations in shares of each curve's largest strain.
#include "clients/identify/laws.h"
#include <jansson.h>

// Misfits below KN_MODELS_FINE are what averages and differences leave of a perfect curve, and choose no model; later
// errors below KN_MODELS_SAME are the same.
#define KN_MODELS_COARSE 0.003
#define KN_MODELS_FINE 1e-4
#define KN_MODELS_SAME 1e-3
#define KN_MODELS_MAX 12
#define KN_MODELS_HOLDS 6 // relaxation curves at once: the papers' damper has a stress for each

typedef struct kn_models_row {
    kn_fit_law law;
    int unknowns, readings;                  // early ones
    kn_fit_unknown unknown[KN_FIT_UNKNOWNS]; // the best
    bool loose[KN_FIT_UNKNOWNS];             // the early readings do not know that one: at a bound, or anything
    bool fitted;
    double early, held; // errors, shares
    double aicc, runs;  // kn_fit_runs of the early residuals of all curves one after the other
} kn_models_row;

typedef struct kn_models_options {
    double cut_s; // early ends there, since the strain was reached or since each change of load; 0: as above
} kn_models_options;

typedef struct kn_models {
    int rows;
    kn_models_row row[KN_MODELS_MAX];
    bool relax;
    int curves, early, late;  // of curves, and of readings
    double early_pa, late_pa; // relax: the least stresses of both
    kn_fit_law_curve curve[KN_CURVES_MAX];
    double cut_s; // of the first curve
    double took_s;
} kn_models;

// False and one sentence in error: too few readings on either side, no memory. Freed with kn_models_free in any case.
bool kn_models_compare(kn_models *models, int curves, const kn_curve *curve, const kn_models_options *options,
                       char *error, size_t error_size);
void kn_models_free(kn_models *models); // zeroed is fine

int kn_models_best(const kn_models *models); // number of the row with the least AICc

// A sentence or two: which models the data support, and what of it the later readings say.
void kn_models_verdict(const kn_models *models, char *text, size_t size);

void kn_models_print(const kn_models *models); // the table and the verdict
void kn_models_tell(const kn_models *models);  // --json: "models"

// "tau1 12.3 s, k1 4.56 kPa": a row's numbers in a line.
void kn_models_numbers(const kn_models_row *row, char *text, size_t size);

#endif
