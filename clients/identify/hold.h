#ifndef KN_CLIENTS_IDENTIFY_HOLD_H
#define KN_CLIENTS_IDENTIFY_HOLD_H
// The stress over time of the papers' element that is held at a constant length, in closed form.
//
//     +--k1--+
//     |      |--[ c2(P) ]--     c2(P) = alpha exp(-beta clamp(P, P0, P1)),     x = xv + xd = constant
//     +--c1--+
//
// P is the stress, xv the strain of the Voigt element, xd the strain of the damper. Both parts carry the stress P: k1
// xv + c1 xv' = P and xd' = P/c2 = -xv', so k1 xv = P (1 + c1/c2(P)) at any time. The derivative of this equation
// gives, for P0 <= P <= P1, with the stress Pi at time 0,
//
//     t = (alpha/k1) [E1(beta P) - E1(beta Pi)] + (c1/k1) [ln(Pi/P) + beta (Pi - P)]                            (1)
//
// Outside this range P decays exponentially with the time constant (c1 + c2)/k1, where c2 is taken at P0 or at P1. A
// hold thus determines alpha/k1, c1/k1, beta, P0, P1 and Pi, but never the scale k1. Only the rise of the stress
// determines k1.

typedef struct kn_held_element {
    double begin_pa;    // stress Pi at time 0, > 0
    double alpha_s;     // alpha/k1, > 0
    double c1_s;        // c1/k1, >= 0
    double beta_per_pa; // beta, >= 0
    double p0_pa;       // P0, >= 0; 0: the stress never falls to P0
    double p1_pa;       // P1, > P0; INFINITY: the stress never exceeds P1
} kn_held_element;

// Return the time constant -P/P' at the stress P = stress_pa [s].
double kn_held_element_time(const kn_held_element *hold, double stress_pa);

// Return the time at which the stress has fallen to `stress_pa` [s]. `stress_pa` must be > 0 and <= begin_pa. If P0 is
// below 1e-12/beta, the value 1e-12/beta replaces P0. Return INFINITY if exp(beta P) overflows a double.
double kn_held_element_until(const kn_held_element *hold, double stress_pa);

// Compute the stress at `count` rising times >= 0. Equation (1) is inverted by a search, which starts from the stress
// at the previous time. The relative error is at most 1e-11.
void kn_held_element_stress(const kn_held_element *hold, int count, const double *time_s, double *stress_pa);

#endif
