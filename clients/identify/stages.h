#ifndef KN_CLIENTS_IDENTIFY_STAGES_H
#define KN_CLIENTS_IDENTIFY_STAGES_H
// The first paper's own method, section 4, for one creep curve with its recovery:
//
//     1. Equation 5 is fitted to the strain x(t) after the load is removed at the time tr, which gives k1 and c1:
//        x(tr) - x(t) = Pr/k1 (1 - exp(-k1/c1 (t - tr))), where Pr is the stress at tr
//     2. The strain of the Voigt element under the measured stress is subtracted, which leaves the damper's strain
//     3. The slope v of the damper's strain gives c2 = P/v; equation 6 is fitted to the logarithm of c2
//
// The method is kept for comparison. Even without noise its k1 and c1 are 2.7 % too low: the stress falls during creep,
// so the strain of the Voigt element at the release is above Pr/k1. With 1 % of noise the method is about five times
// less certain than the joint fit of one curve (joint.h). The paper does not say how it smoothed; here v is the slope
// of a straight line through 21 readings.
#include "clients/identify/curve.h"
#include "core/material.h"

typedef struct kn_stages {
    kn_material material;
    double release_s, release_pa, release_strain; // time tr, stress Pr and strain x(tr) at which the load was removed
    int count;                                    // number of readings under load
    // [count] stress; strain of the Voigt element; strain of the damper; damping c2, NAN if the slope v is not positive
    double *stress_pa, *voigt, *damper, *c2_pa_s;
} kn_stages;

// Run the three stages. Return false if the load was never removed, if there are fewer than 10 readings before or after
// the removal, or if no slope v can be computed. After false nothing needs to be freed.
bool kn_stages_fit(kn_stages *stages, const kn_curve *curve);
void kn_stages_free(kn_stages *stages);

// Return the strain that has recovered at the time `since_release_s` after the load was removed, by equation 5.
double kn_stages_recovered(const kn_stages *stages, double since_release_s);

#endif
