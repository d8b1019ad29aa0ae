#ifndef KN_CLIENTS_IDENTIFY_AFFINE_BLOCK_H
#define KN_CLIENTS_IDENTIFY_AFFINE_BLOCK_H
// A block of the lattice between two level plates without friction. It deforms affinely: all its cells have the same
// width and height, and the number of cells does not matter. So one cell with two unknowns stands for the whole block,
// and a test that takes seconds on a lattice takes a millisecond.
//
//        |||||  stress P                       k   edges of a cell      number   horizontal, vertical extent
//      =========                               0   sides, vertical        1          0, 1
//       | \ / |   height z (1 at rest)         1   sides, horizontal      2          1, 0
//       |  X  |                                2   diagonals of the       4          1, 1
//       | / \ |                                    vertical faces
//      =========                               3   diagonals of the       2       sqrt 2, 0
//        width x                                   horizontal faces
//                                              4   diagonals of the body  4       sqrt 2, 1
//
// Lengths are in units of a cell's side at rest. The sum of all edges and of the gas gives the two forces that the block
// exerts on its plates (P per area at rest) and on its free sides (0). Each step solves both equations for x and z at
// the end of the step, with the law of core/law.h in each kind of edge and the gas of core/cell.h.
#include "clients/identify/measured_curve.h"
#include "core/law.h"
#include "core/model.h"

typedef struct kn_affine_structure {
    double diagonal; // ratio of a diagonal's stiffness to a side's (object.diagonal_stiffness)
    double gas_pa;   // pressure of the gas in each cell at rest (object.inside_pressure); 0: no gas
} kn_affine_structure;

// Return the structure of a block of the lattice.
static inline kn_affine_structure kn_affine_structure_of(const kn_model_def *def)
{
    return (kn_affine_structure){def->structure == KN_STRUCTURE_DIAGONALS ? def->diagonal_stiffness : 0,
                                 def->pressure != KN_PRESSURE_NONE ? def->inside_pressure_pa : 0};
}

#define KN_AFFINE_EDGES 5

typedef struct kn_affine_block {
    kn_affine_structure structure;
    kn_material material;
    kn_law law;
    double kappa, gamma;            // scales of the edges' stiffness and stress (core/grid.h), for cells of side 1
    double width, height;           // present width and height of the cell
    double strain[KN_AFFINE_EDGES]; // strain u of the Voigt part of each kind of edge (core/law.h)
    double stress_pa;               // present force on the plate per area at rest; > 0: compression
} kn_affine_block;

// Make a block at rest.
void kn_affine_block_init(kn_affine_block *block, const kn_material *material, const kn_affine_structure *structure);

// Advance by dt_s under a weight (stress_pa, force per area at rest), or between plates that end the step at `height`.
// Return false if the step has no solution, e.g. because the weight squeezes the block flat; the block is then
// undefined.
bool kn_affine_block_load(kn_affine_block *block, double dt_s, double stress_pa);
bool kn_affine_block_press(kn_affine_block *block, double dt_s, double height);

// Compute the strain, 1 - height, of a block under a curve's loads, at `count` rising times. A block that is squeezed
// flat keeps the strain 1. Return false if the material cannot be simulated.
bool kn_affine_block_creep(const kn_affine_structure *structure, const kn_material *material, const kn_curve *curve,
                           int count, const double *time_s, double *strain);

#endif
