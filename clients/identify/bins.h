#ifndef KN_CLIENTS_IDENTIFY_BINS_H
#define KN_CLIENTS_IDENTIFY_BINS_H
// Bins: relaxation readings averaged over equal widths of ln(time), so that every decade of time counts the same in a
// fit. An instrument that samples at a constant rate takes nine tenths of its readings in the last decade.
#include "clients/identify/curve.h"

#define KN_TIME_BINS_PER_DECADE 20

typedef struct kn_time_bins {
    int count;      // number of bins, and of entries in each array below
    double *time_s; // [count] arithmetic mean of the bin's times since the strain was reached [s]
    // [count] geometric mean of the bin's stresses or moduli; their arithmetic mean if the least of them is at most
    // half of the arithmetic mean
    double *value;
    double *weight; // [count] number of readings in the bin
    int *line;      // [count] line number in the file of the first reading of the bin
} kn_time_bins;

// Average the readings of `curve` after the time `begin_s`. If no reading is later, bins->count is 0. Return false if
// memory runs out.
bool kn_time_bins_make(kn_time_bins *bins, const kn_curve *curve, double begin_s);
void kn_time_bins_free(kn_time_bins *bins); // a zeroed struct is allowed

#endif
