#ifndef KN_CLIENTS_IDENTIFY_FRACTIONAL_H
#define KN_CLIENTS_IDENTIFY_FRACTIONAL_H
// The fractional Maxwell model, a yardstick beside springs and dampers: two springpots in a row, each between a spring
// (order 0) and a damper (order 1).
//
//     o--[ V, a ]--[ G, b ]--o    stress V d^a x/dt^a and G d^b x/dt^b,  0 <= b < a <= 1
//
//     Z(p) = 1/(1/(V p^a) + 1/(G p^b)),   J(t) = t^a/(V Gamma(1+a)) + t^b/(G Gamma(1+b))                        (1)
//     G(t) = G t^-b E_{a-b,1-b}(-(G/V) t^(a-b))                                                                 (2)
//
// with Mittag-Leffler's function E (Jaishankar and McKinley, Proc. R. Soc. A 469 (2013) 20120284). (2) is found from
// Z(p)/p by the fixed Talbot inversion of Laplace transforms (Abate and Valko, Int. J. Numer. Meth. Engng 60 (2004)
// 979), to 1e-10 of itself; the powers of p at its nodes are those of the nodes times those of t.

typedef struct kn_fractional {
    double v_pa_s, v_order; // V, Pa s^a; a
    double g_pa_s, g_order; // G, Pa s^b; b
} kn_fractional;

// Relaxation modulus at count times after a strain that was reached at time 0, Pa: after a step, or at a steady rate
// within ramp_s before; then (2) is averaged over it. time_s > 0, or >= 0 after a ramp.
void kn_fractional_relax(const kn_fractional *f, double ramp_s, int count, const double *time_s, double *modulus_pa);

#endif
