#ifndef KN_CLIENTS_IDENTIFY_RECREEP_H
#define KN_CLIENTS_IDENTIFY_RECREEP_H
// The way back: a material that was found from creep curves creeps again, under the same loads, as one element
// integrated to a tolerance (core/network.h) and as blocks of cells through the solver that serves scenes, so that the
// data, the element and the lattices can be laid over each other.
//
// The edges of a lattice turn as it gives way, those of an element do not: sides and diagonals alone give way like a
// mechanism (dough: 12 % off under 10 gf, 1.6 times the element's strain under 30, 1.8 times under 50); with gas in the
// cells, which keeps the volume as equation 4 supposes, a block is stiffer (0.87 and 0.61). The report says how
// much.
#include "clients/identify/curve.h"

enum { KN_RECREEP_CELLS = 2 }; // along each side of a block: it creeps evenly, more of them give the same four digits

typedef enum kn_recreep_way {
    KN_RECREEP_ELEMENT,
    KN_RECREEP_DIAGONALS,
    KN_RECREEP_GAS,
    KN_RECREEP_WAYS
} kn_recreep_way;
extern const char *const kn_recreep_name[KN_RECREEP_WAYS]; // "element", ...

typedef struct kn_recreep {
    double *strain[KN_RECREEP_WAYS]; // at the readings of its curve; ended by kn_recreep_free
    // root mean squares, of the largest strain measured
    double from_data[KN_RECREEP_WAYS], from_element[KN_RECREEP_WAYS];
} kn_recreep;

// scene: a file of a block, whose material it is. An exit code, after a complaint. Takes seconds, and shows it.
int kn_recreep_run(kn_recreep *back, const char *subcommand, const char *scene, const kn_curve *curve);
void kn_recreep_free(kn_recreep *back);

double kn_recreep_largest(const kn_curve *curve); // strain

#endif
