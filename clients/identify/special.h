#ifndef KN_CLIENTS_IDENTIFY_SPECIAL_H
#define KN_CLIENTS_IDENTIFY_SPECIAL_H
// Mathematical functions that the C library lacks. The closed form of relaxation (hold.h) needs them.

// Return the exponential integral E1(x), the integral of exp(-u)/u from x to infinity, to a relative error of 1e-15.
// The function uses the power series up to x = 1, and the continued fraction beyond (Abramowitz and Stegun, Handbook of
// Mathematical Functions, 5.1.11 and 5.1.22). Return INFINITY for x = 0 and NAN for x < 0.
double kn_exponential_integral(double x);

#endif
