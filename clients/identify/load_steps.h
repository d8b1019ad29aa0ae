#ifndef KN_CLIENTS_IDENTIFY_LOAD_STEPS_H
#define KN_CLIENTS_IDENTIFY_LOAD_STEPS_H
// The steps of a load that was recorded beside the readings: it stays near a value for a while, and near another one
// from then on. What lies between two such values belongs to neither.
#include "clients/identify/readings.h"

#define KN_LOAD_STEPS 32

typedef struct kn_load_step {
    double load;            // mean of its readings; 0 where they are within 2 % of the largest load from 0
    double early_s, late_s; // it came after the reading at early_s and before the one at late_s; equal: known
    int begin, end;         // its readings
} kn_load_step;

typedef struct kn_load_steps {
    int count; // 0: more than KN_LOAD_STEPS
    kn_load_step step[KN_LOAD_STEPS];
    int between; // readings that belong to none: their value is NAN from now on
} kn_load_steps;

// A step is a change by more than 4 % of the largest load that the next reading confirms (not asked of the
// first and the last one).
void kn_load_steps_find(kn_load_steps *s, kn_readings *r);

// Whether load a comes in steps rather than load b: in fewer pieces, or in as many with less than half of the scatter.
bool kn_load_steps_flat(const kn_readings *r, const double *a, const double *b);

#endif
