#ifndef KN_CLIENTS_IDENTIFY_BINS_H
#define KN_CLIENTS_IDENTIFY_BINS_H
// Bins: relaxation readings averaged over equal widths of ln(time), so that every decade of time counts the same in a
// fit. An instrument that samples at a constant rate takes nine tenths of its readings in the last decade.
#include "clients/identify/curve.h"

#define KN_BINS_PER_DECADE 20

typedef struct kn_bins {
    int count;
    double *time_s; // arithmetic mean of the times since the strain was reached, s
    double *value;  // geometric mean of the values; the arithmetic mean if one value is at most half of it
    double *weight; // number of readings in the bin
    int *line;      // line number in the file of the first reading of the bin
} kn_bins;

// Average the readings after `begin_s`. `count` is 0 if there is no such reading. Return false if memory runs out.
bool kn_bins_make(kn_bins *bins, const kn_curve *curve, double begin_s);
void kn_bins_free(kn_bins *bins); // a zeroed struct is fine

#endif
