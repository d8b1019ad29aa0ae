#ifndef KN_CORE_ONEPORT_H
#define KN_CORE_ONEPORT_H
// The one-port of an element: its behaviour between its two ends, independent of its inner structure.
//
// With p = d/dt, a spring answers a strain with k, a damper with c p. Side by side, the answers add up; in a row, their
// reciprocals add up. So every element is a ratio of two polynomials with positive coefficients, stress over strain:
//
//     Z(p) = N(p)/D(p),    parallel  N = N1 D2 + N2 D1, D = D1 D2,    series  N = N1 N2, D = N1 D2 + N2 D1
//
// An element has only two kinds of part, so the poles and zeros of Z lie on the negative axis and alternate (Foster
// 1924 for LC, Cauer for RC networks). Therefore Z can always be written as Maxwell units side by side (Prony),
//
//     Z(p) = ke  +  sum of k_i p/(p + 1/tau_i), i = 1..n  +  c p
//            ^solid                                         ^viscous at once
//
// or as Voigt units in a row. The terms that occur follow from the network alone and are its class. No experiment at
// the ends can tell two elements of one class apart, however different they look.
//
//     fluid      Z(0) = 0: the element flows under any lasting load, and the flowed strain stays. This is exactly the
//                papers' residual.
//     elastic    at once: Z stays finite for p -> infinity (deg N = deg D). A step of strain meets a finite stress, and
//                a hammer meets a spring. A light mass on the element rings, because the loss G''/G' falls as
//                1/frequency. Otherwise (deg N = deg D + 1) a dashpot answers first, and a fast probe feels c, never k.
// A mass on any element with a damper comes to rest: the inside has no mass, so a motion of the ends cannot leave a
// damper out. The papers' rule for vibration can give different verdicts for two elements of one class. So the rule is
// a statement about the drawing, not about the one-port.
#include "core/element.h"

typedef struct kn_oneport {
    bool fluid;             // Z(0) = 0: the element flows under a lasting load
    bool elastic;           // Z(infinity) is finite: a step of strain meets a spring
    int relaxation;         // number n of relaxation times, i.e. of poles of Z
    int retardation;        // number of creep times, i.e. of zeros of Z except the one at 0
    int degree_n, degree_d; // degrees of numerator and denominator without common factor
    // Number of parameters that can be determined from the two ends. It is the rank of the Jacobian of Z's coefficients
    // by the parameters, at fixed arbitrary values, in integers modulo a prime, so without rounding.
    int parameters;
} kn_oneport;

// Return the one-port of an element. Parameters that cannot be told apart (s-s) count once.
kn_oneport kn_oneport_of(const kn_element *e);

bool kn_oneport_equal(const kn_oneport *a, const kn_oneport *b); // true if both belong to the same class

// Print a canonical element of the class in normal form: Maxwell units side by side, or Voigt units in a row. It has as
// many parts as the class has parameters, at most KN_ELEMENT_MAX primitives.
void kn_oneport_maxwell(const kn_oneport *o, char text[KN_ELEMENT_TEXT]);
void kn_oneport_voigt(const kn_oneport *o, char text[KN_ELEMENT_TEXT]);

// Return the usual name of the class ("Burgers", "standard linear solid", ...), or NULL if it has none.
const char *kn_oneport_name(const kn_oneport *o);

// Compute Z of the tree under a node at p = i omega by the composition above: storage and loss modulus, Pa. `moduli`:
// one value per leaf number, Pa or Pa s.
void kn_oneport_modulus(const kn_element *e, int node, const double *moduli, double omega, double *storage,
                        double *loss);

#endif
