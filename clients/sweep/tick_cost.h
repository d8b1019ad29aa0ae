#ifndef KN_CLIENTS_TICK_COST_H
#define KN_CLIENTS_TICK_COST_H
// Predicted computing time per tick for each part of a scene (lattice or mesh, coarse level, gas, contact of each
// tool). The prediction uses sizes and measured rates; nothing is run.
#include "core/model.h"

typedef struct kn_tick_cost_part {
    char name[64];
    bool contact;
    // Time on one core, us: per linearisation of a step, and per iteration of conjugate gradients (CG).
    double once_us, iteration_us;
} kn_tick_cost_part;

#define KN_TICK_COST_PARTS (3 + KN_PROBES_MAX)

// Return true if the model solves each edge separately by Newton's method. This is the case if the SIMD lanes cannot
// solve the material law for several edges at once.
bool kn_tick_cost_newton(const kn_model *model);

// List the parts of a model with their cost per tick under the implicit solver. Return the number of parts. The rates
// were measured on the machine of bench/throughput.
int kn_tick_cost_parts(const kn_model *model, kn_tick_cost_part part[KN_TICK_COST_PARTS]);

// Return the predicted time of a whole time step, us. The number of CG iterations is the usual one: one more than the
// minimum. If `at_cap` is true, assume the maximum number of iterations instead.
double kn_tick_cost_us(const kn_model *model, const kn_effort *effort, bool at_cap);

// Return the predicted longest time of a time step with an impact, us. An impact is a sudden change of the forces, for
// which the step is solved several times (core/solve/step_effort.h). Return 0 if no step is ever solved again.
double kn_tick_cost_blow_us(const kn_model *model, const kn_effort *effort);

#endif
