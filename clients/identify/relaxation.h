#ifndef KN_CLIENTS_IDENTIFY_RELAXATION_H
#define KN_CLIENTS_IDENTIFY_RELAXATION_H
// The papers' element fitted to relaxation curves at once: while the strain rises by chain.h, where it is held by the
// closed form of hold.h, over the logarithms of
//
//     with a rise    k1, c1, alpha, beta, P0, P1
//     holds alone    c1/k1, alpha/k1, beta, P0, P1: a hold does not know the scale. k1 xv = P (1 + c1/c2(P)) at any
//     time,
//                    and the Voigt part's strain xv is at most the whole strain S, so
//
//                        k1 >= P (1 + c1/c2(P))/S at the first reading,                                           (1)
//
//                    equal if nothing had flowed by then. c1 and alpha go with it. Without S, stresses are in units of
//                    the modulus, and k1 is not known at all.
//
// and a stress Pi at time 0 of each hold that has no rise. Not at its first reading: the element cannot have come from
// beyond an infinite stress, which is a bound on that one. P0 and P1 are in the fit only where Akaike's criterion for
// small samples asks for them; else their bound is where the sum of squares has risen by what chance explains. c1
// always is, since without it the others are bent; where its interval reaches 0, 0 is taken.
//
// Readings are those of bins.h, and of a rise 40 means over equal times. Residuals are of ln(stress), all alike, so
// that every decade counts the same; or, of constant noise, of stress, a mean of w readings counting w times.
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
#define KN_RELAXATION_CURVES 6 // each hold costs an unknown: 12 are the most

typedef enum kn_relaxation_scale {
    KN_RELAXATION_RISE,   // k1 is in a rise of the strain
    KN_RELAXATION_BOUND,  // k1 is at least (1)
    KN_RELAXATION_MODULUS // no strain: stresses are moduli
} kn_relaxation_scale;

typedef struct kn_relaxation_curve {
    const kn_curve *curve;
    kn_ramp ramp;
    bool rises;
    kn_bins rise, hold; // times since the strain was reached; of a rise negative
    double begin_pa;    // Pi, of one that does not rise
    double *fit_pa;     // of rise, then of hold
    double *residual;   // the same
    double misfit;      // mean of |fit/measured - 1|
    double runs;        // kn_fit_runs
} kn_relaxation_curve;

typedef struct kn_relaxation {
    kn_relaxation_scale scale;
    kn_material material; // SI; of MODULUS none
    // k1, c1, alpha, beta, P0, P1. Without a rise c1 and alpha here are those that belong to k1's bound.
    kn_identified number[KN_RELAXATION_NUMBERS];
    kn_identified ratio[2]; // c1/k1, alpha/k1, s
    bool p0, p1;            // in the fit
    int curves, readings, unknowns;
    kn_relaxation_curve curve[KN_RELAXATION_CURVES];
    double lowest_pa, highest_pa; // of the fit where something was measured
    double sum, scale_of_noise, aicc;
    long evaluations;
} kn_relaxation;

typedef struct kn_relaxation_options {
    double confidence; // 0.95
    bool constant_noise;
    bool no_intervals; // values alone
} kn_relaxation_options;

// False and one sentence in error: too many curves, too few readings, a stress that is none, no memory. Freed with
// kn_relaxation_free in any case. Borrows the curves.
bool kn_relaxation_fit(kn_relaxation *r, int curves, const kn_curve *curve, const kn_relaxation_options *options,
                       char *error, size_t error_size);
void kn_relaxation_free(kn_relaxation *r);

#endif
