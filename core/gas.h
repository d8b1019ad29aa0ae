#ifndef KN_CORE_GAS_H
#define KN_CORE_GAS_H
// What the gas in a model's cells does to its nodes (cell.h), at given places: for solvers that are explicit in it.
#include "core/model.h"

// Adds (P - P0) dV/dx of every cell, each at its own pressure or all at that of the sum, to f. rest, x, f: 3 per node,
// in the order of their ids; x is the displacement, m. Wants model->cells. Real-time safe.
void kn_gas_push(const kn_model *model, const double *rest, const double *x, double *f);

// Corners of cell c at rest + x; its volume, m^3, and dV/dx of each corner, m^2.
void kn_gas_corners(const kn_model *model, int c, const double *rest, const double *x, double corner[8][3]);
double kn_gas_volume(const kn_model *model, const double corner[8][3], double gradient[8][3]);

#endif
