#ifndef KN_CORE_CELL_H
#define KN_CORE_CELL_H
// Cells filled with gas: what keeps an object's volume, which edges alone do not.
//
// A cell is a cube of the lattice, of a flat object a square times its thickness, of a mesh an element; it is closed
// and holds a gas at constant temperature. At rest it has the pressure P0 of the outside; then P V = P0 V0 (Boyle), and
// node i of the cell feels
//
//     f_i = (P - P0) dV/dx_i                     energy  P0 (V - V0) - P0 V0 ln(V/V0)
//
// which for a flat cell is the first paper's "(P - P0) l/2 on both ends of a side". V is that of the body whose faces
// are the bilinear patches of their four corners: exactly 24 tetrahedra, over four triangles about the centre of each
// face, so it does not depend on which diagonal is taken, and volumes of neighbours add up.
//
//     P/P0   |\                         below J = V/V0 = 0.1 the law goes on straight, so that a cell which a step has
//        10  | o                        turned inside out is pushed back by a finite force
//            |   ` .
//         1  |          - - o - _ _ _
//            +--------------+---------> J
//            0  0.1         1
//
// One pressure for the whole object takes the sums of V and of dV/dx over its cells.
//
// The implicit step takes the pressure at its end without the second derivative of V (Gauss-Newton): it adds
// dt (-dP/dV) G G^T to the matrix, G = dV/dx, one rank-one block per cell, and never an indefinite one. What is left
// out is dt |P - P0| h, below 1 % of an edge's dashpot at 1 ms.
//
// Pressure does not resist shear: without diagonals, or with ones below 0.01 of the sides' stiffness, the shape is
// decided by rounding.
#include "core/grid.h"

typedef enum kn_pressure {
    KN_PRESSURE_NONE,  // the object is open: air goes in and out
    KN_PRESSURE_CELLS, // each cell is closed
    KN_PRESSURE_OBJECT // one closed skin around all cells
} kn_pressure;

typedef struct kn_cell {
    int corner[8]; // node ids: dx + 2 dy + 4 dz; of a flat cell dx + 2 dz, then -1; a mesh's in its element's order
} kn_cell;

#define KN_CELL_LEAST 0.1 // V/V0 from which on the law goes straight

// Fills out[] (NULL: only counts) with every cell; returns their number. Fixed order.
int kn_grid_cells(const kn_grid *g, kn_cell *out);

// Volume, m^3, < 0 inside out, and its derivative by each corner, m^2. A flat cell's corners move in x and z only.
double kn_cell_volume(const kn_grid *g, const double corner_m[8][3], double gradient_m2[8][3]);

// The same of a tetrahedron, or, when depth_m > 0, of a flat triangle that thick.
double kn_simplex_volume(double depth_m, const double corner_m[8][3], double gradient_m2[8][3]);

// (P - P0)/P0 at J = V/V0; *slope becomes -d(P/P0)/dJ, > 0.
double kn_cell_pressure(double j, double *slope);

#endif
