#ifndef KN_CLIENTS_IDENTIFY_READINGS_H
#define KN_CLIENTS_IDENTIFY_READINGS_H
// Readings over time, on their way from the sheet (sheet.h), where they are as written in the file, to the curve
// (curve.h). These functions sort the readings, remove gaps, and thin them to as many as a fit needs.
#include <stdbool.h>

typedef struct kn_readings {
    int count;
    double *time_s, *value, *other, *load; // other, load: NULL if there is none; all arrays are owned
    double *weight;                        // NULL: each entry is one reading
    int *line;
} kn_readings;

void kn_readings_free(kn_readings *r);

// Remove readings that lack a number. *first_line is the line of the first of them. Return how many were removed.
int kn_readings_compact(kn_readings *r, int *first_line);

// Sort by time; readings of one time keep their order. Return how many were out of place, or -1 if memory runs out.
int kn_readings_sort(kn_readings *r);

// Replace readings of the same time and load by their mean, with their number as its weight. A jump of the value by at
// least a quarter of its range is kept, since the file then records the value before and after the jump. Return how
// many readings were removed, or -1 without memory.
int kn_readings_merge(kn_readings *r);

// Remove the first count readings.
void kn_readings_skip(kn_readings *r, int count);

// Thin the readings to about `most` if there are more than 4/3 `most`. The rising times `change_s` divide the readings
// into pieces. Within a piece, neighbours are averaged if their times since the change differ by less than a factor,
// which is the same for the whole piece. The mean is placed at their mean time. The mean of a bent curve is corrected
// by the curvature through its neighbours. Return false if memory runs out.
bool kn_readings_thin(kn_readings *r, int most, int changes, const double *change_s);

#endif
