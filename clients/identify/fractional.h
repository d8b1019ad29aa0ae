#ifndef KN_CLIENTS_IDENTIFY_FRACTIONAL_H
#define KN_CLIENTS_IDENTIFY_FRACTIONAL_H
// The fractional Maxwell model: two springpots in series. A springpot lies between a spring (order 0) and a damper
// (order 1). The model serves only for comparison with models of springs and dampers.
//
//     o--[ V, a ]--[ G, b ]--o    stress V d^a x/dt^a and G d^b x/dt^b,  0 <= b < a <= 1
//
//     Z(p) = 1/(1/(V p^a) + 1/(G p^b)),   J(t) = t^a/(V Gamma(1+a)) + t^b/(G Gamma(1+b))                        (1)
//     G(t) = G t^-b E_{a-b,1-b}(-(G/V) t^(a-b))                                                                 (2)
//
// E is Mittag-Leffler's function (Jaishankar and McKinley, Proc. R. Soc. A 469 (2013) 20120284). (2) is computed from
// Z(p)/p by the fixed Talbot inversion of Laplace transforms (Abate and Valko, Int. J. Numer. Meth. Engng 60 (2004)
// 979), to a relative error of 1e-10. The powers of p at time t are powers of t times the powers of p at the fixed
// nodes of the inversion. The powers at the fixed nodes are therefore computed only once.

typedef struct kn_fractional_maxwell_maxwell {
    double v_pa_s, v_order; // coefficient V of the first springpot [Pa s^a], and its order a
    double g_pa_s, g_order; // coefficient G of the second springpot [Pa s^b], and its order b
} kn_fractional_maxwell_maxwell;

// Compute the relaxation modulus at `count` times [Pa]. The strain is reached at time 0. If `ramp_s` is 0, the strain
// is a step. Otherwise the strain rises at a constant rate from -ramp_s to 0, and the result is equation (2) averaged
// over this ramp. The times must be > 0 after a step, or >= 0 after a ramp.
void kn_fractional_maxwell_relax(const kn_fractional_maxwell_maxwell *f, double ramp_s, int count, const double *time_s,
                                 double *modulus_pa);

#endif
