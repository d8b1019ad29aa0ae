#ifndef KN_KNEAD_COST_H
#define KN_KNEAD_COST_H
// What each part that a scene pays for costs a tick: a prediction from sizes and measured rates, before anything runs.
#include "core/model.h"

typedef struct kn_cost {
    double bytes, flops, us; // moved through the caches; additions and multiplications; on one core
} kn_cost;

typedef struct kn_cost_part {
    char name[64];
    bool contact;
    kn_cost once, iteration; // of a linearisation of the step; of each CG iteration in it
} kn_cost_part;

#define KN_COST_PARTS (2 + KN_PROBES_MAX)

// Every edge takes Newton by itself: its law is none that lanes can solve together.
bool kn_cost_newton(const kn_model *model);

// Parts of an implicit model; returns how many. Rates are those of bench/throughput's machine.
int kn_cost_parts(const kn_model *model, kn_cost_part part[KN_COST_PARTS]);

// Of a whole step with as many CG iterations as it usually takes, one above the least, us; at_cap: with the most.
double kn_cost_us(const kn_model *model, const kn_effort *effort, bool at_cap);

// The most that a step with a blow takes (core/impact.h), us; 0 where none is taken again.
double kn_cost_blow_us(const kn_model *model, const kn_effort *effort);

#endif
