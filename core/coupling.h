#ifndef KN_CORE_COUPLING_H
#define KN_CORE_COUPLING_H
// The virtual coupling: spring and damper between a device and the proxy of its tool, and how stiff it may be.
//
//     device (x, read every T)  --[ k_vc, b_vc ]--  proxy  --contact--  object      force back after the round trip t_d
//
// Two bounds for a device of mass m and viscous friction b_dev:
//     Colgate and Schenkel 1994   k < 2 (b_dev - |b_vc|) / T                passive, for any operator, without delay
//     Gil 2004, Hulin 2006        k < (b_dev + b_vc) / (T/2 + t_d)       stable in no hand at a wall, b_vc t_d << m
//     in series with a spring     k < 2 sqrt(b_dev b_vc) / (T/2 + t_d)   stable in no hand on any undamped spring
// Between them the loop is stable but may give energy to the hand: core/passivity.h is what covers that gap.
//
// Measured with the simulated device of `knead zwidth` the second bound holds less 10 to 30 %, and 35 % where b_vc nears
// its own limit; 0.6 of it is taken. Of 882 devices of 30 g to 1 kg on ways of 0 to 40 ms 10 then buzz; of 0.7 and a
// b_vc up to 0.8 m/(t_d + T) 320 did. What a class of devices has been tried with is the ceiling. Never by material:
// dough is a wall at rest and a fluid in the same press.

typedef struct kn_coupling {
    double stiffness_n_m; // k_vc
    double damping_n_s_m; // b_vc
} kn_coupling;

// For a device, where T is the period of its loop, round_trip_s t_d from a pose going out to its force coming in, and
// most the ceiling of either. round_trip_s and damping_n_s_m >= 0, all else > 0.
//     b_vc = min(most, 0.5 m / (t_d + T + 1.6 ms))       k_vc = min(most, 0.6 (b_dev + b_vc) / (T/2 + t_d))
// The 1.6 ms are the time constant of a velocity that is filtered at 100 Hz.
kn_coupling kn_coupling_default(double mass_kg, double damping_n_s_m, double period_s, double round_trip_s,
                                kn_coupling most);

// The two bounds of k_vc, N/m; Colgate's is 0 where b_vc outweighs the device's friction.
double kn_coupling_colgate(double damping_n_s_m, double period_s, double coupling_n_s_m);
double kn_coupling_delayed(double damping_n_s_m, double period_s, double round_trip_s, double coupling_n_s_m);

#endif
