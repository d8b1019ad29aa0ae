#ifndef KN_CLIENTS_IDENTIFY_PULL_H
#define KN_CLIENTS_IDENTIFY_PULL_H
// The measured contact force over time, in at most KN_PULL_BINS spans, which grow with the root of the time, as the
// force changes ever more slowly; and how far a model's is from it:
//
//     r = (F' - F)/sigma      F, F': means over the readings of a span, the model's taken at the times of these
//
// Sigma is the noise of a reading over the root of their number, and half a percent of the largest force, which the
// solver may be off by. The largest is that of the medians of five, and what stands far out of its neighbours is left
// out: one reading of 5000 N would make every other one as good as unmeasured.
#include "clients/identify/press.h"

#define KN_PULL_BINS 300

typedef struct kn_pull {
    int count;                // readings
    double *time_s, *force_n; // owned; rising times of the press, compression positive
    double noise_n, most_n;   // of a reading; largest
    int strays;               // readings left out for that
    double stray_s, stray_n;  // the first of them
    int bins;                 // that hold readings
    int *bin;                 // [count] of each reading
    double bin_n[KN_PULL_BINS], bin_sigma_n[KN_PULL_BINS], bin_s[KN_PULL_BINS];
    bool turned; // compression was negative
} kn_pull;

// Takes both arrays over; what is not within the press until its hold ends is left out: as it withdraws a tool tears
// off node by node. False and one sentence in error; the arrays are freed then, too.
bool kn_pull_make(kn_pull *pull, const kn_press *press, int count, double *time_s, double *force_n, char *error,
                  size_t error_size);
void kn_pull_free(kn_pull *pull); // zeroed is fine

// residual[bins]; model_n[bins], or NULL, becomes the model's force.
void kn_pull_compare(const kn_pull *pull, const kn_press *press, const kn_pressed *pressed, double *residual,
                     double *model_n);

#endif
