#ifndef KN_TESTS_DOUGH_H
#define KN_TESTS_DOUGH_H
#include "core/material.h"

#define GF_CM2 98.0665 // Pa. The papers measured gf/cm^3 on a 1 cm cube, where it equals gf/cm^2 per unit strain

// A material in the units of the papers, for a specimen of 1 cm.
#define PAPER_MATERIAL(k1, c1, alpha, beta, p0, p1)                                                                    \
    {                                                                                                                  \
        .k1_pa = (k1)*GF_CM2, .c1_pa_s = (c1)*GF_CM2, .damper = KN_DAMPER_EXPONENTIAL, .alpha_pa_s = (alpha)*GF_CM2,   \
        .beta_per_pa = (beta) / GF_CM2, .p0_pa = (p0)*GF_CM2, .p1_pa = (p1)*GF_CM2                                     \
    }

static const kn_material dough = PAPER_MATERIAL(470, 2500, 8.16e4, 0.0815, 9, 80);

#endif
