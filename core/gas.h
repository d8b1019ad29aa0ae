#ifndef KN_CORE_GAS_H
#define KN_CORE_GAS_H
// Gas forces on the nodes of a model (cell.h) at given positions, for solvers that treat the gas explicitly.
#include "core/model.h"

// Add (P - P0) dV/dx of every cell to f. Each cell has its own pressure, or all cells have one pressure, which follows
// from their total volume. `rest` (rest positions), `x` (displacements, m) and
// `f` (forces) have 3 values per node, in the order of node ids.
// Needs model->cells. Real-time safe.
void kn_gas_push(const kn_model *model, const double *rest, const double *x, double *f);

// kn_gas_corners stores the corners of cell c at rest + x. kn_gas_volume returns a cell's volume, m^3, and stores dV/dx
// of each corner, m^2.
void kn_gas_corners(const kn_model *model, int c, const double *rest, const double *x, double corner[8][3]);
double kn_gas_volume(const kn_model *model, const double corner[8][3], double gradient[8][3]);

#endif
