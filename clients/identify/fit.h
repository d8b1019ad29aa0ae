#ifndef KN_CLIENTS_IDENTIFY_FIT_H
#define KN_CLIENTS_IDENTIFY_FIT_H
// Least squares within bounds, and intervals that state how well the data determine the unknowns. S is the sum of
// squares, n the number of readings, p the number of unknowns, J the Jacobian of the residuals r, s the scale of the
// residuals.
//
//     min over v of  S(v) = sum r_i(v)^2,      r_i = (model_i(v) - measured_i)/sigma_i                         (1)
//
// The search runs over the logarithms of positive unknowns. Moduli span decades, and in logarithms one step size and
// one notion of "near" serve all of them. The method is MINPACK's Levenberg-Marquardt (cminpack, lmder). The model is
// never evaluated outside the bounds. If the search goes beyond a bound, the model is evaluated at the bound, and an
// extra residual pushes the search back.
//
// The scale of the residuals is taken from the fit, s^2 = S/(n - p), so sigma_i need only be right up to a common
// factor. Intervals are for one unknown at a time, with the others free:
//
//     curvature   ln v +- t s sqrt(C_ii), C = (J'J)^-1, t of Student's distribution with n - p degrees of freedom
//     profile     where S, minimised over all other unknowns, has risen by t^2 s^2; if S never rises that far on a
//                 side, that side is open
//
// The intervals have the stated confidence if the model is right and the noise is independent. kn_fit_runs tests for
// both.
//
// A kn_fit is not thread safe; several fits may run at once. The functions allocate memory.
#include <stdbool.h>
#include <stddef.h>

#define KN_FIT_UNKNOWNS 70 // six parameters of the papers' element, and two unknowns for each of KN_CURVES_MAX curves

typedef struct kn_fit_unknown {
    const char *name;
    double value;     // in: start; out: best
    double low, high; // bounds; 0 < low unless linear
    bool linear;      // the search uses the value itself, not its logarithm
    bool fixed;       // stays at value
    bool at_bound;    // out: the search wanted to go beyond the bound
} kn_fit_unknown;

typedef struct kn_fit {
    int unknowns;
    kn_fit_unknown unknown[KN_FIT_UNKNOWNS];
    int readings; // n; must exceed the number of unknowns
    // Compute the residuals at these values, which are all within their bounds. Return false if the model has no
    // solution there.
    bool (*misfit)(void *of, const double value[KN_FIT_UNKNOWNS], double *residual);
    void *of;
    // Set by kn_fit_run:
    double sum;       // S at the best values
    double scale;     // s; INFINITY without degrees of freedom
    int freedom;      // n - p
    long evaluations; // calls of misfit so far
    // C, the covariance of the logarithms divided by s^2; the row of a fixed unknown is 0
    double covariance[KN_FIT_UNKNOWNS][KN_FIT_UNKNOWNS];
    bool singular; // J'J has no inverse: some combination of unknowns changes nothing
} kn_fit;

// Search from the unknowns' values for the best values nearby. Return false if memory runs out, or if the model has no
// solution at the start.
bool kn_fit_run(kn_fit *fit);

// Run the fit from several starts and keep the best result. Each start holds the values of all unknowns. Return false
// if no start succeeds.
bool kn_fit_run_from(kn_fit *fit, int starts, const double (*start)[KN_FIT_UNKNOWNS]);

double kn_fit_sum(kn_fit *fit, const double value[KN_FIT_UNKNOWNS]); // S at these values; NAN: no solution

typedef enum kn_fit_how { KN_FIT_CURVATURE, KN_FIT_PROFILE } kn_fit_how;

typedef struct kn_fit_interval {
    kn_fit_how how;
    double low, high;         // of the value itself
    bool open_low, open_high; // the data do not limit this side; `low` or `high` is then the bound of the unknown
} kn_fit_interval;

// Return the interval at a confidence such as 0.95. The method is curvature if that interval lies within 5 % of the
// value, else profile. kn_fit_interval_by uses the given method.
kn_fit_interval kn_fit_interval_of(kn_fit *fit, int unknown, double confidence);
kn_fit_interval kn_fit_interval_by(kn_fit *fit, int unknown, double confidence, kn_fit_how how);

// Return S with one unknown held at a value and the others free, by a search that starts from the best values. Return
// NAN if there is no solution.
double kn_fit_held(const kn_fit *fit, int unknown, double value);

// Wald and Wolfowitz's runs test of residuals in the order of time. A run is a row of residuals of one sign. Return by
// how many standard deviations there are fewer runs than in independent noise. Above 3, the model has another shape
// than the data. Return NAN if there are fewer than 20 readings.
double kn_fit_runs(int readings, const double *residual);

// Return Akaike's criterion for small samples (AICc), up to a constant that depends only on the data. A lower value
// means a better supported model. Return INFINITY if there are too few readings for so many unknowns.
double kn_fit_aicc(int readings, int unknowns, double sum);

double kn_fit_student(double confidence, double freedom); // two-sided quantile t

#endif
