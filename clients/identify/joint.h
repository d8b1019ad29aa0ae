#ifndef KN_CLIENTS_IDENTIFY_JOINT_H
#define KN_CLIENTS_IDENTIFY_JOINT_H
// One joint fit of the papers' element to several whole creep curves, creep and recovery, under all loads:
//
//     x = xv + xd,   xv' = (P - k1 xv)/c1,   xd' = P/c2(P),   c2 = alpha exp(-beta clamp(P, P0, P1)),
//     P = W/S0 (1 - x) under a load, 0 after it                                        (first paper, equations 1-6)
//
// The unknowns are the logarithms of k1, c1, alpha and beta, and of P0 and P1 if stresses beyond them were measured.
//
// P0 has no effect on the data while it is below the least stress of all loads. So P0 becomes an unknown only if this
// improves the fit by more than chance would. If not, the fit sets P0 to the least stress, so that the damper law is
// not extrapolated, and the interval states how high P0 could be. P1 has no effect while it is above the largest
// stress. A search for P1 that begins there stays there and biases the other parameters (beta by 0.4 %). So the search
// for P1 begins at several shares of the largest stress.
//
// On request (`late`), the fit corrects the times of the loads, with two unknowns for each curve. The first is one
// shift of all loads, up to the whole length of the curve: a recording may have been started too soon or too late. The
// second is the duration of the last load, from a tenth of the file's value to twice that value: a load may have been
// applied late and yet removed at the noted time. The search for the shift begins where the strain begins (onset.h).
// The search for the duration begins with the noted duration or with the noted removal, whichever puts the removal
// nearer to the largest strain.
//
// Curves under a single stress (a constant area, a small strain, or a compliance) determine only one parameter of the
// damper. The damper is then taken as constant, with damping c2.
//
// Outliers are readings more than five standard deviations away from the fitted curve. At most three neighbouring
// outliers are left out and listed. Longer rows of them are kept, since then the model is wrong, not the readings.
#include "clients/identify/curve.h"
#include "clients/identify/identified.h"

// KN_JOINT_ALPHA is the damping c2 if the damper is constant.
enum { KN_JOINT_K1, KN_JOINT_C1, KN_JOINT_ALPHA, KN_JOINT_BETA, KN_JOINT_P0, KN_JOINT_P1, KN_JOINT_NUMBERS };
#define KN_JOINT_OUTLIERS 64

typedef struct kn_joint_outlier {
    int curve, reading, line; // line: in the curve's file
    double deviations;        // distance from the fitted curve, in standard deviations of the noise
} kn_joint_outlier;

typedef struct kn_joint {
    kn_material material;
    kn_identified number[KN_JOINT_NUMBERS];
    double lowest_pa, highest_pa; // range of the measured stresses under load
    // root mean square residual of each curve per single reading, as strain; a mean of several readings counts by its
    // weight
    double rms[KN_CURVES_MAX];
    double runs[KN_CURVES_MAX];   // kn_fit_runs of each curve
    double late_s[KN_CURVES_MAX]; // by how much the load was applied later than the file says; 0 unless `late`
    // by how much the last load lasted longer than the file says: it was removed late_s + held_s later
    double held_s[KN_CURVES_MAX];
    int readings, unknowns, outliers;
    kn_joint_outlier outlier[KN_JOINT_OUTLIERS];
    double sum, scale;
    double alpha_beta; // correlation of alpha and beta
    long evaluations;
} kn_joint;

typedef struct kn_joint_options {
    double confidence; // 0.95
    bool late;         // also fit the times at which each curve's loads were applied and removed
    bool no_intervals; // values only
} kn_joint_options;

// Run the fit. Return false if memory runs out, or if the model has no solution at any start; joint is then invalid.
bool kn_joint_fit(kn_joint *joint, int curves, const kn_curve *curve, const kn_joint_options *options);

// Shift the curves to the fitted times of their loads. Time 0 is then again the first load, and readings before time 0
// are dropped. The line numbers of the outliers stay valid, their reading indices do not.
void kn_joint_settle(const kn_joint *joint, int curves, kn_curve *curve);

// Compute the strain of a material under a curve's loads, at the curve's readings. Return false if the parameters are
// out of range.
bool kn_joint_predict(const kn_material *material, const kn_curve *curve, double *strain);

// Compute the stress at each reading from the measured strain by equation 4 of the first paper. The stress is 0 where
// there is no load.
void kn_joint_stress(const kn_curve *curve, double *stress_pa);

// Return the nominal stress at a time; 0 before the first load and after the last.
double kn_joint_load(const kn_curve *curve, double time_s);
double kn_joint_release(const kn_curve *curve); // time at which the last load was removed; INFINITY: never

#endif
