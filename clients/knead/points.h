#ifndef KN_CLIENTS_POINTS_H
#define KN_CLIENTS_POINTS_H
// Writer of quality points. A quality point is a named set of solver settings in the `quality` block of a scene file. A
// sweep finds three of them. All other bytes of the file stay unchanged.
//
// A quality point states the five numbers of the solver. If the scene's active quality point states a precision or a
// spacing, the new points state it too. The new points were found on the lattice of that spacing, and a server that
// changes between quality points keeps its lattice.
#include "clients/knead/front.h"

// Check that the scene file can be replaced. Call this before the sweep. Return 0, or print an error message and return
// an exit code.
int kn_points_try(const kn_plan *plan);
// Write the named quality points into the scene file. Return 0, or print an error message and return an exit code.
int kn_points_write(const kn_plan *plan, const kn_row *const named[KN_QUALITY_OWN]);

#endif
