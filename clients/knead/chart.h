#ifndef KN_CLIENTS_CHART_H
#define KN_CLIENTS_CHART_H
// A front for people: the table on a terminal, the picture.
#include "clients/knead/front.h"

void kn_chart_print(const kn_front *front, const kn_plan *plan, const kn_row *const named[KN_QUALITY_OWN]);

// Time of a tick against the error of force and of shape that the solver leaves, with each lattice's front, and against
// the error of force with step and lattice, with the front of all; by gnuplot. An exit code.
int kn_chart_draw(const kn_front *front, const kn_plan *plan, const kn_row *const named[KN_QUALITY_OWN],
                  const char *path);

#endif
