#ifndef KN_CLIENTS_IDENTIFY_STAGES_H
#define KN_CLIENTS_IDENTIFY_STAGES_H
// The first paper's own way, section 4, from one creep curve with its recovery:
//
//     1. x(tr) - x(t) = Pr/k1 (1 - exp(-k1/c1 (t - tr))) after the release gives k1, c1             (its equation 5)
//     2. the Voigt part, driven by the measured stress, is subtracted; what is left is the damper's displacement
//     3. its slope v gives c2 = P/v, to whose logarithm equation 6 is fitted
//
// Kept to compare with. At no noise it is 2.7 % low in k1 and c1: the stress falls during creep, so that the Voigt part
// is above Pr/k1 at the release. With 1 % of noise it is some five times less certain than the joint fit of the same
// curve (joint.h). The paper does not say how it smoothed; here v is the slope of a straight line through 21 readings.
#include "clients/identify/curve.h"
#include "core/material.h"

typedef struct kn_stages {
    kn_material material;
    double release_s, release_pa, release_strain; // tr, Pr, x(tr)
    int count;                                    // of the readings under load; the caller frees with kn_stages_free
    double *stress_pa, *voigt, *damper, *c2_pa_s; // at each; c2: NAN where the slope is not positive
} kn_stages;

// False: never released, fewer than 10 readings on either side, no slope; then nothing is to be freed.
bool kn_stages_fit(kn_stages *stages, const kn_curve *curve);
void kn_stages_free(kn_stages *stages);

// Equation 5 after the release, of the strain that came back.
double kn_stages_recovered(const kn_stages *stages, double since_release_s);

#endif
