#ifndef KN_CLIENTS_IDENTIFY_CREEP_FIGURES_H
#define KN_CLIENTS_IDENTIFY_CREEP_FIGURES_H
// What of an identification by creep is for eyes. Both draw one PNG and return an exit code.
#include "clients/identify/curve.h"
#include "clients/identify/joint.h"

// The first paper's figures 6 to 9 of one curve that was released, each beside what was identified:
//
//     6  displacement (strain where the height is unknown)      7  stress, by its equation 4
//     8  what came back, with its equation 5                    9  the damper by its two stages, with its law
//
// Of a curve that was never released, or is too short for the two stages, 6 and 7 alone.
int kn_creep_figures_paper(const char *subcommand, const char *path, const kn_curve *curve, const kn_joint *joint);

// All curves: strain with the fit, on linear and on logarithmic axes; what is left, means of neighbours over their own
// standard deviation by the noise; the damper law over the stresses that were measured, with what the two stages make
// of each curve.
int kn_creep_figures_fits(const char *subcommand, const char *path, int curves, const kn_curve *curve,
                          const kn_joint *joint);

#endif
