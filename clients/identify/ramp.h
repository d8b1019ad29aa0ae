#ifndef KN_CLIENTS_IDENTIFY_RAMP_H
#define KN_CLIENTS_IDENTIFY_RAMP_H
// The strain of a relaxation test over time as straight lines, from a file's strain column.
//
//     strain |      ___________ held      At rest, a straight rise, then held. If the column departs from that by more
//            |     /                      than KN_RAMP_STRAIGHT of the held strain and 5 of its own standard
//            |    /                       deviations, the thinned column itself is used.
//            |___/______________ time
//
// Straight lines are preferred to the column if both fit. The dashpot c1 responds to the rate of the strain, and thus
// to the noise of a column.
#include "clients/identify/chain.h"
#include "clients/identify/curve.h"

#define KN_RAMP_STRAIGHT 0.02

typedef struct kn_ramp {
    int steps;
    kn_chain_step step[KN_CHAIN_STEPS]; // value: strain; the last strain is held
    double start_s, end_s, strain;      // start and end of the rise, and the held strain
    bool straight;
    double apart; // largest distance of the column from the two lines, as a share of the held strain
} kn_ramp;

// Find the ramp. Return false with one sentence in error if the curve has no strain column, or if the strain does not
// rise and stay.
bool kn_ramp_of(kn_ramp *ramp, const kn_curve *curve, char *error, unsigned long error_size);

#endif
