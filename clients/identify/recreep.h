#ifndef KN_CLIENTS_IDENTIFY_RECREEP_H
#define KN_CLIENTS_IDENTIFY_RECREEP_H
// Recreep: the creep of an identified material under the loads of the measured curves. The creep is computed in three
// ways: for one element, integrated to a tolerance (core/network.h), and for two blocks of cells, stepped by the solver
// of kneadd. One plot then compares the data, the element and the lattices.
//
// The edges of a lattice turn as the block is compressed; an element has no directions. A block of sides and diagonals
// alone yields like a mechanism (dough: 12 % off under 10 gf, 1.6 times the element's strain under 30 gf, 1.8 times
// under 50 gf). In a block with gas in its cells the volume stays constant, as equation 4 of the first paper supposes.
// Such a block is stiffer than the element (0.87 and 0.61 times the strain under 30 and 50 gf). The report states these
// differences.
#include "clients/identify/curve.h"

// cells along each side of a block; the block creeps uniformly, and more cells give the same four digits
enum { KN_RECREEP_CELLS = 2 };

typedef enum kn_recreep_way {
    KN_RECREEP_ELEMENT,
    KN_RECREEP_DIAGONALS,
    KN_RECREEP_GAS,
    KN_RECREEP_WAYS
} kn_recreep_way;

typedef struct kn_recreep {
    double *strain[KN_RECREEP_WAYS]; // at the readings of the curve; freed by kn_recreep_free
    // root mean square differences, as shares of the largest measured strain
    double from_data[KN_RECREEP_WAYS], from_element[KN_RECREEP_WAYS];
} kn_recreep;

// Compute the creep in all three ways. `scene` is the file of a block with the material. The run takes seconds and
// shows a progress bar. Return an exit code, after a complaint.
int kn_recreep_run(kn_recreep *back, const char *subcommand, const char *scene, const kn_curve *curve);
void kn_recreep_free(kn_recreep *back);

double kn_recreep_largest(const kn_curve *curve); // largest strain of the curve

#endif
