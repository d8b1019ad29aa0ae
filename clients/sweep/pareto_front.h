#ifndef KN_CLIENTS_PARETO_FRONT_H
#define KN_CLIENTS_PARETO_FRONT_H
// Comparison of the points of a sweep (`knead tradeoff`). A point is one replay of the log with one choice of lattice,
// time step and solver settings (sweep_plan.h). The cost of a point is its time per tick. Its errors are measured
// against references. The Pareto front, or front, is the set of points for which no faster point has a smaller or equal
// error. All results depend on the traces alone: nothing here reads a clock. Only the CSV and the picture are written.
//
//     error of force and shape, relative L2      solver   point against SAME: same lattice and step, but converged
//                                                step     SAME against FINE: 1/16 of the scene's step
//                                                lattice  FINE against FINE of the finest lattice
//     all = |point - FINE| + lattice             upper bound of the distance from the best result; ranks the points
//     peak, lag, depth                           point against FINE; without FINE (--quick) point against SAME
#include "clients/sweep/replay_trace.h"
#include "clients/sweep/sweep_plan.h"
#include <stdio.h>

// A point chatters if the total variation of its force exceeds this factor times the variation of its reference. On
// dough, the total variation of a converged solution is 2.4 times the peak force. A chattering solver reaches 4 times
// the peak force or more.
#define KN_PARETO_CHATTER 1.3

typedef struct kn_pareto_errors {
    double solver, step, lattice, all;
} kn_pareto_errors;

typedef struct kn_pareto_row {
    const kn_sweep_run *run;
    double median_us, p90_us;
    kn_pareto_errors force, shape;
    // factor: object.force_factor with which the forces of this lattice come nearest to the finest one; factor_left:
    // the error that is left then. NAN for the finest lattice and for a mesh.
    double factor, factor_left;
    // Difference of the peak force from the reference, relative to the peak of the reference.
    double peak;
    // lag_s: delay of the force behind that of the reference, s. depth_m: depth of the dent minus its depth in the
    // reference, m.
    double lag_s, depth_m;
    // Largest change of the force in one tick, N per ms. jump_n: of the point. reference_jump_n: of its reference.
    // same_jump_n: of its reference SAME.
    double jump_n, reference_jump_n, same_jump_n;
    // Total variation of the force over time, divided by the peak force of the reference. variation: of the point.
    // reference_variation: of the reference.
    double variation, reference_variation;
    // chatters: see KN_PARETO_CHATTER; latched: the replay had more faults than the reference, or diverged.
    bool chatters, latched;
    // front: the point is on the Pareto front of the force error. shape_front: it is on that of the shape error.
    bool front, shape_front;
} kn_pareto_row;

typedef struct kn_pareto_front {
    int count;
    // One row per point, sorted from coarse to fine lattices, from large to small time steps, then by precision,
    // method, number of linearisations (passes) and time.
    kn_pareto_row row[KN_SWEEP_RUNS_MAX];
    double finest_m; // node spacing of the finest lattice that has a reference, m
    double peak_n;   // peak force of the reference on the scene's own lattice, N
} kn_pareto_front;

// Compute the row of every point of the plan. traces[i] is the trace of run i of the plan. Return false if no tool
// touches the object in the log, because there is no force to compare.
bool kn_pareto_front_make(kn_pareto_front *front, const kn_sweep_plan *plan, const kn_replay_trace *traces);

// Return the point with the smallest total error of the force for a given budget. The 90th percentile (p90) of its time
// per tick must be within `budget_us`, and the point must neither chatter nor be latched. Return NULL if no point
// qualifies.
const kn_pareto_row *kn_pareto_front_pick(const kn_pareto_front *front, double budget_us);

// Two computing times count as equal if their ratio is at most this number. Two measurements of one point differ by
// this ratio on a machine that also does other work.
#define KN_PARETO_NOISE 1.25

// Choose the named points fast, balanced and accurate. A named point has the scene's lattice, step and precision, so
// that a running server may switch between the named points. A candidate for a name neither chatters nor latches. The
// p90 of its time is within the scene's budget_s, because slow ticks make a server late. The errors of the candidates
// are considered before their times. A candidate is accepted within these bounds:
//
//     fast 3 % of force, 3 % of shape       balanced 0.5 %, 1 %       accurate 0.1 %, 0.2 %
//     and no force that jumps by more than KN_PARETO_JUMP times that of SAME
//
// If no candidate is within the bounds, those within 1.1 times the least excess (kn_pareto_front_excess) are accepted.
// The fastest accepted candidate is chosen. Times up to KN_PARETO_NOISE times the least p90 count as equal. Among equal
// times the candidate with the fewest iterations at most (passes times iterations_max) is chosen, then the one with the
// fewest usual iterations (passes times `iterations`), then the one with the scene's own linearisation, then the one
// with the smallest error of force.
//
// accurate is chosen from all candidates. fast is chosen from the candidates that need less work than accurate by the
// server's count (kn_servo_cheaper). balanced is chosen from the candidates with less work than accurate, more work
// than fast, and a smaller error than fast.
//
// fast is accurate if there is no candidate for fast, or if only accurate meets the bounds of fast. If no candidate for
// balanced meets its bounds, balanced is fast if fast meets them, and accurate otherwise. Thus the bounds of a name are
// met if any candidate meets them. An entry of `named` is NULL if there is no candidate.
void kn_pareto_front_name(const kn_pareto_front *front, const kn_sweep_plan *plan,
                          const kn_pareto_row *named[KN_QUALITY_OWN]);

// Return the error of a point relative to the error bounds of a named quality. 1: the error is exactly at the bounds.
// The bounds of force and shape (kn_pareto_front_bounds) are public for the report.
double kn_pareto_front_excess(const kn_pareto_row *row, kn_quality quality);
typedef struct kn_pareto_bound {
    double force, shape;
} kn_pareto_bound;
extern const kn_pareto_bound kn_pareto_front_bounds[KN_QUALITY_OWN];
// Largest jump of the force in one tick that a named point may have, relative to the jump of the converged reference
// SAME. Measured on dough, the ratio is 2.0 for a solver with two iterations and 1.1 for a solver with three. With two
// iterations the force jumps so far that the impulse guard of 4 N/ms acts.
#define KN_PARETO_JUMP 1.5

// Return the point that kn_pareto_front_pick chooses for the scene's budget_s. Return NULL if that point is a candidate
// for a name, or if its error is not smaller than the errors of all named points. The returned point has another
// lattice, step or precision, which only the scene itself can set.
const kn_pareto_row *kn_pareto_front_elsewhere(const kn_pareto_front *front, const kn_sweep_plan *plan,
                                               const kn_pareto_row *const named[KN_QUALITY_OWN]);

void kn_pareto_front_csv(const kn_pareto_front *front, FILE *f);
// Add the rows to the JSON result (result.h) as the list `points`, with the numbers of the CSV file.
void kn_pareto_front_result(const kn_pareto_front *front);

// Table and picture of the Pareto front.

void kn_pareto_chart_print(const kn_pareto_front *front, const kn_sweep_plan *plan,
                           const kn_pareto_row *const named[KN_QUALITY_OWN]);

// Draw the time of a tick against three errors with gnuplot: the solver's error of force, the solver's error of shape,
// and the total error of force, which includes time step and lattice. The first two panels show the Pareto front of
// each lattice. The third panel shows the Pareto front of all lattices. Return an exit code.
int kn_pareto_chart_draw(const kn_pareto_front *front, const kn_sweep_plan *plan,
                         const kn_pareto_row *const named[KN_QUALITY_OWN], const char *path);

#endif
