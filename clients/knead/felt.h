#ifndef KN_CLIENTS_FELT_H
#define KN_CLIENTS_FELT_H
// Differences between two replays of a log: numerical differences, and differences that a hand would notice.
#include "clients/knead/trace.h"

// Return |a - b| / |b| of the forces over all ticks and tools, Euclidean norm. Return NAN if `b` has no force at all.
double kn_felt_force(const kn_trace *a, const kn_trace *b);

// Return |a - b| / |b| of the displacements after the last tick. Blocks with different lattices are compared at the
// nodes of `a`. There the displacement of `b` is interpolated in the cells of `b`. Return NAN for different meshes, or
// if `b` is not deformed.
double kn_felt_shape(const kn_trace *a, const kn_trace *b);

double kn_felt_peak(const kn_trace *t);      // largest force on a tool, N
double kn_felt_jump(const kn_trace *t);      // largest change from one tick to the next, N per ms
double kn_felt_variation(const kn_trace *t); // total variation of all forces, N; twice the peak in a clean press
double kn_felt_depth(const kn_trace *t);     // remaining depth of the deepest node, m

// Return the delay of the force of `a` against the force of `b` at 10 Hz, s. Hands tremble and stroke at this
// frequency. The delay is the phase of the cross spectrum, summed over 8 to 12 Hz and all tools, divided by the mean
// angular frequency in that band. The same hand moves both tools, so a common signal in that band comes from the hand.
// Return NAN if the log has nothing in that band (less than 1e-6 of the force's square).
//
//     S = sum over f of A(f) B*(f)        A(f) = sum over ticks of force exp(-2 pi i f t)        lag = -arg S/(2 pi f)
double kn_felt_lag(const kn_trace *a, const kn_trace *b);

#endif
