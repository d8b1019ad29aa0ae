#ifndef KN_CORE_NET_FIT_H
#define KN_CORE_NET_FIT_H
// Measured properties of a net: its own elastic constants, and the gamma with which it creeps like the 1-D element. A
// uniform stress loads the whole outside of the body, whatever its shape: traction = sigma . normal. The mean strain is
// read from the outside, too: 1/V sum of u (x) area. The creep is read from all nodes, by the linear map that fits them
// best. The test corresponds to the frictionless tension test of a block, but needs no flat ends.
#include "core/model.h"

typedef struct kn_specimen { // small strains: directions and areas are those at rest
    int nodes, edges;
    bool flat;
    const double (*x_m)[3];     // [nodes] rest positions
    const double (*area_m2)[3]; // [nodes] outward area vector of a node on the body's surface; 0 at inner nodes
    const kn_edge *edge;        // [edges]
    double kappa_m, volume_m3;
} kn_specimen;

// Measure the elastic constants. Return NULL, or a sentence: memory is short, or the net cannot carry a load.
const char *kn_specimen_moduli(const kn_specimen *s, kn_net_moduli *out);

// Return the strain along z after 60 s under a constant stress: kn_specimen_creep of the net, kn_element_creep of the
// 1-D element. Both take twelve implicit steps. The result is negative if memory is short.
double kn_specimen_creep(const kn_specimen *s, const kn_material *mat, double gamma, double stress_pa);
double kn_element_creep(const kn_material *mat, double stress_pa);

// Find the gamma between 0.2 and 1.5 at which the net creeps as much as the 1-D element. The stress is the geometric
// mean of the two stresses at which the damper begins and ends to fall. gamma is 1 if the damper does not depend on
// force. The net must already have E = 1. The result is deterministic and costs about ten calls of kn_specimen_creep.
// `error`: remaining relative difference of the two creep strains. Return false if memory is short.
bool kn_specimen_gamma(const kn_specimen *s, const kn_material *mat, double *gamma, double *error);

#endif
