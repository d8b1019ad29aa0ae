#ifndef KN_CLIENTS_SHAPE_PULL_H
#define KN_CLIENTS_SHAPE_PULL_H
// A pull: the measured contact force over time, averaged in at most KN_PULL_BINS spans of time, and the residuals of a
// model's force. The spans have equal widths in the square root of the time, since the force changes ever more slowly.
// The residual of a span is
//
//     r = (F' - F)/sigma      F: mean of the measured forces in the span; F': mean of the model's forces at their times
//
// sigma combines two errors. The first is the noise of one reading divided by the square root of the number of readings
// in the span. The second is the possible error of the solver, half a percent of the largest force. The largest force
// is the largest median of five readings. A stray (a reading far from its neighbours) is left out. Otherwise one wrong
// reading of 5000 N would make sigma so large that all other readings lose their weight.
#include "clients/shape/press.h"

#define KN_PULL_BINS 300

typedef struct kn_pull {
    int count;                // number of readings
    double *time_s, *force_n; // [count] rising times of the press, and forces, compression positive; owned
    double noise_n, most_n;   // noise_n: standard deviation of one reading; most_n: largest force
    int strays;               // number of strays that were left out
    double stray_s, stray_n;  // time and force of the first stray
    int bins;                 // number of spans that hold readings
    int *bin;                 // [count] index of the span that holds each reading
    // [bins] mean force of each span, its sigma, and the mean time
    double bin_n[KN_PULL_BINS], bin_sigma_n[KN_PULL_BINS], bin_s[KN_PULL_BINS];
    bool turned; // compression was negative in the file, so the signs of all forces were changed
} kn_pull;

// Take over the arrays `time_s` and `force_n`. Readings outside the press are left out. Readings after the hold are
// left out as well, since the tool tears off node by node while it withdraws. On failure free both arrays and return
// false with one sentence in `error`.
bool kn_pull_make(kn_pull *pull, const kn_press *press, int count, double *time_s, double *force_n, char *error,
                  size_t error_size);
void kn_pull_free(kn_pull *pull); // a zeroed struct is allowed

// Compute the residual of each span, residual[pull->bins]. If `model_n` is not NULL, model_n[pull->bins] receives the
// mean of the model's force in each span.
void kn_pull_compare(const kn_pull *pull, const kn_press *press, const kn_pressed *pressed, double *residual,
                     double *model_n);

#endif
