#ifndef KN_CLIENTS_IDENTIFY_SERVED_LATTICE_H
#define KN_CLIENTS_IDENTIFY_SERVED_LATTICE_H
// The material of a lattice that creeps as the specimen did. The parameters of the element (creep_fit.h) are those of one
// edge. A lattice of such edges creeps otherwise, because its edges turn, stretch and share the load unevenly. Here the
// same six parameters are fitted so that the lattice itself, under a level plate on a table without friction, repeats
// the measured curves. The result holds for the spacing of that lattice: at large strains, coarse cells fold together
// under less weight than fine ones (with the same numbers, 90 gf strain cells of 5 mm by 18 % more than cells of 3.3 mm).
//
// A run of the lattice takes seconds, one of the affine block (affine_block.h) milliseconds, and the two differ by
// little, because the plate holds the top. So the search begins with a fit of the block. Then each round runs the
// lattice, and a Gauss-Newton step follows from its residuals and the block's slopes. No number changes by more than a
// factor of 2 in a step. A step that makes the lattice worse is taken back, and the next one is shorter. The result is
// the best round.
#include "clients/identify/affine_block.h"
#include "clients/identify/creep_fit.h"

// ---- the unknowns of a lattice's material
//
// The first KN_ESTIMATE_NUMBERS unknowns of a fit are k1, c1, alpha, beta, P0, and P1 - P0, so that P1 stays above P0. With
// a constant damper they are k1, c1, c2, and three fixed ones.

// Return the material with these unknowns. P1 is lowered if need be, so that kneadd and the circuit can step the damper.
kn_material kn_lattice_material(const double value[KN_FIT_UNKNOWNS], bool constant);
// Set the unknowns to a material. P1 is bounded by the largest stress in the curves.
void kn_lattice_unknowns(kn_fit *fit, const kn_material *material, double highest_pa);
// Run the fit. If some combination of the unknowns does not change the curves, hold P1; if that is not enough, hold P0 too.
bool kn_lattice_fit(kn_fit *fit);
// Store the parameters with their 95 % intervals: interval[], or by curvature if it is NULL. `material`: that of the best
// values. With a constant damper, the parameters of a force-dependent one are left as they are.
void kn_lattice_numbers(kn_parameter_estimate number[KN_ESTIMATE_NUMBERS], const kn_fit *fit,
                        const kn_material *material, const kn_fit_interval *interval);

// ---- a lattice that creeps as the specimen did

#define KN_SERVED_CELLS_MAX 8 // along each side of the specimen

typedef struct kn_served_lattice {
    kn_affine_structure structure;
    int cells[2];                                      // cells of the lattice along the specimen's width and height
    double spacing_m;                                  // side of a cell
    const kn_model_def *object;                        // take edges and gas from this block; NULL: from `structure`
    kn_material material;                              // parameters of the lattice's edges
    kn_parameter_estimate number[KN_ESTIMATE_NUMBERS]; // the same, with intervals by the curvature of the last round
    // root mean square difference between the lattice's strain and the readings of each curve, as a share of the
    // largest measured strain; before: of the block, with the parameters of the element
    double left[KN_CURVES_MAX], before[KN_CURVES_MAX];
    int rounds;
} kn_served_lattice;

// Choose the cells of the lattice for a specimen: as near to `spacing_m` as whole cells allow. A specimen of unknown size
// is a cube of 1 cm. Return false if the specimen has fewer than 2 or more than KN_SERVED_CELLS_MAX cells along a side.
bool kn_served_lattice_cut(kn_served_lattice *served, const kn_curve *curve, double spacing_m);

// Give a block the cells of the specimen, on a table without friction, and no gravity.
void kn_served_lattice_shape(const kn_served_lattice *served, kn_model_def *def);

// Compute what the affine block of a structure leaves on a curve: the root mean square difference of its strain from the
// readings, as a share of the largest. Return NAN if the material cannot be simulated.
double kn_affine_block_left(const kn_affine_structure *structure, const kn_material *material, const kn_curve *curve);

// Compute the strain of the lattice at the readings of a creep curve. Once its weight has squeezed it flat, the strain is 1.
// Return false if memory is short, or if a scene does not accept the material.
bool kn_served_lattice_creep(const kn_served_lattice *served, const kn_material *material, const kn_curve *curve,
                             double *strain);

// Fit the parameters of the lattice whose structure and cells are set, beginning with those of the element, which the
// same curves gave. `subcommand` names the progress bar. Return false if memory is short, or if no lattice of this
// structure repeats the curves at all.
bool kn_served_lattice_fit(kn_served_lattice *served, const char *subcommand, int curves, const kn_curve *curve,
                           const kn_creep_fit *element);

#endif
