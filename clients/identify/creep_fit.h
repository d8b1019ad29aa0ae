#ifndef KN_CLIENTS_IDENTIFY_CREEP_FIT_H
#define KN_CLIENTS_IDENTIFY_CREEP_FIT_H
// One joint fit of the papers' element to several whole creep curves, creep and recovery, under all loads:
//
//     x = xv + xd,   xv' = (P - k1 xv)/c1,   xd' = P/c2(P),   c2 = alpha exp(-beta clamp(P, P0, P1)),
//     P = W/S0 (1 - x) under a load, 0 after it                                        (first paper, equations 1-6)
//
// The unknowns are the logarithms of k1, c1, alpha and beta, and of P0 and P1 if stresses beyond them were measured.
//
// P0 has no effect on the computed strain while P0 is below the least stress of all loads. So P0 becomes an unknown
// only if a fit with P0 is better by more than chance explains. Otherwise the fit sets P0 to the least stress, so that
// the damper law is not extrapolated, and the interval states how high P0 could be. P1 has no effect while P1 is above
// the largest stress. A search for P1 that begins above the largest stress stays there and biases the other parameters
// (beta by 0.4 %). So the search for P1 begins at several fractions of the largest stress.
//
// If the option `late` is set, the fit corrects the times of the loads, with two unknowns for each curve. The first is
// one shift of all loads, up to the whole duration of the curve, since a recording may have been started too soon or
// too late. The second is the duration of the last load, from a tenth of the file's value to twice that value, since a
// load may have been applied late and yet removed at the noted time. The search for the shift begins at the time at
// which the strain begins to rise (kn_strain_onset). The search for the duration begins with the noted duration or with
// the noted removal, whichever puts the removal nearer to the largest strain.
//
// Curves under a single stress (a constant area, a small strain, or a compliance) determine only one parameter of the
// damper. The damper is then taken as constant, with damping c2.
//
// An outlier is a reading more than five standard deviations away from the fitted curve. Up to three neighbouring
// outliers are left out of the fit and listed. A longer series of neighbouring outliers is kept in the fit, since in
// that case the model is wrong, not the readings.
#include "clients/identify/measured_curve.h"
#include "clients/identify/element_response.h"
#include "clients/identify/parameter_estimate.h"

#define KN_CREEP_OUTLIERS 64

typedef struct kn_creep_outlier {
    int curve, reading, line; // indices of the curve and of the reading; line number in the curve's file
    double deviations;        // distance from the fitted curve, in standard deviations of the noise
} kn_creep_outlier;

typedef struct kn_creep_fit {
    kn_material material;
    kn_parameter_estimate number[KN_ESTIMATE_NUMBERS];
    double lowest_pa, highest_pa; // range of the measured stresses under load
    // root mean square residual of each curve, comparable with the noise of a single reading. If an entry is a mean of
    // w readings, its squared residual is multiplied by w
    double rms[KN_CURVES_MAX];
    double runs[KN_CURVES_MAX];   // result of kn_fit_runs for each curve
    double late_s[KN_CURVES_MAX]; // how much later than the file says the load was applied; 0 without option `late`
    // how much longer than the file says the last load lasted; so the load was removed late_s + held_s later than the
    // file says
    double held_s[KN_CURVES_MAX];
    int readings, outliers; // number of readings in the fit; number of readings that were left out
    kn_creep_outlier outlier[KN_CREEP_OUTLIERS];
    double scale;      // scale of the residuals (least_squares.h); 1 if the residuals are as large as the noise
    double alpha_beta; // correlation of alpha and beta
} kn_creep_fit;

typedef struct kn_creep_fit_options {
    double confidence; // confidence of the intervals, such as 0.95
    bool late;         // also fit the times at which each curve's loads were applied and removed
    bool no_intervals; // compute the values of the parameters without their intervals
} kn_creep_fit_options;

// Run the fit. Return false if there are too few readings, if the model has no solution at any start of the search, or
// if memory runs out. In that case `joint` is invalid.
bool kn_creep_fit_run(kn_creep_fit *joint, int curves, const kn_curve *curve, const kn_creep_fit_options *options);

// Shift the times of the curves by the fitted lateness of their loads, so that the first load is applied at time 0.
// Readings before time 0 are dropped. The line numbers of the outliers stay valid, but the reading indices of the
// outliers do not.
void kn_creep_fit_settle(const kn_creep_fit *joint, int curves, kn_curve *curve);

// Compute the strain of a material under a curve's loads, at the times of the curve's readings. Return false if the
// material's parameters are out of range.
bool kn_creep_fit_predict(const kn_material *material, const kn_curve *curve, double *strain);

// Compute the strain of a Voigt chain under a curve's loads, at `count` rising times.
bool kn_creep_strain(const kn_voigt_chain *chain, const kn_curve *curve, int count, const double *time_s,
                     double *strain);

// Compute the stress at each reading from the measured strain by equation 4 of the first paper. The stress is 0 where
// there is no load.
void kn_creep_stress(const kn_curve *curve, double *stress_pa);

// Return the nominal stress W/S0 just before a time. It is 0 before the first load and after the last load.
double kn_creep_load(const kn_curve *curve, double time_s);
double kn_creep_release(const kn_curve *curve); // return the time at which the last load was removed; INFINITY: never

// ---- the two-stage method
//
// The first paper's own method, section 4, for one creep curve with its recovery:
//
//     1. Equation 5 is fitted to the strain x(t) after the load is removed at the time tr, which gives k1 and c1:
//        x(tr) - x(t) = Pr/k1 (1 - exp(-k1/c1 (t - tr))), where Pr is the stress at tr
//     2. The strain of the Voigt element under the measured stress is subtracted, which leaves the damper's strain
//     3. The slope v of the damper's strain gives c2 = P/v; equation 6 is fitted to the logarithm of c2
//
// The method is kept for comparison. Even without noise its k1 and c1 are 2.7 % too low: the stress falls during creep,
// so the strain of the Voigt element at the release is above Pr/k1. With 1 % of noise the method is about five times
// less certain than the joint fit of one curve. The paper does not say how it smoothed; here v is the slope
// of a straight line through 21 readings.
typedef struct kn_two_stage {
    kn_material material;
    // state at the time tr at which the load was removed: tr, the stress Pr and the strain x(tr)
    double release_s, release_pa, release_strain;
    int count; // number of readings under load
    // [count] stress_pa: stress; voigt: strain of the Voigt element; damper: strain of the damper; c2_pa_s: damping c2,
    // NAN if the slope v of the damper's strain is not positive
    double *stress_pa, *voigt, *damper, *c2_pa_s;
} kn_two_stage;

// Run the three stages. Return false if the load was never removed, if there are fewer than 10 readings before or after
// the removal, if the fit of a stage fails, or if memory runs out. After false nothing needs to be freed.
bool kn_two_stage_fit(kn_two_stage *stages, const kn_curve *curve);
void kn_two_stage_free(kn_two_stage *stages);

// Return the strain that has recovered at the time `since_release_s` after the load was removed, by equation 5 of the
// first paper.
double kn_two_stage_recovered(const kn_two_stage *stages, double since_release_s);

#endif
