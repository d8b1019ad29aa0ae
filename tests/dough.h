#ifndef KN_TESTS_DOUGH_H
#define KN_TESTS_DOUGH_H
#include "core/material.h"

#define GF_CM2 98.0665 // Pa. The papers measured gf/cm^3 on a 1 cm cube, where it equals gf/cm^2 per unit strain

static const kn_material dough = {.k1_pa = 470 * GF_CM2,
                                  .c1_pa_s = 2500 * GF_CM2,
                                  .damper = KN_DAMPER_EXPONENTIAL,
                                  .alpha_pa_s = 8.16e4 * GF_CM2,
                                  .beta_per_pa = 0.0815 / GF_CM2,
                                  .p0_pa = 9 * GF_CM2,
                                  .p1_pa = 80 * GF_CM2};

// The same dough for a lattice with cells of 5 mm, gas in the cells and diagonals of 8 %: materials/dough-lattice.yaml.
static inline kn_material dough_lattice(void)
{
    return (kn_material){.k1_pa = 326 * GF_CM2,
                         .c1_pa_s = 2100 * GF_CM2,
                         .damper = KN_DAMPER_EXPONENTIAL,
                         .alpha_pa_s = 6.45e4 * GF_CM2,
                         .beta_per_pa = 0.1212 / GF_CM2,
                         .p0_pa = 6.4 * GF_CM2,
                         .p1_pa = 55.8 * GF_CM2};
}

#endif
