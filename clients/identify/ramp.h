#ifndef KN_CLIENTS_IDENTIFY_RAMP_H
#define KN_CLIENTS_IDENTIFY_RAMP_H
// How the strain of a relaxation test came about, as straight lines: from a file's strain column.
//
//     strain |      ___________ held      at rest, a straight rise, held; where the column departs from that by more
//            |     /                      than KN_RAMP_STRAIGHT of what is held and 5 of its own standard deviations,
//            |    /                       the column itself, thinned.
//            |___/______________ time
//
// A line is better than the column where both fit: the dashpot c1 answers the strain's rate, and with it the noise of a
// column.
#include "clients/identify/chain.h"
#include "clients/identify/curve.h"

#define KN_RAMP_STRAIGHT 0.02

typedef struct kn_ramp {
    int steps;
    kn_chain_step step[KN_CHAIN_STEPS]; // strain; the last is held
    double start_s, end_s, strain;      // rise and what is held
    bool straight;
    double apart; // how far the column departs from the two lines at most, of what is held
} kn_ramp;

// False and one sentence in error: it has no strain column, or that does not rise to a strain and stay.
bool kn_ramp_of(kn_ramp *ramp, const kn_curve *curve, char *error, unsigned long error_size);

#endif
