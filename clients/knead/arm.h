#ifndef KN_CLIENTS_ARM_H
#define KN_CLIENTS_ARM_H
// A simulated haptic device with a person on it: what a force that comes back does to the next pose. For tests, for
// `knead zwidth`, and for a hand that closes the loop without hardware.
//
//     intended path --arm spring, damper-- hand mass --grip spring, damper-- device mass -- force F (held)
//                                                                             | viscous + Coulomb friction
//                                                            encoder: position_m, every period, in steps
//
//     m x'' = F + bias - b x' - c x'/|x'| + g (X - x) + g_d (X' - x')            device
//     M X'' = a (P - X) + a_d (P' - X') - g (X - x) - g_d (X' - x')              hand; none: the bias alone pushes
//
// Position is sampled and force is held over one period (zero-order hold), 20 steps of semi-implicit Euler within it,
// friction taken implicitly so that it never reverses a motion. Deterministic, double, no allocation. SIMULATION: motor
// current, structure and cogging are left out, and real devices have less room than this one.
//
// The hands are within commonly used ranges; they were chosen, not fitted to a person:
//     light    grip  300 N/m, 1 N s/m    50 g    arm 100 N/m,  1 N s/m
//     normal         800      3         100 g        300       4
//     firm          2500      8         200 g        800      10
//     none     no hand: a constant bias, no damping of a person; the worst case
#include "core/device.h"
#include <stdbool.h>

typedef enum kn_grip { KN_GRIP_NONE, KN_GRIP_LIGHT, KN_GRIP_NORMAL, KN_GRIP_FIRM } kn_grip;
#define KN_GRIPS 4

typedef struct kn_arm_def { // zero means default where there is one
    double mass_kg;         // of the device as felt at its tip
    double damping_n_s_m;   // viscous
    double coulomb_n;       // dry friction
    double encoder_m;       // step of a position as read; 0: exact
    double force_limit_n;   // saturation of |force|; 0: none
    double period_s;        // of sampling and holding, default 1 ms
    double velocity_hz;     // cut-off of the measured velocity, default 100 Hz
    int axes;               // 1: z moves and x, y follow the path; 3 (default): all
    kn_grip grip;
    double bias_n[3]; // constant push on the device, whatever the hand
} kn_arm_def;

typedef struct kn_arm { // read only for the caller
    kn_arm_def def;
    double position_m[3];          // as the encoder reads it at the last sample
    double velocity_m_s[3];        // first-order filtered difference of those
    double force_n[3];             // held during the last tick, after saturation
    double x_m[3], v_m_s[3];       // the device as it is
    double hand_m[3], hand_m_s[3]; // the hand as it is
} kn_arm;

// Of a device's profile, all axes, in no hand.
kn_arm_def kn_arm_of(const kn_device_def *device);

// At rest at at_m, the hand with it. def is copied.
void kn_arm_init(kn_arm *arm, const kn_arm_def *def, const double at_m[3]);

// One period. force_n: on the device, worked out of arm->position_m; it is held. path_m, path_m_s: where the intended
// path is at the beginning of the period and how fast it goes on; without a hand only the axes that cannot move care.
// Afterwards position_m is the next sample: the work done on the device is force_n . (new - old position_m).
void kn_arm_tick(kn_arm *arm, const double force_n[3], const double path_m[3], const double path_m_s[3]);

const char *kn_grip_name(kn_grip grip); // "none", "light", "normal", "firm"
bool kn_grip_find(const char *name, kn_grip *grip);
extern const char kn_grip_names[]; // "none, light, normal or firm"

#endif
