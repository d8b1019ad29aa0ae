#ifndef KN_CORE_SOLVE_STEP_EFFORT_H
#define KN_CORE_SOLVE_STEP_EFFORT_H
// The work of an implicit step: the number of linearisations of the law, and the number of iterations for each. An
// impact needs more linearisations than other steps, and a deadline may leave time for fewer.
#include "core/solve/contact.h"
#include "core/solve/kernel.h"

// --- impacts --------------------------------------------------------------------------------------------------------

// Impacts (blows): steps in which the forces change too much for one linearisation of the law. A line is one
// linearisation.
//
//     s |        ___----      The step starts from the line at the present state of the edges. An edge at rest has a
//       |   __.--             slope some hundred times that of a flowing edge. So a block that is struck answers with
//       | .'                  twice the true force for a millisecond, and with half of it in the next. A second, third
//       |/____________ rate   and fourth line, each at the result of the line before, halve the error three times and
//                            more.
//
// The step of a blow is solved up to KN_IMPACT_PASSES times, until the law is met within the tolerance. A plate that
// pulls at a node releases the node within this step, not after it. A gentle landing of the hand is never a blow: its
// bits, forces and time do not depend on this module.
//
// A step's residual is compared with the largest residual of the last second. A blow raises this largest residual to at
// most the limit of kn_impact_power. Without this limit, a blow, and every step of the second after it, would be solved
// only to a thousandth of the blow's own residual. If gas a thousand times as stiff as the dough makes up most of the
// residual, a third of the shape would then stay unsolved. For a tenth of a second after a blow, a step above a tenth
// of KN_IMPACT_POWER is a blow, too, because the nodes that leave the plate one by one determine the motion that
// follows. The limits for rate, pressure and path are not lowered after a blow. If they were, a plate that moves on at
// 5 cm/s would be a blow during all of this time, at five times the cost.

// A step is an impact if it exceeds one of the limits POWER, RATE, PRESS or WAY. POWER, RATE and PRESS are multiples of
// the power, the velocity or the pressure at which an edge begins to flow (stress p1).
#define KN_IMPACT_PASSES 6   // largest number of linearisations of the law in the step of an impact
#define KN_IMPACT_POWER 3.0  // limit of r.z (kernel.h) per node at the start of a step; a gentle press stays below 1
#define KN_IMPACT_RATE 16.0  // limit of the change of a held node's velocity; a gentle press stays below 6
#define KN_IMPACT_PRESS 0.08 // limit of the change of a sample's pressure; a gentle press stays below 0.04
// Limit of the path of a held node in one step, divided by the length of a compressed edge. A gentle press stays below
// 0.01.
#define KN_IMPACT_WAY 0.03
// The largest residual decays over a second. In a tenth of a second after an impact, it falls to this fraction.
#define KN_IMPACT_RECENT 0.9
// In this tenth of a second, KN_IMPACT_POWER is multiplied by this factor.
#define KN_IMPACT_AFTER 0.1

// Return the largest number of linearisations of a step, apart from impacts. `passes`: the number that the effort asks
// for. Let r be the ratio of secant to tangent, at most 1 + s |d ln c2/ds|. A linearisation that is half tangent and
// half secant reduces an error to (r - 1)/(r + 1) of its size. r is 8 for dough, and the linearisation of the next step
// corrects the remaining error. r is some hundreds for a ramp, which yields suddenly at p1, so every step of a ramp
// needs several linearisations.
int kn_impact_lines(const kn_model *model, int passes);
#define KN_IMPACT_BEND 32.0 // if s |d ln c2/ds| at p1 exceeds this limit, every step needs several linearisations

// --- long steps -----------------------------------------------------------------------------------------------------

// A long step is one of at least KN_LONG_S under a law that bends. Nearly every one would be an impact, since a tool
// goes ten times as far as in 1 ms. But its error comes from its length, not from its number of linearisations: a ball
// that strokes dough in steps of 10 ms has an error of 4 % of its peak force with one as with seven
// (bench/bench_learner.c). So a long step ignores impacts. With passes > 1 it takes this number of linearisations. With
// passes = 1 it adds linearisations, up to KN_LONG_LINES, until the residual is below KN_LONG_LAW of the first
// residual; each is solved to KN_LONG_SOLVED times the tolerance. That makes 1.1 to 1.4 of them. Gas, a thousand times
// as stiff as the dough, makes up most of the residual and hides the dough's part, so with gas the limit is
// KN_LONG_LAW_GAS. Under a plate that holds nodes the limit is KN_LONG_LAW_PLATE_S/dt, since the plate carries its
// nodes far in a longer step: with KN_LONG_LAW, dough squashed to a fifth in steps of 0.1 s was wrong by 6 %. For a
// ramp all linearisations go to the tolerance.
//
// The edges push along their directions at the start of the step, which are off by half of the angle that an edge
// turns. Directions in the middle of the step, at x + v dt/2, lower the ball's error from 3.6 to 2.7 %, but an object
// that nothing holds then loses angular momentum: 17 % in half a second at 10 rad/s and 10 ms.
#define KN_LONG_S 0.002
#define KN_LONG_LINES 12
#define KN_LONG_LAW 0.3
#define KN_LONG_LAW_GAS 0.1
#define KN_LONG_LAW_PLATE_S 0.001
#define KN_LONG_SOLVED 10.0

bool kn_step_is_long(const kn_model *model);
// Return true if a long step of this many passes takes its lines on demand.
bool kn_step_on_demand(const kn_model *model, int passes);
// Return the share of the first residual at which the law of such a step counts as solved. `held`: a plate holds nodes.
double kn_step_law(const kn_model *model, bool held);

// Return the limit of r.z [W] above which a step of the model is an impact. The limit is infinite for a straight law.
double kn_impact_power(const kn_model *model);

// Return true if the step is an impact. `contact`: contact that kn_contact_find has found for this step; `rz`: r.z of
// the first linearisation. With a straight law no step is an impact. All functions of this header are real-time safe.
bool kn_impact(const kn_model *model, const kn_state *state, const kn_contact *contact, double rz);

// If a deadline leaves time for only one or two lines, the first line must be good. A plate strikes fast if it changes
// the velocity of its nodes by more than KN_IMPACT_BLOW times the velocity at which an edge flows. The velocity field
// under a fast plate is much the same for every material that flows. It is that under a rigid punch on an elastic
// half-space, reduced towards the base and the sides of the object.
//
//          |  V  |            a: half width of the plate, d: depth, R: distance from the plate, r: from its axis
//     _____|_____|_____       down      V (surface + (axis - surface) d/R)
//        <- : | : ->                    surface = 1/(1 + 1.2 sqrt(R/a) + 0.8 R/a)
//           : | :                       axis = 1/(1 + 0.15 R/a + 0.22 (R/a)^2)
//           : v :             outwards  V (0.42 a d r/r'^3 - 0.21 a r/(r' (r' + d))), r'^2 = r^2 + d^2 + h^2
//
// Slow parts do not flow: the field is zero where the velocity would be below KN_IMPACT_REST x height x the strain rate
// at which edges flow. The law is linearised at the velocities of this field. The field is far from exact, but most
// edges that will flow in the step flow in the field. With time for one line, a plate at 10 cm/s on dough gives more
// than twice its true force if the line starts from rest, and less than 1.1 times its true force if the line starts
// from this field (tests/physics/test_deadline.c).
#define KN_IMPACT_BLOW 100.0
#define KN_IMPACT_REST 5.0

// For every plate that strikes fast, add the velocity field under a rigid punch to the solver's guess, and mark every
// row as moved. The guess must already contain the velocities of the held nodes. Return true if a plate strikes fast.
bool kn_impact_guess(const kn_model *model, const kn_state *state, kn_work *work, const kn_contact *contact);

// --- deadline -------------------------------------------------------------------------------------------------------

// Limit on the work of one step, in units of work that the step itself counts. The count depends on the input alone. So
// a step that the deadline ends early has the same bits on every machine. A unit takes about one nanosecond on one core
// with AVX-512. The caller that sets the deadline measures the duration of a unit on its own machine
// (server/served_object.h).
//
//     spent  |find|line i i i i|look|i i|line i i i i|look|i i        most
//            '-----------------------------------------------------'   the next part would not fit: the step ends
//
// Terms: find is the search for contact, a line is one linearisation of the law, i an iteration of the conjugate
// gradients, a look one evaluation of the contact. The work of each part of an implicit step is counted before the part
// begins. The shortest step is one line, KN_DEADLINE_LEAST iterations and one look. A step does at least this work,
// even if the deadline is shorter. An impact may need more lines than fit into the deadline. Then the units are shared
// among as many lines as fit with a few iterations each. All lines but the last are solved only to a fifth of their
// initial residual. If a plate strikes fast, the step starts from a guessed velocity field (kn_impact_guess). The
// unsolved part stays in the residual from which the next step starts. The model fixes the stages of Runge-Kutta and
// the passes of the integer solver, so these solvers have no deadline.

// Least number of iterations of a line that no later line corrects. The first iteration of a step searches only along
// the last step's change of velocity. Without a second one, all other errors stay: a lifted object gained energy
// without limit.
#define KN_DEADLINE_LEAST 2

typedef struct kn_deadline {
    int64_t most, spent; // most: limit of the step, or 0 without a deadline; spent: count so far [units of work]
    // estimated work of one linearisation, one iteration, one look at the contact [units]
    int64_t line, iteration, look;
    int64_t law;       // estimated work of evaluating the law once, a part of a linearisation [units]
    int64_t line_most; // limit of `spent` for the present linearisation
    bool hurried;      // the present linearisation is cut short to leave time for later ones
} kn_deadline;

// Estimate the units of work of each part of this step, and count the search for contact, which is already done.
// `most`: limit of the step, in units of work; 0: no deadline.
void kn_deadline_begin(kn_deadline *deadline, const kn_model *model, const kn_contact *contact, int64_t most);

// Begin a linearisation (line): count its work and the work of its look at the contact. Return false, and count
// nothing, if the linearisation and its least iterations would exceed the deadline. The first linearisation always
// begins.
bool kn_deadline_line(kn_deadline *deadline, bool first);

// Return the units of work of kn_impact_guess in a step in which a plate strikes fast. Return 0 if no guess is needed,
// because `lines` linearisations of `iterations` iterations each fit into the deadline. Also return 0 if a guess, one
// linearisation and its least iterations do not fit.
int64_t kn_deadline_guess(const kn_deadline *deadline, const kn_model *model, int lines, int iterations);

// Limit the linearisation that has begun to its share of the remaining units of work. `lines`: number of linearisations
// from this one on, each of at most `iterations` iterations.
void kn_deadline_share(kn_deadline *deadline, int lines, int iterations);

// Count `units` units of work and return true. If fewer units are left for the present linearisation, count nothing and
// return false.
bool kn_deadline_spend(kn_deadline *deadline, int64_t units);

// Count an iteration and return true. `done`: number of iterations of this linearisation so far. Return false if it has
// done the least number and no units are left for another one.
bool kn_deadline_iterate(kn_deadline *deadline, int done);

// Return the units of work of the shortest step of a model while no tool touches the object.
int64_t kn_deadline_least(const kn_model *model);

#endif
