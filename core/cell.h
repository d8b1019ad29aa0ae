#ifndef KN_CORE_CELL_H
#define KN_CORE_CELL_H
// Gas-filled cells: they keep an object's volume, which edges alone do not.
//
// A cell is a cube of the lattice, a square times the thickness in a flat object, or an element of a mesh. It is closed
// and holds a gas at constant temperature. At rest the gas has the pressure P0 of the outside. In general P V = P0 V0
// (Boyle), and node i of the cell feels
//
//     f_i = (P - P0) dV/dx_i                     energy  P0 (V - V0) - P0 V0 ln(V/V0)
//
// For a flat cell this is the first paper's (element.h) "(P - P0) l/2 on both ends of a side". V is the volume of the
// body whose faces are the bilinear patches of their four corners. It equals the volume of 24 tetrahedra that stand
// over four triangles about the centre of each face. So V does not depend on a choice of diagonals, and volumes of
// neighbours add up.
//
//     P/P0   |\                         Below J = V/V0 = 0.1 the law goes on as a straight line. A cell that a step has
//        10  | o                        turned inside out is then pushed back by a finite force.
//            |   ` .
//         1  |          - - o - _ _ _
//            +--------------+---------> J
//            0  0.1         1
//
// With one pressure for the whole object, V and dV/dx are summed over its cells.
//
// The implicit step takes the pressure at the end of the step and leaves out the second derivative of V (Gauss-Newton).
// It adds dt (-dP/dV) G G^T with G = dV/dx to the matrix: one rank-one block per cell, never an indefinite one. The
// omitted term is dt |P - P0| h, below 1 % of an edge's dashpot at 1 ms.
//
// Pressure does not resist shear. If the lattice has no diagonals, or diagonals below 0.01 of the sides' stiffness,
// rounding errors determine its shape.
#include "core/grid.h"

typedef enum kn_pressure {
    KN_PRESSURE_NONE,  // the object is open: air flows in and out, so there is no gas pressure
    KN_PRESSURE_CELLS, // each cell is closed and has a gas pressure of its own
    KN_PRESSURE_OBJECT // one closed skin surrounds all cells, so they share one gas pressure
} kn_pressure;

typedef struct kn_cell {
    // Ids of the cell's corner nodes. The corner at (dx, dy, dz) = 0 or 1 along each axis has the index dx + 2 dy + 4
    // dz. A flat cell uses the index dx + 2 dz, and its last four ids are -1. A mesh element keeps its own order of
    // corners.
    int corner[8];
} kn_cell;

// ratio V/V0 of a cell's volume to its volume at rest, below which the pressure law is a straight line
#define KN_CELL_LEAST 0.1

// List every cell of a block in out[], x fastest, then y, then z, and return the number of cells. If out is NULL, only
// count them. The caller owns out[].
int kn_grid_cells(const kn_grid *g, kn_cell *out);

// Return the volume of a cell of a block, m^3; a cell that is inside out has a negative volume. Store the derivative of
// the volume with respect to each corner's position, m^2. The corners of a flat cell move in x and z only. This and the
// functions below are real-time safe.
double kn_cell_volume(const kn_grid *g, const double corner_m[8][3], double gradient_m2[8][3]);

// Return the volume of an element of a mesh, m^3, and store its derivatives, m^2, as kn_cell_volume does for a block.
// The element is a triangle of thickness depth_m if depth_m > 0, else a tetrahedron.
double kn_simplex_volume(double depth_m, const double corner_m[8][3], double gradient_m2[8][3]);

// Return the relative overpressure (P - P0)/P0 of a gas whose volume is J = V/V0 times its volume at rest. Store the
// slope -d(P/P0)/dJ, which is positive, in *slope.
double kn_cell_pressure(double j, double *slope);

#endif
