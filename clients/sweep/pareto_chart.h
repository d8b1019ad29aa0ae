#ifndef KN_CLIENTS_PARETO_CHART_H
#define KN_CLIENTS_PARETO_CHART_H
// Table and picture of the Pareto front of a sweep (pareto_front.h).
#include "clients/sweep/pareto_front.h"

void kn_pareto_chart_print(const kn_pareto_front *front, const kn_sweep_plan *plan,
                           const kn_pareto_row *const named[KN_QUALITY_OWN]);

// Draw the time of a tick against three errors with gnuplot: the solver's error of force, the solver's error of shape,
// and the total error of force, which includes time step and lattice. The first two panels show the Pareto front of
// each lattice. The third panel shows the Pareto front of all lattices. Return an exit code.
int kn_pareto_chart_draw(const kn_pareto_front *front, const kn_sweep_plan *plan,
                         const kn_pareto_row *const named[KN_QUALITY_OWN], const char *path);

#endif
