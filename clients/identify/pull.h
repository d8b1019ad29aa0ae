#ifndef KN_CLIENTS_IDENTIFY_PULL_H
#define KN_CLIENTS_IDENTIFY_PULL_H
// A pull: the measured contact force over time, averaged in at most KN_PULL_BINS spans of time, and a model's
// residuals. The spans have equal widths in the root of the time, since the force changes ever more slowly:
//
//     r = (F' - F)/sigma      F, F': means over the readings of a span; the model's force is taken at their times
//
// sigma combines two errors: the noise of a reading over the root of their number, and half a percent of the largest
// force, the possible error of the solver. The largest force is the largest median of five readings. Strays, which are
// readings far from their neighbours, are left out. Otherwise one wrong reading of 5000 N would make sigma so large
// that all other readings lose their weight.
#include "clients/identify/press.h"

#define KN_PULL_BINS 300

typedef struct kn_pull {
    int count;                // number of readings
    double *time_s, *force_n; // owned; rising times of the press, compression positive
    double noise_n, most_n;   // noise of one reading; largest force
    int strays;               // number of strays that were left out
    double stray_s, stray_n;  // time and force of the first stray
    int bins;                 // spans that hold readings
    int *bin;                 // [count] span of each reading
    double bin_n[KN_PULL_BINS], bin_sigma_n[KN_PULL_BINS], bin_s[KN_PULL_BINS];
    bool turned; // compression was negative in the file, so all signs were changed
} kn_pull;

// Take over both arrays. Readings outside the press, or after the end of its hold, are left out: during the withdrawal
// the tool tears off node by node. Return false with one sentence in error; the arrays are then freed, too.
bool kn_pull_make(kn_pull *pull, const kn_press *press, int count, double *time_s, double *force_n, char *error,
                  size_t error_size);
void kn_pull_free(kn_pull *pull); // a zeroed struct is fine

// Compute residual[bins]. model_n[bins], if not NULL, receives the model's force.
void kn_pull_compare(const kn_pull *pull, const kn_press *press, const kn_pressed *pressed, double *residual,
                     double *model_n);

#endif
