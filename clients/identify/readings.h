#ifndef KN_CLIENTS_IDENTIFY_READINGS_H
#define KN_CLIENTS_IDENTIFY_READINGS_H
// Readings over time, between the sheet (sheet.h), which holds them as written in the file, and the curve (curve.h).
// The functions sort the readings, remove readings without a number, and thin the readings to as many as a fit needs.
#include <stdbool.h>

typedef struct kn_readings {
    int count; // number of entries in each array; an entry is a reading or a mean of readings
    // [count] other: strain or second modulus, or NULL; load: load or stress, or NULL; all arrays are owned
    double *time_s, *value, *other, *load;
    double *weight; // [count] number of readings in each entry; NULL: each entry is one reading
    int *line;      // [count] line number in the file of each entry's first reading
} kn_readings;

void kn_readings_free(kn_readings *r);

// Remove readings that lack a number. Set *first_line to the line number of the first removed reading. Return the
// number of removed readings.
int kn_readings_compact(kn_readings *r, int *first_line);

// Sort the readings by time; readings of the same time keep their order. Return the number of readings that were out of
// place, or -1 if memory runs out.
int kn_readings_sort(kn_readings *r);

// Replace readings of the same time and load by their mean. The weight of the mean is the number of these readings. If
// the value jumps at one time by at least a quarter of the value's range, both readings are kept, since the file then
// records the value before and after the jump. Return the number of removed readings, or -1 if memory runs out.
int kn_readings_merge(kn_readings *r);

// Remove the first `count` readings.
void kn_readings_skip(kn_readings *r, int count);

// Thin the readings to about `most` readings if there are more than 4/3 `most`. The rising times change_s[changes]
// divide the readings into pieces. Within a piece, neighbouring readings are averaged if their times since the begin of
// the piece differ by less than a factor, which is the same for the whole piece. Each mean is placed at the mean time
// of its readings. The mean of a bent curve is corrected by the curvature through the neighbouring means. Return false
// if memory runs out.
bool kn_readings_thin(kn_readings *r, int most, int changes, const double *change_s);

#endif
