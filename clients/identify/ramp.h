#ifndef KN_CLIENTS_IDENTIFY_RAMP_H
#define KN_CLIENTS_IDENTIFY_RAMP_H
// The strain of a relaxation test over time as a series of straight lines, found from a file's strain column.
//
//     strain |      ___________ held      The strain is 0 at first, rises on a straight line, and is then held. If the
//            |     /                      column departs from these lines by more than KN_STRAIN_RAMP_STRAIGHT times the held
//            |    /                       strain and by more than 5 standard deviations of the column's noise, the
//            |___/______________ time     thinned column itself is used instead.
//
// If the straight lines fit the column, the lines are preferred. The reason is that the dashpot c1 responds to the rate
// of the strain, and thus to the noise of the column.
#include "clients/identify/element_response.h"
#include "clients/identify/curve.h"

#define KN_STRAIN_RAMP_STRAIGHT 0.02

typedef struct kn_strain_ramp {
    int steps; // number of entries in step[]
    kn_voigt_chain_step
        step[KN_VOIGT_CHAIN_STEPS]; // corners of the strain over time; `value` is the strain; the last one is held
    // time at which the strain begins to rise, time at which it is held, held strain
    double start_s, end_s, strain;
    bool straight; // true: straight lines are used; false: the strain column is used
    double apart;  // largest distance of the strain column from the two straight lines, as a share of the held strain
} kn_strain_ramp;

// Find the rise of the strain. Return false with one sentence in `error` if the curve has no strain column, or if the
// strain does not rise and then stay constant.
bool kn_strain_ramp_of(kn_strain_ramp *ramp, const kn_curve *curve, char *error, unsigned long error_size);

#endif
