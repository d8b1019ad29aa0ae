#ifndef KN_CLIENTS_IDENTIFY_SPECIAL_H
#define KN_CLIENTS_IDENTIFY_SPECIAL_H
// Functions that the C library lacks, for relaxation in closed form.

// Exponential integral E1(x) = integral of exp(-u)/u from x to infinity, x > 0, to 1e-15 of itself: its power series
// up to 1, beyond it the continued fraction (Abramowitz and Stegun, Handbook of Mathematical Functions, 5.1.11 and
// 5.1.22). INFINITY at 0, NAN below.
double kn_e1(double x);

#endif
