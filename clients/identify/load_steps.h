#ifndef KN_CLIENTS_IDENTIFY_LOAD_STEPS_H
#define KN_CLIENTS_IDENTIFY_LOAD_STEPS_H
// Load steps: times in which a recorded load stays near one value. Readings taken while the load changes belong to no
// step.
#include "clients/identify/readings.h"

#define KN_LOAD_STEPS 32

typedef struct kn_load_step {
    double load; // mean load of the step; set to 0 if it is below 2 % of the largest load
    // The step began after the reading at early_s and before the reading at late_s. If both are equal, the time is
    // known exactly.
    double early_s, late_s;
    int begin, end; // readings begin..end-1 belong to the step
} kn_load_step;

typedef struct kn_load_steps {
    int count; // 0: more than KN_LOAD_STEPS
    kn_load_step step[KN_LOAD_STEPS];
    int between; // number of readings that belong to no step; their value becomes NAN
} kn_load_steps;

// Find the steps. A new step begins where the load changes by more than 4 % of the largest load and the next reading
// confirms the change. The first and the last reading need no confirmation.
void kn_load_steps_find(kn_load_steps *s, kn_readings *r);

// Return whether the load `a` consists of steps more clearly than the load `b`: it has fewer steps, or as many steps
// with less than half of the scatter.
bool kn_load_steps_flat(const kn_readings *r, const double *a, const double *b);

#endif
