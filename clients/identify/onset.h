#ifndef KN_CLIENTS_IDENTIFY_ONSET_H
#define KN_CLIENTS_IDENTIFY_ONSET_H
// Find the time at which a load was applied from the strain that it causes. Under a constant load the strain rises ever
// more slowly. The straight line through its first readings therefore meets the initial level at the time of the load
// or before, never later. This holds for any material, with or without flat readings before the load. The result is
// thus a lower limit of the time of the load.

// Return the time at which the straight line through the first rising strains meets the initial level of the strain.
// The initial level is the mean of the first three readings if these are flat, or else 0. Set *least_s to the earliest
// possible time, four standard deviations before the returned time. Return -INFINITY if the noise hides the rise of the
// strain, or if the first reading is more than four standard deviations of the noise below the initial level. There
// must be at least 3 readings, and the times must rise.
double kn_onset(int count, const double *time_s, const double *strain, double noise, double *least_s);

#endif
