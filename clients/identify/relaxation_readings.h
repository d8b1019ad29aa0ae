#ifndef KN_CLIENTS_IDENTIFY_RELAXATION_READINGS_H
#define KN_CLIENTS_IDENTIFY_RELAXATION_READINGS_H
// Relaxation curves taken apart into what is fitted: means over the rise of the strain, means over the hold (bins.h),
// and whether they are of a relaxation at all. What stands beside the corner between both is left out: the stress jumps
// there within a sample.
#include "clients/identify/relaxation.h"

#define KN_RELAXATION_RISE_BINS 40 // means over equal times of a rise

// Fills scale, curve and readings of r. False and one sentence in error: too few readings, a stress that is none or
// does not fall, a strain in one file alone, no memory.
bool kn_relaxation_take(kn_relaxation *r, int curves, const kn_curve *curve, bool constant_noise, char *error,
                        size_t error_size);

#endif
