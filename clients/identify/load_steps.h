#ifndef KN_CLIENTS_IDENTIFY_LOAD_STEPS_H
#define KN_CLIENTS_IDENTIFY_LOAD_STEPS_H
// Load steps: spans of time in which a recorded load stays near one value. Readings taken while the load changes belong
// to no step.
#include "clients/identify/readings.h"

#define KN_LOAD_STEPS 32

typedef struct kn_load_step {
    double load; // mean load of the step; a mean below 2 % of the largest load is set to 0
    // The step began between the reading at early_s and the reading at late_s. If early_s = late_s, the begin of the
    // step is known exactly.
    double early_s, late_s;
    int begin, end; // the readings begin..end-1 belong to the step
} kn_load_step;

typedef struct kn_load_steps {
    int count; // number of steps; 0: the load has more than KN_LOAD_STEPS steps, or none
    kn_load_step step[KN_LOAD_STEPS];
    int between; // number of readings that belong to no step; the values of these readings are set to NAN
} kn_load_steps;

// Find the steps. A new step begins where the load changes by more than 4 % of the largest load and the next reading
// confirms the change. The first and the last reading need no confirmation.
void kn_load_steps_find(kn_load_steps *s, kn_readings *r);

// Return whether the load a[] consists of steps more clearly than the load b[]. This is the case if a[] has fewer steps
// than b[], or if both have equally many steps and a[] scatters less than half as much around its steps.
bool kn_load_steps_flat(const kn_readings *r, const double *a, const double *b);

#endif
