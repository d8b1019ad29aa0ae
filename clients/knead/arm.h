#ifndef KN_CLIENTS_ARM_H
#define KN_CLIENTS_ARM_H
// A simulated haptic device held by a simulated person. It computes the next pose of the device from the force that the
// renderer returns. The tests and `knead zwidth` use it, and so does the simulated hand of grasp.h.
//
//     intended path --arm spring, damper-- hand mass --grip spring, damper-- device mass -- force F (held)
//                                                                             | viscous + Coulomb friction
//                                                            encoder: position_m, every period, in steps
//
//     m x'' = F + bias - b x' - c x'/|x'| + g (X - x) + g_d (X' - x')            device
//     M X'' = a (P - X) + a_d (P' - X') - g (X - x) - g_d (X' - x')              hand
//
// x, X and P are the positions of the device, of the hand and on the intended path. m and M are the masses of device
// and hand. b is the viscous friction of the device and c its Coulomb friction. g and g_d are spring and damper of the
// grip, a and a_d spring and damper of the arm. Without a hand only the terms F + bias - b x' - c x'/|x'| remain.
//
// Position is sampled and force is held over one period (zero-order hold). Within a period the motion is integrated
// with 20 steps of semi-implicit Euler. Friction is implicit, so it never reverses a motion. The simulation is
// deterministic, computes in double precision and allocates no memory.
//
// This is a simulation: it leaves out motor current, structure and cogging. A real device has a smaller stability
// margin.
//
// The parameters of the hands are within commonly used ranges. They were chosen and not fitted to a person:
//     light    grip  300 N/m, 1 N s/m    50 g    arm 100 N/m,  1 N s/m
//     normal         800      3         100 g        300       4
//     firm          2500      8         200 g        800      10
//     none     no hand: a constant bias without the damping of a person, which is the worst case
#include "core/device.h"
#include <stdbool.h>

typedef enum kn_grip { KN_GRIP_NONE, KN_GRIP_LIGHT, KN_GRIP_NORMAL, KN_GRIP_FIRM } kn_grip;
#define KN_GRIPS 4

typedef struct kn_arm_def { // definition of a simulated device; a field that is 0 takes its default, if it has one
    double mass_kg;         // mass of the device, as felt at its tip
    double damping_n_s_m;   // viscous friction of the device
    double coulomb_n;       // Coulomb (dry) friction of the device
    double encoder_m;       // position step of the encoder; 0: the encoder is exact
    double force_limit_n;   // largest |force| that the device can give; 0: no limit
    double period_s;        // period at which position is sampled and force is held; default 1 ms
    double velocity_hz;     // cut-off frequency of the low-pass that measures the velocity, default 100 Hz
    // 1: the device moves freely along z only, and x, y follow the path; 3 (default): x, y and z are free
    int axes;
    kn_grip grip;
    double bias_n[3]; // constant external force on the device, with or without a hand
} kn_arm_def;

typedef struct kn_arm { // state of a simulated device and hand; the caller only reads it
    kn_arm_def def;
    double position_m[3]; // encoder reading at the last sample
    // Measured velocity: difference of the encoder readings, after a first-order low-pass.
    double velocity_m_s[3];
    double force_n[3];             // force on the device during the last period, after saturation at force_limit_n
    double x_m[3], v_m_s[3];       // true position and velocity of the device
    double hand_m[3], hand_m_s[3]; // true position and velocity of the hand
} kn_arm;

// Return the definition of a simulated device with the mass, friction, encoder and force limit of a device profile. All
// axes are free, and no hand holds the device.
kn_arm_def kn_arm_of(const kn_device_def *device);

// Place the simulated device and the hand that holds it at rest at the position `at_m`. `def` is copied.
void kn_arm_init(kn_arm *arm, const kn_arm_def *def, const double at_m[3]);

// Advance the simulation of device and hand by one sampling period. `force_n` is the force on the device, computed from
// arm->position_m and held over the period. `path_m` and `path_m_s` are position and velocity of the intended path at
// the beginning of the period. Without a hand the path affects only the axes that cannot move. Afterwards
// arm->position_m is the next encoder reading. The work done on the device is the scalar product of force_n and the
// change of position_m.
void kn_arm_tick(kn_arm *arm, const double force_n[3], const double path_m[3], const double path_m_s[3]);

const char *kn_grip_name(kn_grip grip); // name of the grip: "none", "light", "normal" or "firm"
bool kn_grip_find(const char *name, kn_grip *grip);
extern const char kn_grip_names[]; // all names, for messages: "none, light, normal or firm"

#endif
