#ifndef KN_CLIENTS_IDENTIFY_ELEMENT_RESPONSE_H
#define KN_CLIENTS_IDENTIFY_ELEMENT_RESPONSE_H
// A chain: a spring, Voigt elements and a damper in series. The functions compute the creep of a chain under steps of
// load, or the stress of a chain while its strain follows straight lines. A fit calls the functions thousands of times,
// so they are made fast.
//
//     o--/\/\--[k1|c1]--[k2|c2]-- .. --[ c(|P|) ]--o        c(P) = alpha exp(-beta clamp(|P|, P0, P1))
//
// P is the stress. Every linear one-port of springs and dampers has a chain as its Voigt form (core/oneport.h). The
// papers' element is also a chain. Compression is positive. Under a load W the stress is P = W/S0 (1 - strain), since
// area S times height h is constant, S h = S0 h0 (first paper, equation 4). If the area is taken as constant,
// P = W/S0.
//
// The time integrator is the L-stable diagonally implicit Runge-Kutta method of order 4 in Hairer and Wanner, Solving
// ODEs II, table IV.6.5. Its embedded error estimate sets the time steps. Each stage has one unknown, P. Cubic Hermite
// polynomials interpolate between time steps. Without a load the solution has a closed form. Five creep curves of 433
// readings take about 0.2 ms. core/network.h solves any tree of springs and dampers to any tolerance, and serves as the
// reference in tests.
#include <stdbool.h>

#define KN_VOIGT_CHAIN_VOIGTS 3
#define KN_VOIGT_CHAIN_STEPS 64

typedef struct kn_voigt_chain {
    double spring_pa; // stiffness of the single spring [Pa]; 0: the chain has no single spring
    int voigts;       // number of Voigt elements
    double k_pa[KN_VOIGT_CHAIN_VOIGTS], c_pa_s[KN_VOIGT_CHAIN_VOIGTS]; // k >= 0, c >= 0, not both 0
    double alpha_pa_s;                                                 // 0: the chain has no single damper
    double beta_per_pa, p0_pa, p1_pa; // beta 0: the damping c(P) does not depend on the stress
} kn_voigt_chain;

typedef struct kn_voigt_chain_step {
    double time_s; // time from which `value` applies [s]
    // for kn_voigt_chain_creep: nominal stress W/S0 from time_s on [Pa]; for kn_voigt_chain_stress: strain at time_s, from where
    // the strain changes linearly up to the next step
    double value;
} kn_voigt_chain_step;

// Return the damping c(P) of the chain's single damper at the stress P [Pa s].
double kn_voigt_chain_viscosity(const kn_voigt_chain *chain, double stress_pa);

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

#endif
