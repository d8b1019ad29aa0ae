#ifndef KN_CLIENTS_SHAPE_MEASUREMENT_H
#define KN_CLIENTS_SHAPE_MEASUREMENT_H
// All measurements of one press: surfaces at given times (surface_residual.h), and the contact force. The residuals of a
// model form one vector: first the residuals of each surface, then those of the force.
//
// The force over time is averaged in at most KN_FORCE_SPANS spans of time. The spans have equal widths in the square
// root of the time, since the force changes ever more slowly. The residual of a span is
//
//     r = (F' - F)/sigma      F: mean of the measured forces in the span; F': mean of the model's forces at their times
//
// sigma combines two errors. The first is the noise of one reading divided by the square root of the number of readings
// in the span. The second is the possible error of the solver, half a percent of the largest force. The largest force
// is the largest median of five readings. An outlier (a reading far from its neighbours) is left out. Otherwise one
// wrong reading of 5000 N would make sigma so large that all other readings lose their weight.
#include "clients/shape/press_protocol.h"
#include "clients/shape/surface_residual.h"

#define KN_FORCE_SPANS 300

typedef struct kn_force_residual {
    int count;                   // number of readings
    double *time_s, *force_n;    // [count] rising times of the press, and forces, compression positive; owned
    double noise_n, most_n;      // noise_n: standard deviation of one reading; most_n: largest force
    int outliers;                // number of outliers that were left out
    double outlier_s, outlier_n; // time and force of the first outlier
    int spans;                   // number of spans that hold readings
    int *span;                   // [count] index of the span that holds each reading
    // [spans] mean force of each span, its sigma, and the mean time
    double span_n[KN_FORCE_SPANS], span_sigma_n[KN_FORCE_SPANS], span_s[KN_FORCE_SPANS];
    bool turned; // compression was negative in the file, so the signs of all forces were changed
} kn_force_residual;

// Prepare the comparison with the readings `count`, `time_s` and `force_n`. Readings outside the press are left out.
// Readings after the hold are left out as well, since the tool tears off node by node while it withdraws. On failure free
// the struct and return false with one sentence in `error`.
bool kn_force_residual_make(kn_force_residual *measured, const kn_press *press, char *error, size_t error_size);
void kn_force_residual_free(kn_force_residual *measured); // a zeroed struct is allowed

// Compute the residual of each span, residual[spans]. If `model_n` is not NULL, model_n[spans] receives the mean of the
// model's force in each span.
void kn_force_residual_compare(const kn_force_residual *measured, const kn_press *press, const kn_pressed *pressed,
                               double *residual, double *model_n);

typedef struct kn_measurement {
    kn_press press;
    int surfaces;                                  // number of measured surfaces
    kn_surface_residual surface[KN_PRESS_MOMENTS]; // [surfaces]
    double moment_s[KN_PRESS_MOMENTS];             // [surfaces] time at which each surface was measured
    bool has_force;                                // whether the force was measured
    kn_force_residual force;                       // measured force, if `has_force`
    bool align;     // fit one horizontal shift, common to all images, of their place in the scene
    int readings;   // number of residuals
    double until_s; // time of the last measurement
} kn_measurement;

void kn_measurement_close(kn_measurement *measurement); // compute the fields readings and until_s
void kn_measurement_free(kn_measurement *measurement);

// Compute residual[measurement->readings] of a model that was pressed. If measurement->align is true, fit the shift of
// the images: `shift_m` holds the start of the search and receives the result. `misfit` receives one entry for each
// measured surface, or is NULL. Return false if memory runs out.
bool kn_measurement_compare(const kn_measurement *measurement, const kn_model_surface *model, const kn_pressed *pressed,
                            double shift_m[2], double *residual, kn_surface_misfit misfit[KN_PRESS_MOMENTS]);

// Return the number of independent readings that contain as much information as the residuals. The outline of an image,
// the patches of an image and the force are one series of residuals each. A series of n residuals counts as
// n (1 - c)/(1 + c) readings, where c is the correlation of successive residuals. The result is the sum over all
// series.
double kn_measurement_independent(const kn_measurement *measurement, const double *residual);

#endif
