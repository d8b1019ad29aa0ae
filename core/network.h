#ifndef KN_CORE_NETWORK_H
#define KN_CORE_NETWORK_H
// Any element of springs and dampers on a bench, in one dimension: it is loaded or stretched, and its answer is
// computed.
//
// The state is the strain x of every part. In a stage of length h, a part takes up the strain D under the stress s,
//
//     spring  s = k (x + D)              damper  D = h g(s),  g(s) = s / (c exp(-beta clamp(|s|, p0, p1)))          (1)
//
// (or a ramp from c to c_min between p0 and p1 in place of the exponential). A damper may have a stroke: x stays
// between two stops. A step ends where x meets a stop. From then on the damper is rigid (D = 0). Another step ends
// where the stress of the rigid damper changes sign.
//
// Parts in a row carry one s and add their D. Parts side by side share one D and add their s. The bench prescribes s,
// or D, or a relation between them. (1) is linear except for force-dependent dampers, which Newton linearises. So the
// tree is composed upwards to one line D = slope s + offset, which is solved with the bench, and the stresses are
// handed down. h = 0 is the jump: dampers are rigid, and springs that nothing holds give way at once.
//
// Time integration: the singly diagonally implicit Runge-Kutta method of order 4 with embedded order 3 (Hairer and
// Wanner, Solving ODEs II, table IV.6.5). It is L-stable and stiffly accurate, so the massless joints cost nothing. The
// estimated error sets the step length. The code shares nothing with core/law.h and core/step.h: the lattice is tested
// against it. No allocation. Not for the tick, because the number of steps depends on the tolerance.
//
// Signs: compression is positive, as on a bench. The load of a creep test spreads over a section that grows as the
// height falls and the volume stays: P = W h/(S0 h0), i.e. stress = load (1 - strain) (first paper, see element.h,
// equation 4).
#include "core/element.h"
#include "core/material.h"
#include <stdint.h>

typedef struct kn_part {
    double modulus;                   // > 0. Spring: stiffness k, Pa. Damper: damping c at zero stress, Pa s
    double beta_per_pa, p0_pa, p1_pa; // damper: as in core/material.h; beta 0: constant
    // damper: 0, or damping at the end of a ramp that begins at `modulus`, with beta 0
    double c_min_pa_s;
    bool stroke;    // damper: its strain is limited by two stops
    double stop[2]; // damper: least strain <= 0, largest strain >= 0; > 0 is compression
} kn_part;

typedef struct kn_network {
    kn_element element; // its leaf numbers are the parts' numbers
    kn_part part[KN_ELEMENT_MAX];
} kn_network;

typedef enum kn_drive_kind {
    KN_DRIVE_STRESS, // stress = value
    KN_DRIVE_LOAD,   // stress = value (1 - strain): a weight on a body that keeps its volume
    KN_DRIVE_STRAIN  // strain = value + rate (t - start) + amplitude sin(omega (t - start))
} kn_drive_kind;

typedef struct kn_drive {
    kn_drive_kind kind;
    double value; // stress [Pa], or strain
    double start_s, rate_per_s, amplitude, omega;
} kn_drive;

typedef struct kn_network_state { // a plain value: a copy is a snapshot; all zero is a specimen at rest
    double time_s;
    double strain, stress_pa;           // strain and stress between the two ends at time_s
    double part_strain[KN_ELEMENT_MAX]; // strain x of each part
    double part_stress[KN_ELEMENT_MAX]; // stress of each part at the end of the last stage; Newton starts from it
    int8_t at_stop[KN_ELEMENT_MAX];     // damper at a stop: 1 fully compressed, -1 fully drawn, 0 between the stops
    double largest;                     // largest strain of a part so far; the tolerance is relative to this strain
    double step_s;                      // step length that the error of the last step allows
    long steps, rejected;               // number of steps taken, and of steps repeated with a shorter length
} kn_network_state;

// Return the element of a scene's material: (s1|d1)-d2 without the parts that are zero or rigid.
kn_network kn_network_of(const kn_material *mat);

// Fill in mat and return true if a scene's material can be made of the element: s|d, s-d, d or (s|d)-d, in any order.
// The force-dependent damper must be the one in series; all other parts must be linear.
bool kn_network_material(const kn_network *net, kn_material *mat);

// Return NULL, or one sentence about the part that cannot be simulated; *leaf becomes the number of that part.
const char *kn_network_check(const kn_network *net, int *leaf);

bool kn_part_thins(const kn_part *part); // true if the part is a damper that depends on the stress

// Return the damping c of a damper at a stress of either sign, Pa s, or the stiffness k of a spring, Pa.
double kn_part_modulus(const kn_network *net, int leaf, double stress_pa);

// Let a new drive take over at state->time_s. Parts that can give way at once do so. Afterwards, strain and stress are
// those just after the jump. Return false if a step of strain would need an infinite stress; then the state is
// unchanged.
bool kn_network_jump(const kn_network *net, kn_network_state *state, const kn_drive *drive);

// Follow the drive until the time until_s. `tolerance`: local error of a step, relative to the largest strain of a
// part. 1e-9 gives six exact digits and more after thousands of seconds. Return false if no step converges, which
// happens only with absurd parameters.
bool kn_network_advance(const kn_network *net, kn_network_state *state, const kn_drive *drive, double until_s,
                        double tolerance);

#endif
