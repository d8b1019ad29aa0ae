#ifndef KN_CLIENTS_PAD_H
#define KN_CLIENTS_PAD_H
// Pad: a lumped model of an object under a tool. One three-element edge along z stands for the whole contact: a Voigt
// element (spring k1 parallel to damper c1) in series with the force-dependent damper c2(F). A virtual coupling (spring
// k_vc, damper b_vc) connects the device to a proxy on the surface of the pad. Simulated haptic loops use a pad,
// because a lattice would take a thousand times as long.
//
//     device --[ k_vc, b_vc ]-- proxy on the surface --[ k1 | c1 ]--[ c2(F) ]-- ground
//
//     F = Q - G w                    F: contact force at the end of the step dt
//     Q = k_vc (d - s) + b_vc d'     d: depth of the device, s: depth of the surface, d': speed of the device
//     G = b_vc + dt k_vc
//     w = (F - H)/A + F/c2(F)        w: speed of the surface at the end of the step
//     H = k1 e,  A = c1 + dt k1      e: displacement of the Voigt element, m
//
// F >= 0. After the tool has left, the displacement e of the Voigt element creeps back to 0, and the flow of damper c2
// remains. The proxy has no mass. No function allocates memory.
#include "core/coupling.h"
#include <stdbool.h>

typedef struct kn_pad_def {
    const char *name;
    // Stiffness k1 and damping c1 of the Voigt element. If both are 0, the pad is a wall: its surface never moves.
    double k1_n_m, c1_n_s_m;
    // Damping of the damper c2 at the force from_n (c2_n_s_m) and at the force to_n (c2_least_n_s_m). Between the two
    // forces the damping falls exponentially. If c2_n_s_m is 0, there is no damper c2.
    double c2_n_s_m, c2_least_n_s_m;
    double from_n, to_n;
} kn_pad_def;

// Predefined pads: a wall, dough, clay, soft jelly, stiff jelly. Each pad except the wall stands for an object under a
// probe of about 1 cm. The dampers of dough together act like 1 kN s/m at rest and like 46 N s/m while dough flows.
#define KN_PADS 5
extern const kn_pad_def kn_pads[KN_PADS];

typedef struct kn_pad { // state of a pad; read-only for the caller
    kn_pad_def def;
    // Displacement of the Voigt element (voigt_m) and of the damper c2 (flow_m). The depth of the pad's surface is
    // voigt_m + flow_m.
    double voigt_m, flow_m;
    double force_n;
    bool touching;
} kn_pad;

// Reset the pad: undeformed and untouched.
void kn_pad_init(kn_pad *pad, const kn_pad_def *def);

// Advance the pad by one step of dt_s. depth_m: depth of the device below the undeformed surface, negative above it.
// speed_m_s: rate of change of depth_m. Return the contact force F, N.
double kn_pad_tick(kn_pad *pad, const kn_coupling *coupling, double dt_s, double depth_m, double speed_m_s);

// Return the energy stored in the spring k1 of the pad [J].
double kn_pad_stored_j(const kn_pad *pad);

// A pad together with its virtual coupling, for use as the object of a rig (rig.h). The undeformed surface is at z = 0.
typedef struct kn_pad_contact {
    kn_pad pad;
    kn_coupling coupling;
} kn_pad_contact;

// Step the pad by 1 ms under a device at `position_m` and write the force on the device to `force_n`; only its z
// component can differ from 0. Return the stored energy, J. The function has the type kn_rig_object. contact: a
// kn_pad_contact.
double kn_pad_touch(void *contact, const double position_m[3], const double velocity_m_s[3], double force_n[3]);

#endif
