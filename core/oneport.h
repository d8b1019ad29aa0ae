#ifndef KN_CORE_ONEPORT_H
#define KN_CORE_ONEPORT_H
// The one-port of an element: its behaviour between its two ends, independent of its inner structure.
//
// With p = d/dt, the ratio Z of stress to strain is k for a spring and c p for a damper. The Z of parts in parallel add
// up; in series, the reciprocals 1/Z add up. So Z of every element is a ratio of two polynomials with positive
// coefficients:
//
//     Z(p) = N(p)/D(p),    parallel  N = N1 D2 + N2 D1, D = D1 D2,    series  N = N1 N2, D = N1 D2 + N2 D1
//
// An element has only two kinds of part, so the poles and zeros of Z lie on the negative axis and alternate (Foster
// 1924 for LC, Cauer for RC networks). Therefore Z can always be written as Maxwell units in parallel (Prony),
//
//     Z(p) = ke  +  sum of k_i p/(p + 1/tau_i), i = 1..n  +  c p
//            ^solid                                         ^viscous at once
//
// or as Voigt units in series. The arrangement of the parts alone determines which terms occur. The set of terms is the
// class of the element. No experiment at the ends can tell two elements of one class apart, however different they
// look.
//
//     fluid      Z(0) = 0: the element flows under any lasting load, and the flowed strain stays. This is exactly the
//                papers' residual.
//     elastic    Z stays finite for p -> infinity (deg N = deg D): a step of strain causes a finite stress, as in a
//                spring. A light mass on the element rings, because the loss G''/G' falls as 1/frequency. If the
//                element is not elastic (deg N = deg D + 1), a fast probe feels a dashpot c, never a spring.
// A mass on any element with a damper comes to rest: the element itself has no mass, so no motion of its ends leaves
// all dampers at rest. The papers' rule for vibration can give different results for two elements of one class. So the
// rule is a statement about the drawing of an element, not about its one-port.
//
// A one-port is plain data of the caller. No function allocates.
#include "core/element.h"

typedef struct kn_oneport {
    bool fluid;             // Z(0) = 0: the element flows under a lasting load
    bool elastic;           // Z(infinity) is finite: a step of strain meets a spring
    int relaxation;         // number n of relaxation times, i.e. of poles of Z
    int retardation;        // number of creep times, i.e. of zeros of Z except the one at 0
    int degree_n, degree_d; // degrees of numerator and denominator without common factor
    // Number of parameters that an experiment at the two ends can determine. It is the rank of the matrix of
    // derivatives of Z's coefficients with respect to the parameters. The derivatives are computed in integers modulo a
    // prime, so without rounding, at arbitrary fixed values of the parameters.
    int parameters;
} kn_oneport;

// Return the one-port of an element. If two parts of the element act as one, they have one parameter together: two
// springs in series (s-s) act as one spring.
kn_oneport kn_oneport_of(const kn_element *e);

bool kn_oneport_equal(const kn_oneport *a, const kn_oneport *b); // true if both belong to the same class

// Print the canonical element of the class in normal form: Maxwell units in parallel, or Voigt units in series. The
// element has as many parts as the class has parameters, at most KN_ELEMENT_MAX.
void kn_oneport_maxwell(const kn_oneport *o, char text[KN_ELEMENT_TEXT]);
void kn_oneport_voigt(const kn_oneport *o, char text[KN_ELEMENT_TEXT]);

// Return the usual name of the class as a static text ("Burgers", "standard linear solid", ...), or NULL if the class
// has no name.
const char *kn_oneport_name(const kn_oneport *o);

// Compute Z of the tree under a node at p = i omega, omega in rad/s: the storage and the loss modulus, Pa. `moduli`:
// stiffness [Pa] or damping [Pa s] of each leaf, by leaf number.
void kn_oneport_modulus(const kn_element *e, int node, const double *moduli, double omega, double *storage,
                        double *loss);

#endif
