#ifndef KN_CORE_PASSIVITY_H
#define KN_CORE_PASSIVITY_H
// The passivity observer and controller of a client that drives a device: a virtual object may give back the energy
// that was put into it, and no more. After Hannaford and Ryu 2002, on the force that really goes to the motors:
//
//     wanted force --> kn_passivity_filter --> guard, clamp, gain --> motors, held for T --> kn_passivity_sent
//                       observe x_n, damp                                     F_n
//
//     observe   G += F_n . (x_{n+1} - x_n)     energy given to the hand; exact, because F_n is held and x is read at
//               both ends. credit -= (that - q/2 |F_n - F_{n-1}|), because an encoder of step q leaves an error of that
//               size in the sum of F dx (summed by parts). Then credit = min(credit, cap)
//     cap       |F|^2 / (2 k_vc) + U + reserve     energy stored by coupling and object, plus 1 mJ. So long kneading,
//               which only takes energy, does not earn a store that could be returned at once
//     damp      credit < 0: F = wanted - a v,  a = min(a_max, -credit / (T |v|^2)),  a_max = min(10 N s/m,
//               m / 2 (T + t_d + 1/w_f)); a stronger damper gives energy, because it is late
//     forgive   if no force is wanted, a debt fades with a time constant of 100 ms and does not drag at a hand in air
//
// w_f is the cut-off frequency velocity_hz in rad/s. With the couplings of core/coupling.h and a round trip of one
// period, the controller does not act. It is a guard, not a part of the feel. It cannot repair a limit on the rate of
// the force.
//
// Three axes, SI units, one frame for all vectors. For rotation use a second instance, with torque, angle and inertia
// in place of force, position and mass. If the force is scaled, all values are those at the hand, e.g. k_vc times the
// scale. Pure functions; no allocation.
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_passivity_def { // a field of 0 takes its default
    double mass_kg;               // mass of the device, > 0
    double period_s;              // sampling period T, default 1 ms
    double round_trip_s;          // time t_d from sending a pose to receiving its force, >= 0
    double velocity_hz;           // cut-off frequency of velocity_m_s, default 100 Hz
    double coupling_n_m;          // stiffness k_vc of the virtual coupling at the hand, > 0
    double force_limit_n;         // largest |force| of the device, > 0
    // Step q of the encoder, default 0: positions are exact. If a real encoder's q is left out, light touches chatter,
    // because the controller damps for energy that was never given.
    double encoder_m;
    double reserve_j;         // energy allowed in addition to the stored energy, default 1 mJ
    double damping_max_n_s_m; // largest damping a_max, default as above
} kn_passivity_def;

typedef struct kn_passivity {         // read-only for the caller
    kn_passivity_def def;             // defaults filled in
    double credit_j;                  // energy that may be given to the hand; below 0: a debt
    double given_j;                   // net energy given to the hand since init; < 0: the hand has put in more
    double forgiven_j;                // sum of the energy debts that faded while no force was wanted
    int64_t acted;                    // number of periods in which the controller added damping
    double damping_n_s_m;             // damping a that the controller adds in this period
    double position_m[3], force_n[3]; // position at the last sample, and force held since the last sample
    double before_n[3];               // force held in the period before the last sample
    bool running;                     // at least one sample has been observed
} kn_passivity;

void kn_passivity_init(kn_passivity *p, const kn_passivity_def *def);

// Observe a sample and filter the wanted force. Call at every sample. `velocity_m_s`: filtered velocity for the
// damping. `stored_j`: elastic energy of the object, at the hand, that the hand has put in and may get back. If
// stored_j < 0, the stored energy is unknown, and the whole cap is max(5 mJ, limit^2 / k_vc). out_n and wanted_n may be
// the same array. Return true if the damper acted. The first position, or one that is not finite, observes nothing.
bool kn_passivity_filter(kn_passivity *p, const double position_m[3], const double velocity_m_s[3], double stored_j,
                         const double wanted_n[3], double out_n[3]);

// Record the force that the motors finally got. The motors hold this force until the next sample.
void kn_passivity_sent(kn_passivity *p, const double force_n[3]);

#endif
