#ifndef KN_CORE_PASSIVITY_H
#define KN_CORE_PASSIVITY_H
// The passivity observer and controller of a client that drives a device: a virtual object may give back what was put
// into it, and no more. After Hannaford and Ryu 2002, on the force that really goes to the motors:
//
//     wanted force --> kn_passivity_filter --> guard, clamp, gain --> motors, held for T --> kn_passivity_sent
//                       observe x_n, damp                                     F_n
//
//     observe   G += F_n . (x_{n+1} - x_n)     energy given to the hand: exact, for F_n is held and x read at both ends
//               credit -= the same but for the q/2 |F_n - F_{n-1}| that an encoder of step q cannot tell from nothing:
//               by parts, the sum of F dx is wrong by that. Then credit = min(credit, cap)
//     cap       |F|^2 / (2 k_vc) + U + reserve     what coupling and object have stored, and 1 mJ: long kneading, which
//               only takes energy, does not earn a store that could be returned at once
//     damp      credit < 0: F = wanted - a v,  a = min(a_max, -credit / (T |v|^2)),  a_max = min(10 N s/m, m / 2 (T +
//               t_d + 1/w_f)), beyond which the damper, being late, gives energy
//     forgive   with no force wanted a debt fades with a time constant of 100 ms instead of dragging at a hand in air
//
// With the couplings of core/coupling.h and a round trip of one period it does not act: it is a guard, not a part of
// how things feel. It cannot repair a limit on the rate of the force.
//
// Three axes, SI, one frame for all vectors. Rotation: a second one, where torque, angle and inertia stand for force,
// position and mass. With a scaled force everything is the hand's: k_vc times the scale. Pure; no allocation.
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_passivity_def { // 0 in a field = its default
    double mass_kg;               // of the device, > 0
    double period_s;              // T, default 1 ms
    double round_trip_s;          // t_d, >= 0
    double velocity_hz;           // cut-off of the velocity that is given, default 100 Hz
    double coupling_n_m;          // k_vc at the hand, > 0
    double force_limit_n;         // of the device, > 0
    double encoder_m;         // q, default 0: positions are exact. Without it light touches chatter, being damped for
                              // energy that there never was
    double reserve_j;         // default 1 mJ
    double damping_max_n_s_m; // default as above
} kn_passivity_def;

typedef struct kn_passivity {         // read only for the caller
    kn_passivity_def def;             // defaults filled in
    double credit_j;                  // that may be given to the hand; below 0 a debt
    double given_j;                   // net, since init; what the hand put in counts below 0
    double forgiven_j;                // of debts, in air
    int64_t acted;                    // periods with damping
    double damping_n_s_m;             // in this period
    double position_m[3], force_n[3]; // at the last sample, and held since
    double before_n[3];               // held before that
    bool running;                     // there was a sample
} kn_passivity;

void kn_passivity_init(kn_passivity *p, const kn_passivity_def *def);

// At every sample. velocity_m_s: as filtered for damping. stored_j: elastic energy of the object that the hand has put
// in and may have back, at the hand; below 0: the caller does not know, the whole cap is max(5 mJ, limit^2 / k_vc).
// out_n may be wanted_n. Whether it acted. A position that is not finite, or the first one, observes nothing.
bool kn_passivity_filter(kn_passivity *p, const double position_m[3], const double velocity_m_s[3], double stored_j,
                         const double wanted_n[3], double out_n[3]);

// What the motors were given in the end: it is held until the next sample.
void kn_passivity_sent(kn_passivity *p, const double force_n[3]);

#endif
