#ifndef KN_CORE_COUPLING_H
#define KN_CORE_COUPLING_H
// The virtual coupling: a spring and a damper between a haptic device and the proxy of its tool, and the bounds of the
// spring's stiffness. All functions are pure and real-time safe.
//
//     device (x, read every T)  --[ k_vc, b_vc ]--  proxy  --contact--  object      force back after the round trip t_d
//
// Two bounds for a device of mass m and viscous friction b_dev:
//     Colgate and Schenkel 1994   k < 2 (b_dev - |b_vc|) / T             passive for any operator, without delay
//     Gil 2004, Hulin 2006        k < (b_dev + b_vc) / (T/2 + t_d)       stable at a wall with no hand, b_vc t_d << m
//     in series with a spring     k < 2 sqrt(b_dev b_vc) / (T/2 + t_d)   stable on any undamped spring with no hand
// Between the two bounds the loop is stable but may give energy to the hand: core/passivity.h covers that gap.
//
// Measured with the simulated device of `knead zwidth`, the limit of stability lies 10 to 30 % below the second bound,
// and 35 % below if b_vc is near its own limit. So the default k_vc is 0.6 of the second bound. With it, 10 of
// 882 simulated devices (30 g to 1 kg, round trips of 0 to 40 ms) vibrate. With 0.7 of the bound and b_vc up to 0.8
// m/(t_d + T), 320 of them vibrated. The ceiling `most` is the coupling with which a class of devices has been tried.
// The coupling never depends on the material, because dough at rest feels like a wall, and in the same press it becomes
// a fluid.

typedef struct kn_coupling {
    double stiffness_n_m; // stiffness k_vc of the coupling [N/m]
    double damping_n_s_m; // damping b_vc of the coupling [N s/m]
} kn_coupling;

// Return the default coupling of a device. mass_kg is the mass m at the tip, damping_n_s_m the viscous friction b_dev,
// period_s the period T of the device's loop, and round_trip_s the time t_d from sending a pose to receiving its force.
// `most` is the ceiling of both results. round_trip_s and damping_n_s_m must be >= 0, all others > 0.
//     b_vc = min(most, 0.5 m / (t_d + T + 1.6 ms))       k_vc = min(most, 0.6 (b_dev + b_vc) / (T/2 + t_d))
// 1.6 ms is the time constant of a velocity that is filtered at 100 Hz.
kn_coupling kn_coupling_default(double mass_kg, double damping_n_s_m, double period_s, double round_trip_s,
                                kn_coupling most);

// Return an upper bound of the coupling stiffness k_vc, N/m. kn_coupling_colgate returns Colgate's bound, below which
// the device is passive. This bound is 0 if b_vc (coupling_n_s_m) exceeds the device's friction b_dev (damping_n_s_m).
// kn_coupling_delayed returns the bound with delay, below which the device is stable at a wall.
double kn_coupling_colgate(double damping_n_s_m, double period_s, double coupling_n_s_m);
double kn_coupling_delayed(double damping_n_s_m, double period_s, double round_trip_s, double coupling_n_s_m);

#endif
