#ifndef KN_CORE_PASSIVITY_H
#define KN_CORE_PASSIVITY_H
// The passivity observer and controller of a client that drives a device: a virtual object may give back the energy
// that was put into it, and no more. After Hannaford and Ryu 2002, on the force that really goes to the motors:
//
//     wanted force --> kn_passivity_filter --> guard, clamp, gain --> motors, held for T --> kn_passivity_sent
//                       observe x_n, damp                                     F_n
//
//     observe   W = F_n . (x_{n+1} - x_n)      energy given to the hand in a period; exact, because F_n is held and x
//               is read at both ends. credit -= W - q/2 |F_n - F_{n-1}|, because an encoder of step q leaves an error
//               of this size in the sum of F dx (summed by parts). Then credit = min(credit, cap)
//     cap       |F|^2 / (2 k_vc) + U + reserve     energy stored by coupling and object (U), plus 1 mJ. So long
//               kneading, which only takes energy from the hand, earns no credit that could be returned at once
//     damp      credit < 0: F = wanted - a v,  a = min(a_max, -credit / (T |v|^2)),  a_max = min(10 N s/m,
//               m / (2 (T + t_d + 1/w_f))); a stronger damper gives energy, because the velocity is late
//     forgive   if no force is wanted, a debt fades with a time constant of 100 ms and does not drag at a hand in air
//
// w_f is the cut-off frequency velocity_hz in rad/s. With the couplings of core/coupling.h and a round trip of one
// period, the controller does not act. The controller is a guard, not a part of the feel. It cannot make a loop passive
// in which the rate of the force is limited.
//
// Three axes, SI units, one frame for all vectors. For rotation use a second instance, with torque, angle and inertia
// in place of force, position and mass. If the force is scaled, all values are those at the hand, e.g. k_vc times the
// scale. The struct is plain data of the caller. All functions are real-time safe.
#include <stdbool.h>
#include <stdint.h>

typedef struct kn_passivity_def { // a field of 0 takes its default
    double mass_kg;               // mass of the device, > 0
    double period_s;              // sampling period T, default 1 ms
    double round_trip_s;          // time t_d from sending a pose to receiving its force, >= 0
    double velocity_hz;           // cut-off frequency of velocity_m_s, default 100 Hz
    double coupling_n_m;          // stiffness k_vc of the virtual coupling at the hand, > 0
    double force_limit_n;         // largest |force| of the device, > 0
    // Step q of the encoder; default 0: positions are exact. If q of a real encoder is left out, the force chatters in
    // light touches, because the controller damps energy that was never given.
    double encoder_m;
    double reserve_j;         // energy allowed in addition to the stored energy, default 1 mJ
    double damping_max_n_s_m; // largest damping a_max, default min(10 N s/m, m / (2 (T + t_d + 1/(2 pi velocity_hz))))
} kn_passivity_def;

typedef struct kn_passivity {         // state of observer and controller; the caller may read it
    kn_passivity_def def;             // defaults filled in
    double credit_j;                  // energy that may still be given to the hand; < 0: a debt
    double given_j;                   // net energy given to the hand since init; < 0: the hand has put in more
    double forgiven_j;                // sum of the energy debts that faded while no force was wanted
    int64_t acted;                    // number of periods in which the controller added damping
    double damping_n_s_m;             // damping a that the controller adds in this period
    double position_m[3], force_n[3]; // position_m: at the last sample; force_n: held since the last sample
    double before_n[3];               // force held in the period before the last sample
    bool running;                     // at least one sample has been observed
} kn_passivity;

// Copy `def`, fill in its defaults, and start with a credit of 0.
void kn_passivity_init(kn_passivity *p, const kn_passivity_def *def);

// Observe a sample, and store the wanted force in out_n, with damping if there is a debt. Call once per period.
// `velocity_m_s`: filtered velocity for the damping. `stored_j`: energy U that the object stores and that the hand may
// get back, at the scale of the hand. If stored_j < 0, U is unknown, and the credit is at most max(5 mJ,
// force_limit_n^2 / k_vc). out_n and wanted_n may be the same array. Return true if the controller added damping. The
// first position adds no work to the account, and neither does a position that is not finite.
bool kn_passivity_filter(kn_passivity *p, const double position_m[3], const double velocity_m_s[3], double stored_j,
                         const double wanted_n[3], double out_n[3]);

// Record the force that the motors finally got, after guard, clamp and gain. The motors hold this force until the next
// sample.
void kn_passivity_sent(kn_passivity *p, const double force_n[3]);

#endif
