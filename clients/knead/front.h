#ifndef KN_CLIENTS_FRONT_H
#define KN_CLIENTS_FRONT_H
// Comparison of the points of a sweep (`knead tradeoff`). A point is one replay of the log with one choice of lattice,
// time step and solver settings (plan.h). The cost of a point is its time per tick. Its errors are measured against
// references. The Pareto front, or front, is the set of points for which no faster point has a smaller or equal error.
// All results depend on the traces alone: nothing here reads a clock, and no file but the CSV is written.
//
//     error of force and shape, relative L2      solver   point against SAME: same lattice and step, but converged
//                                                step     SAME against FINE: 1/16 of the scene's step
//                                                lattice  FINE against FINE of the finest lattice
//     all = |point - FINE| + lattice             upper bound of the distance from the best result; ranks the points
//     peak, lag, depth                           point against FINE; without FINE (--quick) point against SAME
#include "clients/knead/plan.h"
#include "clients/knead/trace.h"
#include <stdio.h>

// A point chatters if the total variation of its force exceeds this factor times the variation of its reference. The
// total variation of dough is 2.4 times the peak force. A solver that chatters has 4 times the peak force or more.
#define KN_CHATTER 1.3

typedef struct kn_errors {
    double solver, step, lattice, all;
} kn_errors;

typedef struct kn_row {
    const kn_run *run;
    double median_us, p90_us;
    kn_errors force, shape;
    double peak;                                  // relative difference of the peak force
    double lag_s, depth_m;                        // positive: later, deeper
    double jump_n, reference_jump_n, same_jump_n; // largest jump of the force, N per ms: point, its reference, SAME
    double variation, reference_variation;        // in units of the reference's peak
    bool chatters, latched;                       // latched: more faults than the reference, or diverged
    bool front, shape_front;                      // on the Pareto front of force, of shape
} kn_row;

typedef struct kn_front {
    int count;
    // Sorted from coarse to fine lattices, from large to small steps, then by precision, method, passes and time.
    kn_row row[KN_RUNS_MAX];
    double finest_m; // spacing of the finest lattice with a reference
    double peak_n;   // peak force of the reference on the scene's own lattice
} kn_front;

// Compute the rows; traces[i] belongs to run i. Return false if the log never touches the object: then there is nothing
// to compare.
bool kn_front_make(kn_front *front, const kn_plan *plan, const kn_trace *traces);

// Return the point with the smallest total error of force among those whose p90 is within the budget and that neither
// chatter nor latch. Return NULL if there is none.
const kn_row *kn_front_pick(const kn_front *front, double budget_us);

// Times count as equal up to this ratio. Two times of one point differ by this ratio on a machine that also does other
// work.
#define KN_NOISE 1.25

// Choose the named points fast, balanced and accurate. A named point has the scene's lattice, step and precision, so
// that a running server may switch between the named points. A candidate for a name neither chatters nor latches. The
// p90 of its time is within the scene's budget_s, because slow ticks make a server late. Errors are considered before
// times. A candidate is accepted within these bounds:
//
//     fast 3 % of force, 3 % of shape       balanced 0.5 %, 1 %       accurate 0.1 %, 0.2 %
//     and no force that jumps by more than KN_JUMP times that of SAME
//
// If no candidate is within the bounds, those within 1.1 times the least excess (kn_front_excess) are accepted. The
// fastest accepted candidate is chosen. Times up to KN_NOISE times the least p90 count as equal. Among equal times the
// candidate with the fewest iterations at most (passes times iterations_max) is chosen, then the one with the fewest
// usual iterations (passes times `iterations`), then the one with the scene's own linearisation, then the one with the
// smallest error of force.
//
// accurate is chosen from all candidates. fast is chosen from the candidates that need less work than accurate by the
// server's count (kn_servo_cheaper). balanced is chosen from the candidates with less work than accurate, more work
// than fast, and a smaller error than fast.
//
// fast is accurate if there is no candidate for fast, or if only accurate meets the bounds of fast. If no candidate for
// balanced meets its bounds, balanced is fast if fast meets them, else accurate. Thus the bounds of a name are met if
// any candidate meets them. An entry of `named` is NULL if there is no candidate.
void kn_front_name(const kn_front *front, const kn_plan *plan, const kn_row *named[KN_QUALITY_OWN]);

// Return the error of a point relative to the bounds of a name; 1 is exactly at the bounds. Force and shape bounds are
// public for the report.
double kn_front_excess(const kn_row *row, kn_quality quality);
typedef struct kn_bound {
    double force, shape;
} kn_bound;
extern const kn_bound kn_front_bounds[KN_QUALITY_OWN];
// Largest jump of the force that a named point may have, relative to the jump of SAME. On dough the factor is 2.0 for a
// solver with two iterations and 1.1 with three. The impulse guard of 4 N/ms acts on two iterations.
#define KN_JUMP 1.5

// Return the point that kn_front_pick chooses for the scene's budget_s. Return NULL if that point is a candidate for a
// name, or if its error is not smaller than the errors of all named points. The returned point has another lattice,
// step or precision, which only the scene itself can set.
const kn_row *kn_front_elsewhere(const kn_front *front, const kn_plan *plan, const kn_row *const named[KN_QUALITY_OWN]);

bool kn_front_csv(const kn_front *front, FILE *f);
// Add the numbers of the CSV as the list `points` to the JSON result, see result.h.
void kn_front_result(const kn_front *front);

#endif
