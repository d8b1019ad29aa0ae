#ifndef KN_CLIENTS_IDENTIFY_PROFILE_INTERVAL_H
#define KN_CLIENTS_IDENTIFY_PROFILE_INTERVAL_H
// Profile intervals (least_squares.h) of a model whose evaluation is slow, and accurate to about 1e-4 (kn_fit.coarse):
// each end takes some ten evaluations instead of some hundred. The unknown is moved outwards in strides. The others
// follow by the model linearised about the last evaluation, with slopes that every evaluation corrects (Broyden, Math.
// Comput. 19, 577, 1965). Along a flat valley they stay near where the last stride predicts them. The ends of all
// unknowns are searched at once, each in a thread.
#include "clients/identify/least_squares.h"

// An end of an interval that is this factor away from the best value counts as open.
#define KN_PROFILE_FAR 100

// Find the intervals of the first `count` unknowns of a fit that kn_fit_run has made, with a jacobian and a misfit that
// several threads may call. residual: at the best values; scale: of the residuals. Return 1; 0 if values with a better
// sum were met, which are then in fit->unknown (the intervals are those of the old values); -1 if memory runs out.
int kn_profile_run(kn_fit *fit, const double *residual, double scale, int count, kn_fit_interval *interval);

#endif
