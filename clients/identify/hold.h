#ifndef KN_CLIENTS_IDENTIFY_HOLD_H
#define KN_CLIENTS_IDENTIFY_HOLD_H
// The papers' element held at a length: how its stress falls, in closed form.
//
//     +--k1--+
//     |      |--[ c2(P) ]--     c2(P) = alpha exp(-beta clamp(P, P0, P1)),     x = xv + xd held
//     +--c1--+
//
// Both parts carry P: k1 xv + c1 xv' = P and xd' = P/c2 = -xv', so k1 xv = P (1 + c1/c2(P)) at any time, and from its
// derivative, for P0 <= P <= P1, with Pi at time 0,
//
//     t = (alpha/k1) [E1(beta P) - E1(beta Pi)] + (c1/k1) [ln(Pi/P) + beta (Pi - P)]                            (1)
//
// and outside an exponential with time constant (c1 + c2(P0 or P1))/k1. So a hold knows alpha/k1, c1/k1, beta, P0, P1
// and Pi, never the scale k1: that is in how the stress came about.

typedef struct kn_hold {
    double begin_pa;    // Pi, stress at time 0, > 0
    double alpha_s;     // alpha/k1, > 0
    double c1_s;        // c1/k1, >= 0
    double beta_per_pa; // >= 0
    double p0_pa;       // >= 0; 0: never reached
    double p1_pa;       // > p0; INFINITY: never reached
} kn_hold;

// Time constant -P/P' at a stress, s.
double kn_hold_time(const kn_hold *hold, double stress_pa);

// When the stress has fallen to one of 0 < stress_pa <= begin_pa, s, from 1e-12/beta on as if that were P0. INFINITY
// where exp(beta P) is beyond a double.
double kn_hold_until(const kn_hold *hold, double stress_pa);

// Stress at count times >= 0 that rise: (1) inverted, each time from the one before, to 1e-11 of itself.
void kn_hold_stress(const kn_hold *hold, int count, const double *time_s, double *stress_pa);

#endif
