#ifndef KN_CLIENTS_IDENTIFY_READINGS_H
#define KN_CLIENTS_IDENTIFY_READINGS_H
// Readings over time between the sheet, where they are as they were written, and the curve, where they are in order,
// without gaps, and no more than a fit needs.
#include <stdbool.h>

typedef struct kn_readings {
    int count;
    double *time_s, *value, *other, *load; // other, load: NULL where there is none; owned
    double *weight;                        // NULL: each is one reading
    int *line;
} kn_readings;

void kn_readings_free(kn_readings *r);

// Leaves out those without a number; *first_line: of the first of them. How many.
int kn_readings_compact(kn_readings *r, int *first_line);

// Into the order of time; those of the same time stay in theirs. How many stood in a wrong place; -1: no memory.
int kn_readings_sort(kn_readings *r);

// Those of the same time and load become their mean, whose weight is their number, but not across a jump by a quarter
// of the range, whose both sides have been written down. How many are left out by it; -1: no memory.
int kn_readings_merge(kn_readings *r);

// Takes off count readings at the begin.
void kn_readings_skip(kn_readings *r, int count);

// Of more than 4/3 `most` about `most` are left: within each piece between two changes (times, rising; the first
// reading begins one, too) neighbours whose times since the change differ by less than a factor, the same for all,
// become their mean at their mean time, with the curvature of the values through their neighbours taken out of the
// mean. False: no memory.
bool kn_readings_thin(kn_readings *r, int most, int changes, const double *change_s);

#endif
