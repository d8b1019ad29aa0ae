#ifndef KN_CORE_IMPACT_H
#define KN_CORE_IMPACT_H
// Steps that bring on more than one straight line through a law that bends can follow.
//
//     s |        ___----      The step starts from the line through the law where the edges are. An edge at rest has a
//       |   __.--             slope some hundred times that of a flowing one, so a block that is struck answers with
//       | .'                  twice its force for a millisecond, and with half of it in the next. A second, third and
//       |/____________ rate   fourth line, each through where the last one led, halve the error three times and more.
//
// Such a step is taken again up to KN_IMPACT_PASSES times, until the law is met within the tolerance, and a plate that
// pulls lets go within the step, not after it. A hand that lands gently never gets there: bits, forces and time of a
// press are the same with and without. All limits are in units of what makes one edge flow, p1.
//
// What a step's residual is small beside, the largest of the last second, a blow counts for no more than its limit in:
// solved to a thousandth of itself it leaves a third of the shape unsolved where gas a thousand times as stiff as the
// dough takes most of its residual, and so does every step of the second after it. For a tenth of a second afterwards
// a tenth of KN_IMPACT_POWER is a blow, too: nodes that leave the plate one by one decide on all that follows. Not of
// the other limits: a plate that goes on at 5 cm/s would be a blow all that time, at five times the price.
#include "core/contact.h"

#define KN_IMPACT_PASSES 6
#define KN_IMPACT_POWER 3.0  // r.z of the step's start per node; a gentle press has below 1
#define KN_IMPACT_RATE 16.0  // a held node's change of velocity; there below 6
#define KN_IMPACT_PRESS 0.08 // what a sphere's pressure changes by; there below 0.04
#define KN_IMPACT_WAY 0.03   // of a compressed edge's length that a held node goes; there below 0.01
#define KN_IMPACT_RECENT 0.9 // of the limit: the largest of the last second fades to it in a tenth of one
#define KN_IMPACT_AFTER 0.1

// Lines that any step of a model needs, 1 where nothing bends much. Of an error a line that is half tangent and half
// secant leaves (r - 1)/(r + 1), r: secant over tangent, 1 + s |d ln c2/ds| at most: 8 for dough, whose rest the next
// step's line takes over, some hundreds for a ramp, which yields at p1 all of a sudden. And in steps of 10 ms and more,
// longer than any hand waits for, too much happens for one line.
int kn_impact_lines(const kn_model *model);
#define KN_IMPACT_BEND 32.0
#define KN_IMPACT_LONG_S 0.01

// The limit of r.z, W; infinite for a law that is straight.
double kn_impact_power(const kn_model *model);

// contact: as found for this step; rz: r.z of the first linearisation. Never for a law that is straight. All are
// real-time safe.
bool kn_impact(const kn_model *model, const kn_state *state, const kn_contact *contact, double rz);

// Where a deadline leaves time for one or two lines, the first one must be good. A plate that makes its nodes faster by
// KN_IMPACT_BLOW times the velocity at which an edge flows brings on a field that is much the same for every material
// that flows: the one under a rigid punch on an elastic half-space, less towards the base and the sides.
//
//          |  V  |            a: half width of the plate, d: depth, R: way from the plate, r: from its axis
//     _____|_____|_____       down      V (surface + (axis - surface) d/R)
//        <- : | : ->                    surface = 1/(1 + 1.2 sqrt(R/a) + 0.8 R/a), axis = 1/(1 + 0.15 R/a + 0.22 (R/a)^2)
//           : v :             outwards  V (0.42 a d r/r'^3 - 0.21 a r/(r' (r' + d))), r'^2 = r^2 + d^2 + h^2
//
// Slow parts do not flow: below KN_IMPACT_REST x height x the strain rate at which edges flow, the field is zero. The law
// is made straight at these velocities. The field is far from exact, but most edges that will flow do so in it. With time
// for one line, a plate at 10 cm/s on dough gives more than twice its force from rest, and less than 1.1 times from here
// (tests/physics/test_deadline.c).
#define KN_IMPACT_BLOW 100.0
#define KN_IMPACT_REST 5.0

// Adds the field of every such plate to the guess, and marks every row as moved. The held nodes' velocities must be in the
// guess already. Returns whether there was such a plate.
bool kn_impact_guess(const kn_model *model, const kn_state *state, const kn_contact *contact);

#endif
