#ifndef KN_CLIENTS_CONTACT_FORCE_ERROR_H
#define KN_CLIENTS_CONTACT_FORCE_ERROR_H
// Differences between two replays of a log: numerical differences, and differences that a hand would notice.
#include "clients/sweep/replay_trace.h"

// Return the relative difference |a - b| / |b| between the tool forces of two replays. | | is the Euclidean norm over
// all ticks and tools. Return NAN if `b` has no force at all.
double kn_contact_force_error(const kn_replay_trace *a, const kn_replay_trace *b);

// Return the relative difference |a - b| / |b| between the node displacements of two replays after the last tick.
// Blocks with different lattices are compared at the nodes of `a`. The displacement of `b` at these nodes is
// interpolated in the cells of `b`. Return NAN if the two replays have different meshes, or if `b` is not deformed.
double kn_contact_shape_error(const kn_replay_trace *a, const kn_replay_trace *b);

double kn_contact_force_peak(const kn_replay_trace *t); // largest force on a tool, N
// Largest change of the force on a tool from one tick to the next, N per ms.
double kn_contact_force_jump(const kn_replay_trace *t);
// Total variation of the forces on all tools over time, N; twice the peak force in a press without oscillation.
double kn_contact_force_variation(const kn_replay_trace *t);
double kn_contact_depth(const kn_replay_trace *t); // largest downward displacement of a node after the last tick, m

// Return the delay of the force of `a` against the force of `b` at 10 Hz, s. Human hands tremble and stroke at about
// this frequency. The delay is the phase of the cross spectrum, summed over 8 to 12 Hz and all tools, divided by the
// mean angular frequency in that band. The same recorded motion drives the tools of both replays, so a signal common to
// both forces comes from the hand. Return NAN if the force has less than 1e-6 of its sum of squares in that band.
//
//     S = sum over f of A(f) B*(f)        A(f) = sum over ticks of force exp(-2 pi i f t)        lag = -arg S/(2 pi f)
double kn_contact_force_lag(const kn_replay_trace *a, const kn_replay_trace *b);

#endif
