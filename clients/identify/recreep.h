#ifndef KN_CLIENTS_IDENTIFY_RECREEP_H
#define KN_CLIENTS_IDENTIFY_RECREEP_H
// Recreep: the computed creep of an identified material under the loads of the measured curves. The creep is computed
// in three ways: for one element, integrated to a tolerance (core/network.h), and for two blocks of cells (lattices
// with diagonals and with gas), stepped by the solver of kneadd. One plot compares the data, the element and the two
// lattices.
//
// The edges of a lattice turn as the block is compressed, whereas an element has no directions. A block of sides and
// diagonals alone yields like a mechanism (dough: the strain is 12 % off under 10 gf, 1.6 times the element's strain
// under 30 gf, 1.8 times under 50 gf). In a block with gas in its cells the volume stays constant, as equation 4 of the
// first paper supposes. Such a block is stiffer than the element (0.87 times the element's strain under 30 gf, 0.61
// times under 50 gf). The report states these differences.
#include "clients/identify/curve.h"

// number of cells along each side of a block; the block creeps uniformly, so more cells give the same strain to four
// digits
enum { KN_RECREEP_CELLS = 2 };

typedef enum kn_recreep_way {
    KN_RECREEP_ELEMENT,
    KN_RECREEP_DIAGONALS,
    KN_RECREEP_GAS,
    KN_RECREEP_WAYS
} kn_recreep_way;

typedef struct kn_recreep {
    double *strain[KN_RECREEP_WAYS]; // computed strain at the curve's readings; freed by kn_recreep_free
    // root mean square difference of the computed strain from the measured strain, and from the element's strain, as
    // shares of the largest measured strain
    double from_data[KN_RECREEP_WAYS], from_element[KN_RECREEP_WAYS];
} kn_recreep;

// Compute the creep in all three ways and store the result in `back`. `scene` is the path of a scene file with a block
// of the material. The run takes seconds and shows a progress bar. Return 0, or print an error and return an exit code.
int kn_recreep_run(kn_recreep *back, const char *subcommand, const char *scene, const kn_curve *curve);
void kn_recreep_free(kn_recreep *back);

double kn_recreep_largest(const kn_curve *curve); // return the largest measured strain

#endif
