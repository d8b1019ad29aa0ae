#ifndef KN_CLIENTS_IDENTIFY_RELAXATION_READINGS_H
#define KN_CLIENTS_IDENTIFY_RELAXATION_READINGS_H
// Split relaxation curves into means over the rise of the strain and means over the hold (bins.h), and check that the
// stress relaxes. Readings beside the corner between rise and hold are left out, since at the corner the stress changes
// within one sampling period.
#include "clients/identify/relaxation_fit.h"

#define KN_RELAXATION_RISE_BINS 40 // number of equal spans of time over which the readings of a rise are averaged

// Fill the fields `scale`, `curve` and `readings` of `r`. Return false with one sentence in `error` if there are too
// few readings, if a stress is not positive or does not fall, if only some of the files have a strain, or if memory
// runs out.
bool kn_relaxation_take(kn_relaxation_fit *r, int curves, const kn_curve *curve, bool constant_noise, char *error,
                        size_t error_size);

#endif
