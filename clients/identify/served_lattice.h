#ifndef KN_CLIENTS_IDENTIFY_SERVED_LATTICE_H
#define KN_CLIENTS_IDENTIFY_SERVED_LATTICE_H
// The material of a lattice that creeps as the specimen did. The parameters of the element (creep_fit.h) are those of one
// edge. A lattice of such edges creeps otherwise, because its edges turn, stretch and share the load unevenly. Here the
// same six parameters are fitted so that the lattice itself, under a level plate on a table without friction, repeats
// the measured curves.
//
// A run of the lattice takes seconds, one of the affine block (affine_block.h) milliseconds, and the two differ by
// little, because the plate holds the top. So the search runs on the block, and the lattice corrects it
// (space mapping):
//
//     measured  =  block(p) + lattice(q) - block(q)                q: parameters of the last round
//
// Each round fits p to all readings, and then takes p as the next q. The first round has no correction. The result is the
// round whose lattice is nearest to the readings.
#include "clients/identify/affine_block.h"
#include "clients/identify/creep_fit.h"

#define KN_SERVED_CELLS 3 // cells of the lattice along each side of the specimen

typedef struct kn_served_lattice {
    kn_affine_structure structure;
    kn_material material;                              // parameters of the lattice's edges
    kn_parameter_estimate number[KN_ESTIMATE_NUMBERS]; // the same, with intervals by the curvature of the last round
    // root mean square difference between the lattice's strain and the readings of each curve, as a share of the
    // largest measured strain; before: with the parameters of the element, and of the block in place of the lattice
    double left[KN_CURVES_MAX], before[KN_CURVES_MAX];
    int rounds;
} kn_served_lattice;

// Fit the parameters, beginning with those of the element, which the same curves gave. `subcommand` names the progress bar. Return false if memory
// is short, or if no lattice of this structure repeats the curves at all.
bool kn_served_lattice_fit(kn_served_lattice *served, const char *subcommand, const kn_affine_structure *structure,
                           int curves, const kn_curve *curve, const kn_creep_fit *element);

#endif
