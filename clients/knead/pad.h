#ifndef KN_CLIENTS_PAD_H
#define KN_CLIENTS_PAD_H
// What a tool touches, boiled down to one element along z: the law of a lattice edge at the scale of a contact, under a
// proxy that is coupled to the device. For simulated loops, where a lattice would take a thousand times as long.
//
//     device --[ k_vc, b_vc ]-- proxy on the surface --[ k1 | c1 ]--[ c2(F) ]-- ground
//
//     F = Q - G w,  Q = k_vc (d - s) + b_vc d',  G = b_vc + dt k_vc       d: depth of the device, s: of the surface
//     w = (F - H)/A + F/c2(F),  H = k1 e,  A = c1 + dt k1                 e: of the Voigt part; both at the end of dt
//
// F >= 0; released, e creeps back and what c2 gave way stays. The proxy has no mass. No allocation.
#include "core/coupling.h"
#include <stdbool.h>

typedef struct kn_pad_def {
    const char *name;
    double k1_n_m, c1_n_s_m;         // both 0: it does not give way, a wall
    double c2_n_s_m, c2_least_n_s_m; // 0: no c2. Between the two forces it falls exponentially
    double from_n, to_n;
} kn_pad_def;

// wall; and, of a probe of some 1 cm: dough (1 kN s/m at rest, 46 flowing), clay, stiff jelly and soft jelly.
#define KN_PADS 5
extern const kn_pad_def kn_pads[KN_PADS];

typedef struct kn_pad { // read only for the caller
    kn_pad_def def;
    double voigt_m, flow_m; // e, and how far c2 has given way: the surface is voigt_m + flow_m deep
    double force_n;
    bool touching;
} kn_pad;

void kn_pad_init(kn_pad *pad, const kn_pad_def *def);

// One step of dt under a device at depth_m (> 0 inside the untouched surface) going in at speed_m_s. Returns F.
double kn_pad_tick(kn_pad *pad, const kn_coupling *coupling, double dt_s, double depth_m, double speed_m_s);

double kn_pad_stored_j(const kn_pad *pad); // by k1

typedef struct kn_pad_contact { // a pad as what a rig's device touches, its surface at z = 0
    kn_pad pad;
    kn_coupling coupling;
} kn_pad_contact;

// A kn_rig_object of a kn_pad_contact.
double kn_pad_touch(void *contact, const double position_m[3], const double velocity_m_s[3], double force_n[3]);

#endif
