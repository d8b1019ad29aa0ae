#ifndef KN_KNEAD_COST_H
#define KN_KNEAD_COST_H
// Predicted time per tick of each part of a scene. The prediction uses sizes and measured rates; nothing is run.
#include "core/model.h"

typedef struct kn_cost {
    double bytes, flops, us; // bytes moved through the caches; additions and multiplications; time on one core
} kn_cost;

typedef struct kn_cost_part {
    char name[64];
    bool contact;
    kn_cost once, iteration; // per linearisation of a step; per iteration of conjugate gradients (CG)
} kn_cost_part;

#define KN_COST_PARTS (2 + KN_PROBES_MAX)

// Return true if each edge is solved separately by Newton's method, because the SIMD lanes cannot solve the law for
// several edges at once.
bool kn_cost_newton(const kn_model *model);

// List the parts of a model with the implicit solver and return their number. The rates are those of the machine of
// bench/throughput.
int kn_cost_parts(const kn_model *model, kn_cost_part part[KN_COST_PARTS]);

// Return the time of a whole step, us, with the usual number of CG iterations: one more than the minimum. If `at_cap`
// is true, assume the maximum number of iterations instead.
double kn_cost_us(const kn_model *model, const kn_effort *effort, bool at_cap);

// Return the longest time of a step with a blow, us. A blow is a sudden change of the forces, for which the step is
// solved several times (core/impact.h). Return 0 if no step is ever repeated.
double kn_cost_blow_us(const kn_model *model, const kn_effort *effort);

#endif
