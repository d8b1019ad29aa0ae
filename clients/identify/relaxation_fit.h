#ifndef KN_CLIENTS_IDENTIFY_RELAXATION_FIT_H
#define KN_CLIENTS_IDENTIFY_RELAXATION_FIT_H
// One joint fit of the papers' element to several relaxation curves. While the strain rises, the stress is computed by
// kn_voigt_chain_stress. While the strain is held, the stress is computed by the closed form of a held element. The
// unknowns are the logarithms of
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
// so its stress is below Pi. Even an infinite Pi would fall to a finite stress by the time of the first reading. So for
// given parameters the fitted stress at the first reading has an upper limit, however large Pi is. P0 and P1 are
// unknowns only if Akaike's criterion for small samples supports them. Otherwise the fit reports a bound of P0 or P1:
// the value at which the sum of squares has risen by as much as chance explains. c1 is always an unknown, since a fit
// without c1 biases the other unknowns. If the interval of c1 reaches 0, c1 is set to 0.
//
// The readings of a hold are the means of bins of ln(time), 20 for each decade, so that every decade of time counts the
// same. An instrument that samples at a constant rate takes nine tenths of its readings in the last decade. The
// readings of a rise are 40 means over equal spans of time. Readings beside the corner between rise and hold are left
// out, since at the corner the stress changes within one sampling period. The residuals are differences of ln(stress)
// with equal weights. If the noise is constant, the residuals are differences of the stress, and a mean of w readings
// counts w times.
#include "clients/identify/measured_curve.h"
#include "clients/identify/element_response.h"
#include "clients/identify/parameter_estimate.h"

#define KN_TIME_BINS_PER_DECADE 20
#define KN_RELAXATION_RISE_BINS 40 // number of equal spans of time over which the readings of a rise are averaged
#define KN_STRAIN_RAMP_STRAIGHT 0.02

// The strain of a relaxation test over time as a series of straight lines, found from a file's strain column.
//
//     strain |      ___________ held      The strain is 0 at first, rises on a straight line, and is then held. If the
//            |     /                      column departs from these lines by more than KN_STRAIN_RAMP_STRAIGHT times
//            |    /                       the held strain and by more than 5 standard deviations of the column's noise,
//            |___/______________ time     the thinned column itself is used instead.
//
// If the straight lines fit the column, the lines are preferred. The reason is that the dashpot c1 responds to the rate
// of the strain, and thus to the noise of the column.
typedef struct kn_strain_ramp {
    int steps; // number of entries in step[]
    // corners of the strain over time, as pairs of time and strain; the last strain is held
    kn_voigt_chain_step step[KN_VOIGT_CHAIN_STEPS];
    // start_s: time at which the strain begins to rise; end_s: time at which the held strain is reached; strain: held
    // strain
    double start_s, end_s, strain;
    bool straight; // true: straight lines are used; false: the strain column is used
    double apart;  // largest distance of the strain column from the two straight lines, as a share of the held strain
} kn_strain_ramp;

// Find the rise of the strain. Return false if the curve has no strain column, or if the strain does not rise and then
// stay constant.
bool kn_strain_ramp_of(kn_strain_ramp *ramp, const kn_curve *curve);

typedef struct kn_time_bins {
    int count;      // number of bins, and of entries in each array below
    double *time_s; // [count] arithmetic mean of the bin's times since the strain was reached [s]
    // [count] mean of the bin's stresses or moduli. The mean is geometric in a hold. It is arithmetic in a rise, or if
    // the least value of the bin is at most half of the arithmetic mean.
    double *value;
    double *weight; // [count] number of readings in the bin
    int *line;      // [count] line number in the file of the first reading of the bin
} kn_time_bins;

// Average the readings of `curve` after the time `begin_s` over equal widths of ln(time). If no reading is later,
// bins->count is 0. Return false if memory runs out; the bins are then empty.
bool kn_time_bins_make(kn_time_bins *bins, const kn_curve *curve, double begin_s);
void kn_time_bins_free(kn_time_bins *bins); // the struct may be all zeros

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
    // Means of the readings in the rise and in the hold. Time counts from the end of the rise, so it is negative in the
    // rise. The arrays of `hold` follow those of `rise` in memory, so rise.value[rise.count] is hold.value[0].
    kn_time_bins rise, hold;
    double *fit_pa;   // fitted stress, first at the means of `rise`, then at the means of `hold`
    double *residual; // residuals, first at the means of `rise`, then at the means of `hold`
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
    int curves, readings;
    kn_relaxation_curve curve[KN_RELAXATION_CURVES];
    double lowest_pa, highest_pa; // least fitted stress at the means of the holds; largest fitted stress at all means
} kn_relaxation_fit;

typedef struct kn_relaxation_fit_options {
    double confidence;   // confidence of the intervals, such as 0.95
    bool constant_noise; // the noise is the same at all stresses; false: it is a fixed share of the stress
    bool no_intervals;   // compute the values of the parameters without their intervals
} kn_relaxation_fit_options;

// Run the fit. Return false with one sentence in `error` if there are too many curves or too few readings, if no fit is
// possible (for example, if a stress is not positive or does not fall), or if memory runs out. Call
// kn_relaxation_fit_free in any case. `r` keeps pointers to the curves, which must stay valid as long as `r` is used.
bool kn_relaxation_fit_run(kn_relaxation_fit *r, int curves, const kn_curve *curve,
                           const kn_relaxation_fit_options *options, char *error, size_t error_size);
void kn_relaxation_fit_free(kn_relaxation_fit *r);

// For kn_relaxation_fit_run: fill the fields `scale`, `curve` and `readings` of `r`, and check that the stress relaxes.
// Return false with one sentence in `error` if there are too few readings, if a stress is not positive or does not
// fall, if only some of the files have a strain, or if memory runs out.
bool kn_relaxation_take(kn_relaxation_fit *r, int curves, const kn_curve *curve, bool constant_noise, char *error,
                        size_t error_size);

#endif
