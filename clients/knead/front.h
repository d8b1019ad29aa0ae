#ifndef KN_CLIENTS_FRONT_H
#define KN_CLIENTS_FRONT_H
// The points of a sweep beside each other: what each costs, how wrong it is against which reference, which are worth
// having. Everything here is a function of traces: no clock, no file but the CSV.
//
//     error, force and shape, relative L2        solver  against the same lattice and step, converged (SAME)
//                                                step    of that one against 1/16 of the scene's step (FINE)
//                                                lattice of FINE against FINE of the finest lattice
//     all = |point - FINE| + lattice             at most the distance from the best that was computed; ranks the points
//     peak, lag, depth                           against FINE, too; without it (--quick) against SAME
#include "clients/knead/plan.h"
#include "clients/knead/trace.h"
#include <stdio.h>

#define KN_CHATTER 1.3 // total variation over the reference's; dough has 2.4 peaks, a solver that chatters 4 and more

typedef struct kn_errors {
    double solver, step, lattice, all;
} kn_errors;

typedef struct kn_row {
    const kn_run *run;
    double median_us, p90_us;
    kn_errors force, shape;
    double peak;                     // relative
    double lag_s, depth_m;           // signed: later, deeper
    double jump_n, reference_jump_n; // per ms
    double variation, reference_variation; // over the reference's peak
    bool chatters, latched;          // more faults than the reference had
    bool front, shape_front;         // no point is both faster and nearer to the best (force, shape)
} kn_row;

typedef struct kn_front {
    int count;
    kn_row row[KN_RUNS_MAX]; // coarse to fine, large steps to small ones, then by method and time
    double finest_m;         // spacing of the finest lattice with a reference
    double peak_n;           // of the reference of the scene's own lattice
} kn_front;

// traces[i] of run i. False: the log never touches the object, so there is nothing to compare.
bool kn_front_make(kn_front *front, const kn_plan *plan, const kn_trace *traces);

// Of the points that neither chatter nor latch, the one with the least error of all (force) whose p90 is at most
// budget; NULL: none.
const kn_row *kn_front_pick(const kn_front *front, double budget_us);

// Named points, on the scene's lattice, step and precision, so that a server may go from one to another while it runs.
// Each is the cheapest by its p90, since a server is late by its slow ticks, that neither chatters nor latches, fits the
// scene's budget_s, and has no larger error of the solver than
//
//     fast 3 % of force, 3 % of shape       balanced 0.5 %, 1 %       accurate 0.1 %, 0.2 %
//
// and balanced and accurate are more work than the one before as the server counts it: iterations of every step, then
// at most. Where none is that accurate, the name gets the most accurate; where none is better, the one before. NULL:
// none fits.
void kn_front_name(const kn_front *front, const kn_plan *plan, const kn_row *named[KN_QUALITY_OWN]);

bool kn_front_csv(const kn_front *front, FILE *f);

#endif
