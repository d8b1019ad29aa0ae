#ifndef KN_CLIENTS_IDENTIFY_JOINT_H
#define KN_CLIENTS_IDENTIFY_JOINT_H
// The papers' element fitted to whole creep curves at once, creep and recovery, all loads:
//
//     x = xv + xd,   xv' = (P - k1 xv)/c1,   xd' = P/c2(P),   c2 = alpha exp(-beta clamp(P, P0, P1)),
//     P = W/S0 (1 - x) under a load, 0 after it                                        (first paper, equations 1-6)
//
// over the logarithms of k1, c1, alpha, beta, and of P0 and P1 where stresses beyond them were measured.
//
// P0 below the least stress that any load left changes nothing that can be seen. It is sought only where letting it go
// makes the fit better by more than chance would; else the fit has it at that least stress, where nothing is
// extrapolated, and its interval says how high it could be. P1 above the largest stress has no gradient either: a
// search that begins there stays there and bends the others (beta by 0.4 %), so it begins at several shares of it.
//
// Where it is asked for, each curve's clock may be off, by up to its whole length: all its loads came by so much later
// (or earlier) than its file says. That is what a recording does which was started too soon or too late. A load that
// came late while its release was as noted is another thing, so the last load's duration is an unknown of its own, from
// a tenth of what the file says to twice that. The search begins where the strain does (onset.h), and where it is
// largest.
//
// Curves of one stress alone (a constant area, a small strain, or a compliance) say one number of the damper: it is
// constant then, c2.
//
// Readings that stand more than five standard deviations from the curve, alone or up to three beside each other, are
// left out and named; where they come in longer rows the model is wrong, not the reading, and they stay.
#include "clients/identify/curve.h"
#include "clients/identify/identified.h"

// ALPHA is c2 where the damper is constant.
enum { KN_JOINT_K1, KN_JOINT_C1, KN_JOINT_ALPHA, KN_JOINT_BETA, KN_JOINT_P0, KN_JOINT_P1, KN_JOINT_NUMBERS };
#define KN_JOINT_OUTLIERS 64

typedef struct kn_joint_outlier {
    int curve, reading, line; // of its file
    double deviations;        // of the noise
} kn_joint_outlier;

typedef struct kn_joint {
    kn_material material;
    kn_identified number[KN_JOINT_NUMBERS];
    double lowest_pa, highest_pa; // stresses that were measured under load
    double rms[KN_CURVES_MAX];    // of the residuals of one reading of each curve, strain; a mean's count by its weight
    double runs[KN_CURVES_MAX];   // kn_fit_runs of each
    double late_s[KN_CURVES_MAX]; // how much later than its file says a load came; 0 unless asked for
    double held_s[KN_CURVES_MAX]; // and how much longer it stayed: its release was late by late_s + held_s
    int readings, unknowns, outliers;
    kn_joint_outlier outlier[KN_JOINT_OUTLIERS];
    double sum, scale;
    double alpha_beta; // correlation of these two
    long evaluations;
} kn_joint;

typedef struct kn_joint_options {
    double confidence; // 0.95
    bool late;         // each curve's load may have come and gone at other times than its file says: fitted, too
    bool no_intervals; // values alone
} kn_joint_options;

// False: no memory, or no start from which the model could be computed; then joint is not to be used.
bool kn_joint_fit(kn_joint *joint, int curves, const kn_curve *curve, const kn_joint_options *options);

// Puts the loads where they were found to have come and gone: time counts from there, as a curve's does, and readings
// from before it are dropped (outliers keep their lines, not their places). So that all that follows says the same.
void kn_joint_settle(const kn_joint *joint, int curves, kn_curve *curve);

// The strain that a material makes of a curve's loads at its readings. False: absurd numbers.
bool kn_joint_predict(const kn_material *material, const kn_curve *curve, double *strain);

// The stress at each reading, by equation 4 from what was measured; 0 after the load.
void kn_joint_stress(const kn_curve *curve, double *stress_pa);

// Nominal stress at a time; 0 before the first load and after the last.
double kn_joint_load(const kn_curve *curve, double time_s);
double kn_joint_release(const kn_curve *curve); // when the last load was taken off; INFINITY: it never was

#endif
