#ifndef KN_CLIENTS_IDENTIFY_CHAIN_H
#define KN_CLIENTS_IDENTIFY_CHAIN_H
// What a fit asks thousands of times: how a row of a spring, Voigt units and a damper creeps under steps of load, or
// what stress it carries while its strain follows straight lines.
//
//     o--/\/\--[k1|c1]--[k2|c2]-- .. --[ c(|P|) ]--o        c(P) = alpha exp(-beta clamp(|P|, P0, P1))
//
// Every linear one-port of springs and dampers is such a row (core/oneport.h, its Voigt form), and so is the papers'
// element. Compression is positive. Under a load the stress is W/S0 (1 - strain), since S h = S0 h0 (first paper,
// equation 4), or W/S0 where the area is taken as constant.
//
// In time: the L-stable diagonally implicit Runge-Kutta method of order 4 in Hairer and Wanner, Solving ODEs II, table
// IV.6.5, steps by its embedded error, one unknown per stage, P; between steps cubic Hermite. Without a load the row is
// in closed form. Five creeps of 433 readings take some 0.2 ms. core/network.h does the same for any tree and to any
// tolerance: it is the oracle of this.
#include <stdbool.h>

#define KN_CHAIN_VOIGTS 3
#define KN_CHAIN_STEPS 64

typedef struct kn_chain {
    double spring_pa; // 0: none
    int voigts;
    double k_pa[KN_CHAIN_VOIGTS], c_pa_s[KN_CHAIN_VOIGTS]; // k >= 0, c >= 0, not both 0
    double alpha_pa_s;                                     // 0: no damper
    double beta_per_pa, p0_pa, p1_pa;                      // beta 0: constant
} kn_chain;

typedef struct kn_chain_step {
    double time_s; // from here on
    double value;  // creep: nominal stress W/S0, Pa; strain drive: the strain at this time, straight to the next
} kn_chain_step;

double kn_chain_viscosity(const kn_chain *chain, double stress_pa);

// Strain at times that rise, from rest at step[0].time_s on (before it 0); at a step that before it. False: no step
// converged, absurd numbers.
bool kn_chain_creep(const kn_chain *chain, bool constant_area, int steps, const kn_chain_step *step, int count,
                    const double *time_s, double *strain);

// Stress at times that rise, from rest at step[0].time_s on, while the strain follows step[]; the last strain is held.
// Two steps at one time are a jump of strain, which only a row with a spring allows. At a corner the stress is that
// before it.
bool kn_chain_stress(const kn_chain *chain, int steps, const kn_chain_step *step, int count, const double *time_s,
                     double *stress_pa);

#endif
