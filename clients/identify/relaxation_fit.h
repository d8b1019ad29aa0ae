#ifndef KN_CLIENTS_IDENTIFY_RELAXATION_FIT_H
#define KN_CLIENTS_IDENTIFY_RELAXATION_FIT_H
// One joint fit of the papers' element to several relaxation curves. While the strain rises, the stress is computed by
// chain.h. While the strain is held, the stress is computed by the closed form of hold.h. The unknowns are the
// logarithms of
//
//     with a rise    k1, c1, alpha, beta, P0, P1
//     holds alone    c1/k1, alpha/k1, beta, P0, P1: a hold does not determine the scale k1. The equation
//                    k1 xv = P (1 + c1/c2(P)) holds at any time, and the strain xv of the Voigt element is at most the
//                    whole strain S, so
//
//                        k1 >= P (1 + c1/c2(P))/S at the first reading,                                           (1)
//
//                    with equality if the damper had not flowed before the first reading. c1 and alpha scale with k1.
//                    If S is unknown, the values are moduli instead of stresses, and k1 is unknown.
//
// For each hold without a rise, the stress Pi at time 0 is a further unknown. The first reading is later than time 0,
// so its stress is below Pi. Even an infinite Pi would fall to a finite stress by the time of the first reading, so the
// stress at the first reading has an upper limit. P0 and P1 are unknowns only if Akaike's criterion for small samples
// supports them. Otherwise the fit reports a bound of P0 or P1: the value at which the sum of squares has risen by as
// much as chance explains. c1 is always an unknown, since a fit without c1 biases the other unknowns. If the interval
// of c1 reaches 0, c1 is set to 0.
//
// The readings of a hold are the means of bins.h. The readings of a rise are 40 means over equal spans of time. The
// residuals are differences of ln(stress) with equal weights, so that every decade counts the same. If the noise is
// constant, the residuals are differences of the stress, and a mean of w readings counts w times.
#include "clients/identify/bins.h"
#include "clients/identify/parameter_estimate.h"
#include "clients/identify/ramp.h"

// largest number of relaxation curves; each curve adds at most one unknown to the six parameters, 12 unknowns in all
#define KN_RELAXATION_CURVES 6

typedef enum kn_relaxation_scale {
    KN_RELAXATION_RISE,   // the rise of the strain determines k1
    KN_RELAXATION_BOUND,  // the data give k1 only the lower bound of equation (1)
    KN_RELAXATION_MODULUS // the strain is unknown, so the values are moduli instead of stresses, and k1 is unknown
} kn_relaxation_scale;

typedef struct kn_relaxation_curve {
    const kn_curve *curve;
    kn_strain_ramp ramp;
    bool rises; // whether the fit uses readings of the rise of the strain
    // means of the readings in the rise and in the hold; their times count from the end of the rise and are negative in
    // the rise
    kn_time_bins rise, hold;
    double begin_pa;  // stress Pi at time 0 of a curve without a rise
    double *fit_pa;   // fitted stress at the means of `rise`, followed by the means of `hold`
    double *residual; // residuals at the means of `rise`, followed by the means of `hold`
    double misfit;    // mean of |fit/measured - 1|
    double runs;      // result of kn_fit_runs for the residuals
} kn_relaxation_curve;

typedef struct kn_relaxation_fit {
    kn_relaxation_scale scale;
    kn_material material; // identified material; not set if `scale` is KN_RELAXATION_MODULUS
    // k1, c1, alpha, beta, P0, P1. Without a rise, c1 and alpha are the values that belong to the lower bound of k1.
    kn_parameter_estimate number[KN_ESTIMATE_NUMBERS];
    kn_parameter_estimate ratio[2]; // the ratios c1/k1 and alpha/k1 [s]
    bool p0, p1;                    // whether P0 is an unknown of the fit, and whether P1 is one
    int curves, readings, unknowns;
    kn_relaxation_curve curve[KN_RELAXATION_CURVES];
    double lowest_pa, highest_pa; // least and largest stress of the fit at the readings
    double aicc;
} kn_relaxation_fit;

typedef struct kn_relaxation_fit_options {
    double confidence;   // confidence of the intervals, such as 0.95
    bool constant_noise; // the noise has the same size for all stresses, not the same share of each stress
    bool no_intervals;   // compute the values of the parameters without their intervals
} kn_relaxation_fit_options;

// Run the fit. Return false with one sentence in `error` if there are too many curves or too few readings, if a stress
// is not positive, or if memory runs out. Call kn_relaxation_fit_free in any case. `r` keeps pointers to the curves, which
// must stay valid as long as `r` is used.
bool kn_relaxation_fit_run(kn_relaxation_fit *r, int curves, const kn_curve *curve,
                           const kn_relaxation_fit_options *options, char *error, size_t error_size);
void kn_relaxation_fit_free(kn_relaxation_fit *r);

#endif
