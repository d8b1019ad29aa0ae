#ifndef KN_CLIENTS_IDENTIFY_LOOP_H
#define KN_CLIENTS_IDENTIFY_LOOP_H
// The way back: a material that was found from creep curves creeps again, under the same loads, as one element
// integrated to a tolerance (core/network.h) and as a block of cells through the solver that serves scenes, so that the
// data, the element and the lattice can be laid over each other.
#include "clients/identify/curve.h"

enum { KN_LOOP_CELLS = 4 }; // along each side of the block

typedef struct kn_loop {
    double *element, *lattice; // strains at the readings of its curve; ended by kn_loop_free
    // root mean squares of differences, of the largest strain measured
    double data_element, data_lattice, element_lattice;
} kn_loop;

// scene: a file whose material it is. An exit code, after a complaint. Takes a second or so per minute of creep, and
// shows it.
int kn_loop_creep(kn_loop *loop, const char *subcommand, const char *scene, const kn_curve *curve);
void kn_loop_free(kn_loop *loop);

#endif
