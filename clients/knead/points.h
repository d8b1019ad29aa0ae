#ifndef KN_CLIENTS_POINTS_H
#define KN_CLIENTS_POINTS_H
// The three named points of a sweep as the `quality` of its scene's file, the rest of which stays byte for byte.
//
// A point says the five numbers of the solver, and where the scene's point in force has a precision or a spacing of its
// own, that too: the points were found on that lattice, and a server that changes between points keeps it.
#include "clients/knead/front.h"

// Whether the file can be exchanged, before any work. An exit code, after a complaint.
int kn_points_try(const kn_plan *plan);
int kn_points_write(const kn_plan *plan, const kn_row *const named[KN_QUALITY_OWN]);

#endif
