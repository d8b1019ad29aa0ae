#ifndef KN_CLIENTS_IDENTIFY_RELAXATION_H
#define KN_CLIENTS_IDENTIFY_RELAXATION_H
// One joint fit of the papers' element to several relaxation curves. While the strain rises, the stress is computed by
// chain.h; while the strain is held, by the closed form of hold.h. The unknowns are the logarithms of
//
//     with a rise    k1, c1, alpha, beta, P0, P1
//     holds alone    c1/k1, alpha/k1, beta, P0, P1: a hold does not determine the scale. k1 xv = P (1 + c1/c2(P)) holds
//                    at any time, and the strain xv of the Voigt part is at most the whole strain S, so
//
//                        k1 >= P (1 + c1/c2(P))/S at the first reading,                                           (1)
//
//                    with equality if nothing had flowed by then. c1 and alpha scale with k1. Without S, stresses are
//                    in units of the modulus, and k1 is unknown.
//
// and, for each hold without a rise, the stress Pi at time 0. Pi is not the stress at the first reading, which is
// later. Even an infinite Pi would have fallen to a finite stress by then, so the stress at the first reading has an
// upper limit. P0 and P1 are unknowns only if Akaike's criterion for small samples supports them. If not, the fit
// reports a bound: the value at which the sum of squares has risen by as much as chance explains. c1 is always an
// unknown, since a fit without c1 biases the other unknowns. If the interval of c1 reaches 0, c1 is set to 0.
//
// The readings are the means of bins.h, and for a rise 40 means over equal times. The residuals are differences of
// ln(stress) with equal weights, so that every decade counts the same. If the noise is constant, they are differences
// of the stress, and a mean of w readings counts w times.
#include "clients/identify/bins.h"
#include "clients/identify/identified.h"
#include "clients/identify/ramp.h"

enum {
    KN_RELAXATION_K1,
    KN_RELAXATION_C1,
    KN_RELAXATION_ALPHA,
    KN_RELAXATION_BETA,
    KN_RELAXATION_P0,
    KN_RELAXATION_P1,
    KN_RELAXATION_NUMBERS
};
#define KN_RELAXATION_CURVES 6 // each hold adds an unknown; 12 is the limit

typedef enum kn_relaxation_scale {
    KN_RELAXATION_RISE,   // the rise of the strain determines k1
    KN_RELAXATION_BOUND,  // only the lower bound (1) of k1 is known
    KN_RELAXATION_MODULUS // no strain: stresses are moduli
} kn_relaxation_scale;

typedef struct kn_relaxation_curve {
    const kn_curve *curve;
    kn_ramp ramp;
    bool rises;
    kn_bins rise, hold; // means of the rise and of the hold; times since the strain was reached, negative in the rise
    double begin_pa;    // Pi of a curve without a rise
    double *fit_pa;     // fitted stress at the readings of `rise`, then of `hold`
    double *residual;   // residuals in the same order
    double misfit;      // mean of |fit/measured - 1|
    double runs;        // kn_fit_runs
} kn_relaxation_curve;

typedef struct kn_relaxation {
    kn_relaxation_scale scale;
    kn_material material; // SI; not set for MODULUS
    // k1, c1, alpha, beta, P0, P1. Without a rise, c1 and alpha are the values for k1 at its lower bound.
    kn_identified number[KN_RELAXATION_NUMBERS];
    kn_identified ratio[2]; // c1/k1, alpha/k1, s
    bool p0, p1;            // whether P0 and P1 are unknowns of the fit
    int curves, readings, unknowns;
    kn_relaxation_curve curve[KN_RELAXATION_CURVES];
    double lowest_pa, highest_pa; // stresses of the fit at the readings
    double sum, scale_of_noise, aicc;
    long evaluations;
} kn_relaxation;

typedef struct kn_relaxation_options {
    double confidence; // 0.95
    bool constant_noise;
    bool no_intervals; // values only
} kn_relaxation_options;

// Run the fit. Return false with one sentence in error if there are too many curves or too few readings, if a stress is
// not positive, or if memory runs out. Call kn_relaxation_free in any case. r keeps pointers to the curves.
bool kn_relaxation_fit(kn_relaxation *r, int curves, const kn_curve *curve, const kn_relaxation_options *options,
                       char *error, size_t error_size);
void kn_relaxation_free(kn_relaxation *r);

#endif
