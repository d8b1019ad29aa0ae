#ifndef KN_CORE_SOLVE_COARSE_H
#define KN_CORE_SOLVE_COARSE_H
// The coarse level of the preconditioner, beside the 3 x 3 blocks of the nodes.
//
//     z = P r + T Ac^-1 T'r          Ac = T'A T of the lattice at rest
//
// The blocks P move every node by itself, so an error that is smooth over the object falls slowly: the more nodes, the
// more iterations. T interpolates the velocities of a few coarse nodes, a box grid over the undeformed object, to all
// nodes. Ac is computed and inverted when the model is built, and stays: to compute it takes as many products with A as
// it has columns, 50 ms at 16 820 nodes. A body that has rolled over gets a worse preconditioner, never a wrong result.
//
// The residual is judged without the coarse level, so that `tolerance` has the same meaning with and without the coarse
// level.
#include "core/solve/kernel.h"

// Choose the coarse nodes of a model before its nodes and tables are built. A model whose coarse level would not pay
// has none: model->coarse stays NULL. Return false if memory is short.
bool kn_coarse_plan(kn_model *model);

// Return the place of x_m along an axis, counted in coarse nodes, within the grid of coarse nodes. `c` counts from the
// same point as x_m.
double kn_coarse_place(const kn_coarse *c, int axis, double x_m);

// Find the cell of coarse nodes that contains a place of the undeformed object: the number of its lowest corner along
// x, y, z, and the place in the cell, 0 to 1.
void kn_coarse_cell(const kn_coarse *c, const double x_m[3], int cell[3], double place[3]);

// Compute and invert Ac once the model is complete. Return false if memory is short.
bool kn_coarse_build(kn_model *model);
void kn_coarse_destroy(kn_coarse *coarse); // does nothing if `coarse` is NULL

// Return the number of reals of kn_work.coarse.
size_t kn_coarse_reals(const kn_model *model);
// Return the memory that the coarse level takes in addition to the model [bytes].
size_t kn_coarse_bytes(const kn_model *model);

#endif
