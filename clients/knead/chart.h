#ifndef KN_CLIENTS_CHART_H
#define KN_CLIENTS_CHART_H
// Table and picture of the Pareto front of a sweep (front.h).
#include "clients/knead/front.h"

void kn_chart_print(const kn_front *front, const kn_plan *plan, const kn_row *const named[KN_QUALITY_OWN]);

// Draw the time of a tick against three errors with gnuplot: the solver's error of force, the solver's error of shape,
// and the total error of force, which includes time step and lattice. The first two panels show the Pareto front of
// each lattice. The third panel shows the Pareto front of all lattices. Return an exit code.
int kn_chart_draw(const kn_front *front, const kn_plan *plan, const kn_row *const named[KN_QUALITY_OWN],
                  const char *path);

#endif
