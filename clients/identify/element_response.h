#ifndef KN_CLIENTS_IDENTIFY_ELEMENT_RESPONSE_H
#define KN_CLIENTS_IDENTIFY_ELEMENT_RESPONSE_H
// The response of springs and dampers to a load or to a strain. A fit calls these functions thousands of times, so they
// are made fast. core/network.h solves any tree of springs and dampers to any tolerance, and serves as the reference in
// tests.
//
// ---- a Voigt chain: a spring, Voigt elements and a damper in series, integrated in time
//
//     o--/\/\--[k1|c1]--[k2|c2]-- .. --[ c(|P|) ]--o        c(P) = alpha exp(-beta clamp(|P|, P0, P1))
//
// P is the stress. Every linear one-port of springs and dampers has a chain as its Voigt form (core/oneport.h). The
// papers' element is also a chain. Compression is positive. Under a load W the stress is P = W/S0 (1 - strain), since
// area S times height h is constant, S h = S0 h0 (first paper, equation 4). If the area is taken as constant,
// P = W/S0.
//
// The time integrator is the method of core/network.h. Its embedded error estimate sets the time steps. Each stage has
// one unknown, P. Cubic Hermite polynomials interpolate between time steps. Without a load the solution has a closed
// form. Five creep curves of 433 readings take about 0.2 ms.
#include "core/material.h"
#include <stdbool.h>

#define KN_VOIGT_CHAIN_VOIGTS 3
#define KN_VOIGT_CHAIN_STEPS 64

typedef struct kn_voigt_chain {
    double spring_pa; // stiffness of the single spring [Pa]; 0: the chain has no single spring
    int voigts;       // number of Voigt elements
    // stiffness k >= 0 and damping c >= 0 of each Voigt element; at least one of the two is above 0
    double k_pa[KN_VOIGT_CHAIN_VOIGTS], c_pa_s[KN_VOIGT_CHAIN_VOIGTS];
    double alpha_pa_s; // alpha of the single damper; 0: there is no single damper
    // beta, P0 and P1 of the single damper; beta 0: its damping does not depend on the stress
    double beta_per_pa, p0_pa, p1_pa;
} kn_voigt_chain;

typedef struct kn_voigt_chain_step {
    double time_s; // time from which `value` applies [s]
    // for kn_voigt_chain_creep: nominal stress W/S0 from time_s on [Pa]; for kn_voigt_chain_stress: strain at time_s;
    // from time_s to the next step the strain changes linearly
    double value;
} kn_voigt_chain_step;

// Return the chain of the papers' element: one Voigt element k1, c1 and the damper alpha, beta, P0, P1.
kn_voigt_chain kn_voigt_chain_of(const kn_material *material);

// Compute the strain at `count` rising times. The chain is at rest, with strain 0, until step[0].time_s. At the time of
// a load step, the result is the strain just before that step. Return false if a time step does not converge or if the
// chain's parameters are out of range.
bool kn_voigt_chain_creep(const kn_voigt_chain *chain, bool constant_area, int steps, const kn_voigt_chain_step *step,
                          int count, const double *time_s, double *strain);

// Compute the stress at `count` rising times. The chain is at rest until step[0].time_s. From then on the strain
// follows step[], and the last strain is held. Two steps at one time are a jump of strain. Only a chain with a single
// spring allows a jump. At the time of a step, the result is the stress just before that step. Return false if a time
// step does not converge or if the chain's parameters are out of range.
bool kn_voigt_chain_stress(const kn_voigt_chain *chain, int steps, const kn_voigt_chain_step *step, int count,
                           const double *time_s, double *stress_pa);

// ---- a held element
//
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

// Return an element of the material that is held at a constant strain and has the stress begin_pa at time 0.
kn_held_element kn_held_element_of(const kn_material *material, double begin_pa);

// Return the time constant -P/P' at the stress P = stress_pa [s].
double kn_held_element_time(const kn_held_element *hold, double stress_pa);

// Return the time at which the stress has fallen to `stress_pa` [s]. `stress_pa` must be > 0 and <= begin_pa. A P0
// below 1e-12/beta is raised to 1e-12/beta. Return INFINITY if exp(beta P) overflows a double.
double kn_held_element_until(const kn_held_element *hold, double stress_pa);

// Compute the stress at `count` rising times >= 0. Equation (1) is inverted by a search, which starts from the stress
// at the previous time. The relative error is at most 1e-11.
void kn_held_element_stress(const kn_held_element *hold, int count, const double *time_s, double *stress_pa);

// Return the exponential integral E1(x), the integral of exp(-u)/u from x to infinity, to a relative error of 1e-15.
// The function uses the power series up to x = 1, and the continued fraction beyond (Abramowitz and Stegun, Handbook of
// Mathematical Functions, 5.1.11 and 5.1.22). Return INFINITY for x = 0 and NAN for x < 0.
double kn_exponential_integral(double x);

#endif
