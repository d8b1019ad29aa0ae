#ifndef KN_CLIENTS_IDENTIFY_CREEP_REPORT_H
#define KN_CLIENTS_IDENTIFY_CREEP_REPORT_H
// The plots and the page of `knead identify creep`. The functions that return int return 0, or print an error and return
// an exit code.
#include "clients/identify/identify.h"

// Draw all creep curves in one PNG. The first panels show the strain with the fit, on linear and on logarithmic axes.
// The next panel shows the residuals: means over neighbouring readings, each divided by the standard deviation that
// noise gives to a mean of so many readings. The last panel shows the damper law c2(P) over the measured stresses, with
// each curve's result of the paper's two stages (creep_fit.h).
int kn_creep_draw(kn_identification *w, const char *path);

// Fill an open page: all printed results with plots, and for the first curves figures 6 to 9 of the first paper. If
// w->served, the page's folder must already hold material.yaml. Otherwise the page omits the validation.
int kn_creep_report(kn_document *d, kn_identification *w);

// Add the section that checks the identified material in two ways (creep_validation.c). First, its creep under the loads
// of the measured curves is computed in three ways and compared with the data: for one element, integrated to a
// tolerance (core/network.h), and for two blocks of cells (lattices with diagonals and with gas), stepped by the solver
// of kneadd. Second, a block of the material is pressed as in the first paper, section 5: the plate moves 1 cm down at
// 1 cm/s, stays for 30 s, and moves up again. The runs take seconds and show progress bars.
//
// The edges of a lattice turn as the block is compressed, whereas an element has no directions. A block of sides and
// diagonals alone yields like a mechanism (dough: the strain is 12 % off under 10 gf, 1.6 times the element's strain
// under 30 gf, 1.8 times under 50 gf). In a block with gas in its cells the volume stays constant, as equation 4 of the
// first paper supposes. Such a block is stiffer than the element (0.87 times the element's strain under 30 gf, 0.61
// times under 50 gf). The page states these differences.
int kn_creep_validation(kn_document *d, const kn_identification *w);

// Compute the deviation of k1, c1, alpha and beta of material `a` from those of `b`, in per cent.
void kn_creep_two_stage_deviation(const kn_material *a, const kn_material *b, double percent[4]);

#endif
