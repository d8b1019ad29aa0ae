#ifndef KN_CORE_ONEPORT_H
#define KN_CORE_ONEPORT_H
// What an element is between its two ends, whatever it looks like inside.
//
// With p = d/dt a spring answers a strain with k, a damper with c p; side by side the answers add up, in a row their
// reciprocals do. So every element is a ratio of two polynomials with positive coefficients, stress over strain:
//
//     Z(p) = N(p)/D(p),    parallel  N = N1 D2 + N2 D1, D = D1 D2,    series  N = N1 N2, D = N1 D2 + N2 D1
//
// and, since only two kinds of part are in it, its poles and zeros lie on the negative axis and alternate (Foster 1924
// for LC, Cauer for RC networks). It can therefore always be written as Maxwell units side by side (Prony),
//
//     Z(p) = ke  +  sum of k_i p/(p + 1/tau_i), i = 1..n  +  c p
//            ^solid                                         ^viscous at once
//
// or as Voigt units in a row. Which of the terms there are follows from the network alone and is the class: two
// elements of one class cannot be told apart by any experiment at their ends, however different they look.
//
//     fluid      Z(0) = 0: it flows under any lasting load, and what has flowed stays. Exactly the papers' residual.
//     elastic    at once: Z stays finite for p -> infinity (deg N = deg D). A step of strain meets a finite stress, a
//                hammer a spring; a light mass on it rings, for the loss G''/G' falls as 1/frequency. Otherwise
//                (deg N = deg D + 1) a dashpot answers first, and a fast probe feels c, never k.
// A mass on any element with a damper comes to rest: with nothing heavy inside there is no damper that a motion of the
// ends could leave out. The papers' rule for vibration says more than that of some elements and less of others of the
// same class; it is a statement about the picture, not about the one-port.
#include "core/element.h"

typedef struct kn_oneport {
    bool fluid;             // Z(0) = 0
    bool elastic;           // at once: Z(infinity) finite
    int relaxation;         // n, relaxation times: poles of Z
    int retardation;        // times of creep: zeros of Z but the one at 0
    int degree_n, degree_d; // of numerator and denominator without common factor
    int parameters;         // how many numbers of the element can be found from its ends: rank of the Jacobian of Z's
        // coefficients by the parameters, at fixed arbitrary ones, in integers modulo a prime: no rounding
} kn_oneport;

// Of the element as it stands; parameters that cannot be told apart (s-s) count once.
kn_oneport kn_oneport_of(const kn_element *e);

bool kn_oneport_equal(const kn_oneport *a, const kn_oneport *b); // same class

// The two canonical elements of the class as text in normal form, with as many parts as the class has parameters:
// Maxwell units side by side, Voigt units in a row. text: at most KN_ELEMENT_MAX primitives.
void kn_oneport_maxwell(const kn_oneport *o, char text[KN_ELEMENT_TEXT]);
void kn_oneport_voigt(const kn_oneport *o, char text[KN_ELEMENT_TEXT]);

// "Burgers", "standard linear solid", ...: how the field calls the class, NULL when it has no name for it.
const char *kn_oneport_name(const kn_oneport *o);

// Z of the tree under a node at p = i omega by the same composition, from moduli by leaf number (Pa, Pa s): storage and
// loss modulus, Pa.
void kn_oneport_modulus(const kn_element *e, int node, const double *moduli, double omega, double *storage,
                        double *loss);

#endif
