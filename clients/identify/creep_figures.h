#ifndef KN_CLIENTS_IDENTIFY_CREEP_FIGURES_H
#define KN_CLIENTS_IDENTIFY_CREEP_FIGURES_H
// Plots for `knead identify creep`. Both functions draw one PNG. They return 0, or print an error and return an exit
// code.
#include "clients/identify/curve.h"
#include "clients/identify/creep_fit.h"

// Draw figures 6 to 9 of the first paper for one creep curve whose load was removed. Each figure shows the identified
// element beside the data:
//
//     6  displacement, or strain if the specimen's height is unknown    7  stress, by the paper's equation 4
//     8  recovered strain, with the paper's equation 5                  9  damping c2 by the paper's two stages,
//                                                                          with the fitted law c2(P)
//
// If the load was never removed, or if the curve is too short for the paper's two stages (creep_fit.h), only figures 6 and
// 7 are drawn.
int kn_creep_figures_paper(const char *subcommand, const char *path, const kn_curve *curve, const kn_creep_fit *joint);

// Draw all creep curves in one picture. The first panels show the strain with the fit, on linear and on logarithmic
// axes. The next panel shows the residuals: means over neighbouring readings, each divided by the standard deviation
// that noise gives to a mean of so many readings. The last panel shows the damper law c2(P) over the measured stresses,
// with each curve's result of the paper's two stages (creep_fit.h).
int kn_creep_figures_fits(const char *subcommand, const char *path, int curves, const kn_curve *curve,
                          const kn_creep_fit *joint);

#endif
