#ifndef KN_CLIENTS_IDENTIFY_CHAIN_H
#define KN_CLIENTS_IDENTIFY_CHAIN_H
// A chain: a spring, Voigt elements and a damper in series. The functions compute the creep of a chain under steps of
// load, or its stress while the strain follows straight lines. They are fast, since a fit calls them thousands of
// times.
//
//     o--/\/\--[k1|c1]--[k2|c2]-- .. --[ c(|P|) ]--o        c(P) = alpha exp(-beta clamp(|P|, P0, P1))
//
// P is the stress. Every linear one-port of springs and dampers has such a chain as its Voigt form (core/oneport.h).
// The papers' element is a chain, too. Compression is positive. Under a load W the stress is P = W/S0 (1 - strain),
// since area times height is constant, S h = S0 h0 (first paper, equation 4). If the area is taken as constant, P =
// W/S0.
//
// The time integrator is the L-stable diagonally implicit Runge-Kutta method of order 4 in Hairer and Wanner, Solving
// ODEs II, table IV.6.5. Its embedded error estimate sets the time steps. Each stage has one unknown, P. Cubic Hermite
// polynomials interpolate between time steps. Without a load the solution has a closed form. Five creep curves of 433
// readings take about 0.2 ms. core/network.h solves any tree of springs and dampers to any tolerance, and serves as the
// reference in tests.
#include <stdbool.h>

#define KN_CHAIN_VOIGTS 3
#define KN_CHAIN_STEPS 64

typedef struct kn_chain {
    double spring_pa; // 0: no spring
    int voigts;
    double k_pa[KN_CHAIN_VOIGTS], c_pa_s[KN_CHAIN_VOIGTS]; // k >= 0, c >= 0, not both 0
    double alpha_pa_s;                                     // 0: no damper
    double beta_per_pa, p0_pa, p1_pa;                      // beta 0: constant damper
} kn_chain;

typedef struct kn_chain_step {
    double time_s; // the step applies from this time on
    // kn_chain_creep: nominal stress W/S0, Pa; kn_chain_stress: strain at this time, linear up to the next step
    double value;
} kn_chain_step;

double kn_chain_viscosity(const kn_chain *chain, double stress_pa);

// Compute the strain at `count` rising times. The chain is at rest, with strain 0, until step[0].time_s. At the time of
// a load step the strain is the one just before the step. Return false if a time step does not converge or if the
// parameters are out of range.
bool kn_chain_creep(const kn_chain *chain, bool constant_area, int steps, const kn_chain_step *step, int count,
                    const double *time_s, double *strain);

// Compute the stress at `count` rising times. The chain is at rest until step[0].time_s. From then on the strain
// follows step[], and the last strain is held. Two steps at one time are a jump of strain; only a chain with a spring
// allows a jump. At the time of a step the stress is the one just before the step.
bool kn_chain_stress(const kn_chain *chain, int steps, const kn_chain_step *step, int count, const double *time_s,
                     double *stress_pa);

#endif
