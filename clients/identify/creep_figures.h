#ifndef KN_CLIENTS_IDENTIFY_CREEP_FIGURES_H
#define KN_CLIENTS_IDENTIFY_CREEP_FIGURES_H
// Plots for `knead identify creep`. Both functions draw one PNG and return an exit code.
#include "clients/identify/curve.h"
#include "clients/identify/joint.h"

// Draw the first paper's figures 6 to 9 for one curve whose load was removed, with the identified element beside the
// data:
//
//     6  displacement (strain where the height is unknown)      7  stress, by its equation 4
//     8  recovered strain, with its equation 5                  9  the damper by its two stages, with its law
//
// Only figures 6 and 7 are drawn if the load was never removed, or if the curve is too short for the paper's two stages
// (stages.h).
int kn_creep_figures_paper(const char *subcommand, const char *path, const kn_curve *curve, const kn_joint *joint);

// Draw all curves in one picture. The first panels show the strain with the fit, on linear and on logarithmic axes. One
// panel shows the residuals: means of neighbours, divided by the standard deviation that the noise gives such a mean.
// The last panel shows the damper law over the measured stresses, with each curve's result of the two stages.
int kn_creep_figures_fits(const char *subcommand, const char *path, int curves, const kn_curve *curve,
                          const kn_joint *joint);

#endif
