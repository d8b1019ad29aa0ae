#ifndef KN_CLIENTS_IDENTIFY_BINS_H
#define KN_CLIENTS_IDENTIFY_BINS_H
// Readings of a relaxation averaged over equal widths of ln(time), so that seconds are not outvoted by hours: an
// instrument that samples steadily takes nine readings of the last decade for each one of all before it.
#include "clients/identify/curve.h"

#define KN_BINS_PER_DECADE 20

typedef struct kn_bins {
    int count;
    double *time_s; // since the strain was reached: geometric mean
    double *value;  // arithmetic mean; within a bin the curve is straight enough
    double *weight; // readings in it
    int *line;      // of the file, of the first of them
} kn_bins;

// Of a curve's readings after begin_s. False: no memory. count 0: none is.
bool kn_bins_make(kn_bins *bins, const kn_curve *curve, double begin_s);
void kn_bins_free(kn_bins *bins); // zeroed is fine

#endif
