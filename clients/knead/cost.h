#ifndef KN_KNEAD_COST_H
#define KN_KNEAD_COST_H
// What each part that a scene pays for costs a tick: a prediction from sizes and measured rates, before anything runs.
#include "core/model.h"

typedef struct kn_cost {
    double bytes, flops, us; // moved through the caches; additions and multiplications; on one core
} kn_cost;

typedef struct kn_cost_part {
    char name[64];
    kn_cost once, iteration; // of a linearisation of the step; of each CG iteration in it
} kn_cost_part;

#define KN_COST_PARTS (2 + KN_PROBES_MAX)

// Parts of an implicit model; returns how many. Rates are those of bench/throughput's machine.
int kn_cost_parts(const kn_model *model, kn_cost_part part[KN_COST_PARTS]);

// Of a whole step with so many CG iterations, us.
double kn_cost_us(const kn_model *model, int iterations, int passes);

#endif
