#ifndef KN_CLIENTS_FELT_H
#define KN_CLIENTS_FELT_H
// How one replay of a log differs from another: in numbers of the solver, and in what a hand would notice.
#include "clients/knead/trace.h"

// |a - b| / |b| over all ticks and tools, Euclidean. NAN: b has no force at all.
double kn_felt_force(const kn_trace *a, const kn_trace *b);

// |a - b| / |b| of the displacements that are left after the last tick. Of blocks with different lattices: at a's
// nodes, b's displacement being interpolated in its cells. NAN: different meshes, or b is as it was made.
double kn_felt_shape(const kn_trace *a, const kn_trace *b);

double kn_felt_peak(const kn_trace *t);      // most force on a tool, N
double kn_felt_jump(const kn_trace *t);      // worst change from one tick to the next, N per ms
double kn_felt_variation(const kn_trace *t); // total, of every tool's force, N: 2 peaks for a clean press
double kn_felt_depth(const kn_trace *t);     // how far the deepest node stays below where it was made, m

// How much later a's force comes than b's at 10 Hz, where hands tremble and stroke, s: the phase of their cross
// spectrum, summed over 8 to 12 Hz and all tools, over the mean angular frequency there. Both are moved about by the
// same hand, so what both have in that band they have from it. NAN: the log has nothing in that band (1e-6 of the
// force's square).
//
//     S = sum over f of A(f) B*(f)        A(f) = sum over ticks of force exp(-2 pi i f t)        lag = -arg S/(2 pi f)
double kn_felt_lag(const kn_trace *a, const kn_trace *b);

#endif
