#ifndef KN_CORE_NET_FIT_H
#define KN_CORE_NET_FIT_H
// What a net is made of when it is pulled: its own elastic constants, and the gamma that lets it creep as the element
// does. The body, whatever its shape, is loaded on its whole outside by a uniform stress, traction = sigma . normal;
// its mean strain is read off the outside again, 1/V sum of u (x) area; what it crept is read off all its nodes by the
// linear map that fits them best. That is the frictionless tension test of a block, and needs no flat ends.
#include "core/model.h"

typedef struct kn_specimen { // small strains: directions and areas are those at rest
    int nodes, edges;
    bool flat;
    const double (*x_m)[3];
    const double (*area_m2)[3]; // [nodes] outward area that belongs to a node; 0 inside
    const kn_edge *edge;
    double kappa_m, volume_m3;
} kn_specimen;

// NULL, or what is wrong: memory is short, or the net cannot carry a load.
const char *kn_specimen_moduli(const kn_specimen *s, kn_net_moduli *out);

// Strain along z after 60 s under a constant stress, as the net creeps and as the 1-D element does, both by twelve
// implicit steps. Negative when memory is short.
double kn_specimen_creep(const kn_specimen *s, const kn_material *mat, double gamma, double stress_pa);
double kn_element_creep(const kn_material *mat, double stress_pa);

// gamma between 0.2 and 1.5 at which the two agree, at the geometric mean of the stresses where the damper begins and
// ends to fall; 1 for a material whose damper does not depend on force. The net's E must be 1 already. Deterministic;
// some ten creeps. error: what is left, relative.
bool kn_specimen_gamma(const kn_specimen *s, const kn_material *mat, double *gamma, double *error);

#endif
