#ifndef KN_CLIENTS_IDENTIFY_FIT_H
#define KN_CLIENTS_IDENTIFY_FIT_H
// Least squares within bounds, and how well the data know what was found.
//
//     min over v of  S(v) = sum r_i(v)^2,      r_i = (model_i(v) - measured_i)/sigma_i                         (1)
//
// Sought are the logarithms of positive unknowns: moduli span decades, and one step size, one idea of "near", serve all
// of them. The work is MINPACK's Levenberg-Marquardt (cminpack, lmder). A bound is a wall: the model never sees a value
// beyond it, and what the search wants beyond it costs extra.
//
// The scale of the residuals is taken from the fit, s^2 = S/(n - p), so sigma_i need only be right up to a factor.
// Intervals, of one unknown at a time, the others free:
//
//     curvature   ln v +- t s sqrt(C_ii), C = (J'J)^-1, t of Student's distribution with n - p degrees of freedom
//     profile     where S, minimised over all other unknowns, has risen by t^2 s^2; a side where it never does is open
//
// They are 95 % intervals if the model is right and the noise independent. Whether that is so, kn_fit_runs asks.
//
// Not thread safe for one kn_fit; several fits may run at once. Allocates.
#include <stdbool.h>
#include <stddef.h>

#define KN_FIT_UNKNOWNS 70 // the papers' six, and two for each of KN_CURVES_MAX curves

typedef struct kn_fit_unknown {
    const char *name;
    double value;     // in: start. out: best
    double low, high; // bounds; 0 < low unless linear
    bool linear;      // sought itself, not its logarithm
    bool fixed;       // stays at value
    bool at_bound;    // out: it wanted to go farther
} kn_fit_unknown;

typedef struct kn_fit {
    int unknowns;
    kn_fit_unknown unknown[KN_FIT_UNKNOWNS];
    int readings; // n > unknowns
    // Residuals at these values, all within their bounds. False: the model has no answer there.
    bool (*misfit)(void *of, const double value[KN_FIT_UNKNOWNS], double *residual);
    void *of;
    // of kn_fit_run:
    double sum;                                          // S at the best
    double scale;                                        // s; INFINITY without degrees of freedom
    int freedom;                                         // n - p
    long evaluations;                                    // of misfit, so far
    double covariance[KN_FIT_UNKNOWNS][KN_FIT_UNKNOWNS]; // C, of logarithms; a fixed one's row is 0
    bool singular; // J'J has no inverse: a combination of unknowns changes nothing
} kn_fit;

// From the unknowns' values to the best near them. False: no memory, or no answer at the start.
bool kn_fit_run(kn_fit *fit);

// The best of several starts, each of them all unknowns' values.
bool kn_fit_run_from(kn_fit *fit, int starts, const double (*start)[KN_FIT_UNKNOWNS]);

double kn_fit_sum(kn_fit *fit, const double value[KN_FIT_UNKNOWNS]); // S there; NAN: no answer

typedef enum kn_fit_how { KN_FIT_CURVATURE, KN_FIT_PROFILE } kn_fit_how;

typedef struct kn_fit_interval {
    kn_fit_how how;
    double low, high;         // of the value itself
    bool open_low, open_high; // the data do not close that side; low or high is then the bound
} kn_fit_interval;

// confidence: 0.95. By curvature where that is within 5 % of the value, else by profile.
kn_fit_interval kn_fit_interval_of(kn_fit *fit, int unknown, double confidence);
kn_fit_interval kn_fit_interval_by(kn_fit *fit, int unknown, double confidence, kn_fit_how how);

// S with that unknown held at a value and the others free, started from the best; NAN: no answer.
double kn_fit_held(const kn_fit *fit, int unknown, double value);

// Wald and Wolfowitz's runs test of residuals in the order of time: how many standard deviations fewer runs of one sign
// there are than in independent noise, > 3: the model bends otherwise than the data. NAN below 20 readings.
double kn_fit_runs(int readings, const double *residual);

// Akaike's criterion for small samples, up to a constant of the data: lower is better supported. INFINITY where there
// are too few readings for so many unknowns.
double kn_fit_aicc(int readings, int unknowns, double sum);

double kn_fit_student(double confidence, double freedom); // two-sided quantile t

#endif
