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
    double peak;                                  // relative
    double lag_s, depth_m;                        // signed: later, deeper
    double jump_n, reference_jump_n, same_jump_n; // per ms; of SAME, whatever the reference is
    double variation, reference_variation;        // over the reference's peak
    bool chatters, latched;                       // more faults than the reference had
    bool front, shape_front;                      // no point is both faster and nearer to the best (force, shape)
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
// A candidate neither chatters nor latches and fits the scene's budget_s by its p90, since a server is late by its slow
// ticks. Errors first: of the candidates those within the bounds
//
//     fast 3 % of force, 3 % of shape       balanced 0.5 %, 1 %       accurate 0.1 %, 0.2 %
//     and no force that jumps by more than KN_JUMP times that of SAME
//
// or, where there is none, within 1.1 times the least excess of any. Of these the cheapest, times up to KN_NOISE times
// the least being equal: then fewer iterations at most, then in every step, then the scene's own linearisation.
//
// accurate of all candidates; fast of those that are less work, as the server counts it; balanced of those between the
// two that are nearer than fast. Where there is none, fast is accurate, and balanced is fast if that is within its
// bounds, else accurate: a bound that any candidate meets is met. NULL: no candidate.
#define KN_NOISE 1.25 // times of one point on a machine that does other work, too
void kn_front_name(const kn_front *front, const kn_plan *plan, const kn_row *named[KN_QUALITY_OWN]);

// What a name wants, 1: just so. Force, shape: for the report.
double kn_front_excess(const kn_row *row, kn_quality quality);
typedef struct kn_bound {
    double force, shape;
} kn_bound;
extern const kn_bound kn_front_bounds[KN_QUALITY_OWN];
#define KN_JUMP 1.5 // two iterations on dough 2.0, three 1.1: the impulse guard of 4 N/ms acts on the former

// The pick for the scene's budget_s where it is nearer than the named points, but no candidate: another lattice, step
// or precision, which only the scene itself can have. NULL: there is none.
const kn_row *kn_front_elsewhere(const kn_front *front, const kn_plan *plan, const kn_row *const named[KN_QUALITY_OWN]);

bool kn_front_csv(const kn_front *front, FILE *f);
void kn_front_result(const kn_front *front); // the same numbers as the list `points`, see result.h

#endif
