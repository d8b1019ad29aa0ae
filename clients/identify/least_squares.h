#ifndef KN_CLIENTS_IDENTIFY_LEAST_SQUARES_H
#define KN_CLIENTS_IDENTIFY_LEAST_SQUARES_H
// Least squares within bounds, and intervals that state how well the data determine the unknowns. S is the sum of
// squares, n the number of readings, p the number of unknowns, J the Jacobian of the residuals r, and s the scale
// (estimated standard deviation) of the residuals.
//
//     min over v of  S(v) = sum r_i(v)^2,      r_i = (model_i(v) - measured_i)/sigma_i                         (1)
//
// The search runs over the logarithms of positive unknowns. Moduli span decades, and in logarithms one step size and
// one limit of convergence suit all moduli. The method is MINPACK's Levenberg-Marquardt (cminpack, lmder). The model is
// never evaluated outside the bounds. If the search goes beyond a bound, the model is evaluated at the bound, and an
// extra residual pushes the search back.
//
// The scale of the residuals is taken from the fit, s^2 = S/(n - p), so sigma_i need only be right up to a common
// factor. Intervals are for one unknown at a time, with the others free:
//
//     curvature   ln v +- t s sqrt(C_ii), C = (J'J)^-1, t of Student's distribution with n - p degrees of freedom
//     profile     the values at which S, minimised over all other unknowns, has risen by t^2 s^2; if S never rises
//                 that far on one side of the best value, the interval is open on that side
//
// The intervals have the stated confidence if the model is right and the noise is independent. kn_fit_runs tests both
// conditions.
//
// Only one thread at a time may use a kn_fit. Threads may run different fits at once. The functions allocate memory.
#include <stdbool.h>
#include <stddef.h>

// largest number of unknowns: six parameters of the papers' element, and two unknowns for each of KN_CURVES_MAX curves
#define KN_FIT_UNKNOWNS 70

typedef struct kn_fit_unknown {
    const char *name, *unit; // name and unit for messages of the caller; may be NULL
    double value;            // in: start of the search; out: best value
    double low, high;        // bounds of the value; if `linear` is false, `low` must be > 0
    bool linear;             // the search uses the value itself, not its logarithm
    bool fixed;              // the search keeps this unknown at `value`
    bool at_bound;           // out: the best value lies on a bound, and the sum of squares would decrease beyond it
} kn_fit_unknown;

typedef struct kn_fit {
    int unknowns;
    kn_fit_unknown unknown[KN_FIT_UNKNOWNS];
    int readings; // n, the number of readings; must exceed the number of unknowns
    // Callback: compute residual[readings] for the given values of the unknowns, which are all within their bounds.
    // Return false if the model has no solution for these values.
    bool (*misfit)(void *of, const double value[KN_FIT_UNKNOWNS], double *residual);
    void *of; // passed to misfit
    // True: the residuals are accurate to about 1e-4, as those of a lattice are, not to 1e-8. Difference quotients then
    // take steps of 1 %, and the search ends when a step lowers S by less than 0.01 %.
    bool coarse;
    bool concurrent;  // misfit may run in several threads at once: the columns of J are then computed side by side
    double *jacobian; // [unknowns][readings] receives J at the best values; the rows of fixed unknowns are 0; or NULL
    // kn_fit_run sets the following fields.
    double sum;   // sum of squares S at the best values
    double scale; // scale s of the residuals; INFINITY if there are no degrees of freedom
    int freedom;  // degrees of freedom n - p
    // C = (J'J)^-1, the covariance of the searched variables (logarithms, unless linear) divided by s^2; the row of a
    // fixed unknown is 0
    double covariance[KN_FIT_UNKNOWNS][KN_FIT_UNKNOWNS];
    // true: J'J has no inverse (J: Jacobian), since some combination of unknowns does not change the residuals
    bool singular;
} kn_fit;

// Search for the best values near the present values of the unknowns. Return false if memory runs out, or if the model
// has no solution at the start.
bool kn_fit_run(kn_fit *fit);
// Search roughly, for a better start: the search ends when a step lowers S by less than 1 %. Only `sum` is set.
bool kn_fit_search(kn_fit *fit);

// Run the fit from several starts and keep the best result. Each start holds the values of all unknowns. Return false
// if no start succeeds.
bool kn_fit_run_from(kn_fit *fit, int starts, const double (*start)[KN_FIT_UNKNOWNS]);

void kn_fit_values(const kn_fit *fit, double value[KN_FIT_UNKNOWNS]); // copy the values of all unknowns

// Return the variable of the search that belongs to a value: its logarithm unless the unknown is linear.
double kn_fit_inwards(const kn_fit_unknown *unknown, double value);
double kn_fit_squares(const double *residual, int count); // return the sum of squares

double kn_fit_sum(const kn_fit *fit,
                  // return the sum of squares S at `value`; NAN: the model has no solution
                  const double value[KN_FIT_UNKNOWNS]);

typedef enum kn_fit_how { KN_FIT_CURVATURE, KN_FIT_PROFILE } kn_fit_how;

typedef struct kn_fit_interval {
    kn_fit_how how;
    double low, high; // ends of the interval of the unknown's value, not of its logarithm
    // open_low: the data give the unknown no lower limit, and `low` is the lower bound of the search; open_high: the
    // data give no upper limit, and `high` is the upper bound of the search
    bool open_low, open_high;
} kn_fit_interval;

// Return the interval of an unknown at a confidence such as 0.95. If the whole interval by the method "curvature" lies
// within 5 % of the best value, return this interval. Otherwise return the interval by the method "profile".
// kn_fit_interval_by uses the given method.
kn_fit_interval kn_fit_interval_of(const kn_fit *fit, int unknown, double confidence);
kn_fit_interval kn_fit_interval_by(const kn_fit *fit, int unknown, double confidence, kn_fit_how how);

// Return the least sum of squares S if one unknown is held at `value` and all others are free. The search starts from
// the best values. Return NAN if the model has no solution.
double kn_fit_held(const kn_fit *fit, int unknown, double value);

// Fit a straight line x(t) by weighted least squares. Return its slope, or 0 if all times are equal. Set *mean_t and
// *mean_x to the weighted means, through which the line passes. `weight` NULL: all weights are 1.
double kn_line_slope(int count, const double *t, const double *x, const double *weight, double *mean_t, double *mean_x);

// Apply Wald and Wolfowitz's runs test to residuals in the order of time. A run is a series of successive residuals of
// one sign. Return by how many standard deviations the number of runs is below that of independent noise. A result
// above 3 means that the model's curve does not have the shape of the data. Return NAN if there are fewer than 20
// readings.
double kn_fit_runs(int readings, const double *residual);

// Return Akaike's criterion for small samples (AICc), up to a constant that depends only on the data. A lower value
// means a better supported model. `sum` is the sum of squares. Return INFINITY if there are too few readings for so
// many unknowns.
double kn_fit_aicc(int readings, int unknowns, double sum);

double kn_fit_student(double confidence, double freedom); // two-sided quantile t of Student's distribution

#endif
