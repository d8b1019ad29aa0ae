#ifndef KN_CORE_NETWORK_H
#define KN_CORE_NETWORK_H
// Any element of springs and dampers on a bench, in one dimension: load it or stretch it, and see what it does.
//
// The state is the strain x of every part. In a stage of length h a part takes up the strain D for the stress s,
//
//     spring  s = k (x + D)              damper  D = h g(s),  g(s) = s / (c exp(-beta clamp(|s|, p0, p1)))          (1)
//
// (or a ramp from c to c_min between p0 and p1 for the exponential). A damper may have a stroke, x between two stops:
// steps end where one is met, from then on it is rigid (D = 0), and steps end again where its stress turns.
//
// parts in a row carry one s and add their D, parts side by side share one D and add their s, and the bench prescribes
// s, or D, or how they belong together. (1) is linear but for dampers with beta > 0, which Newton takes as straight
// lines; so the tree is composed upwards to one line D = slope s + offset, met with the bench, and the stresses are
// handed down. h = 0 is the jump: dampers are rigid, springs that nothing holds give way at once.
//
// In time: the singly diagonally implicit Runge-Kutta method of order 4 with embedded order 3 (Hairer and Wanner,
// Solving ODEs II, table IV.6.5: L-stable, stiffly accurate, so the massless joints cost nothing), steps chosen by the
// error. It shares no line with core/law.h and core/step.h: it is the oracle of the lattice. No allocation. Not for the
// tick: the number of steps is what the tolerance asks for.
//
// Signs: compression is positive, as on a bench. The load of a creep test spreads over a section that grows as the
// height falls and the volume stays: P = W h/(S0 h0), i.e. stress = load (1 - strain) (first paper, equation 4).
#include "core/element.h"
#include "core/material.h"
#include <stdint.h>

typedef struct kn_part {
    double modulus;                   // > 0; spring: k, Pa. damper: c at no stress, Pa s
    double beta_per_pa, p0_pa, p1_pa; // damper: as in core/material.h; beta 0: constant
    double c_min_pa_s;                // damper: 0, or the end of a ramp from modulus, with beta 0
    bool stroke;                      // damper: it has stops
    double stop[2];                   // least and most x, <= 0 and >= 0; x > 0 is compressed
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
    double value; // Pa, or strain
    double start_s, rate_per_s, amplitude, omega;
} kn_drive;

typedef struct kn_network_state { // a plain value: a copy is a snapshot; all zero is a specimen at rest
    double time_s;
    double strain, stress_pa;           // between the two ends, at time_s
    double part_strain[KN_ELEMENT_MAX]; // x
    double part_stress[KN_ELEMENT_MAX]; // at the end of the last stage; Newton starts from it
    int8_t at_stop[KN_ELEMENT_MAX];     // 1: at its most compressed, -1: at its most drawn
    double largest;                     // strain of a part so far, of which an error is a share
    double step_s;                      // that the error allowed last
    long steps, rejected;
} kn_network_state;

// The element that a scene's material is: (s1|d1)-d2, less what is zero or rigid.
kn_network kn_network_of(const kn_material *mat);

// Whether a scene can be made of it: fills mat for s|d, s-d, d and (s|d)-d (in any order), else false. What only a
// linear part may be must be linear: the force-dependent damper is the one in series.
bool kn_network_material(const kn_network *net, kn_material *mat);

// NULL, or one sentence about the part that cannot be simulated; *leaf is its number.
const char *kn_network_check(const kn_network *net, int *leaf);

bool kn_part_thins(const kn_part *part); // whether it is a damper that depends on the stress

// c of a damper at a stress of either sign, Pa s; k of a spring.
double kn_part_modulus(const kn_network *net, int leaf, double stress_pa);

// A new drive takes over at state->time_s: what can give way at once does. Afterwards strain and stress are those just
// after. False when a step of strain would need an infinite stress, and the state is as before.
bool kn_network_jump(const kn_network *net, kn_network_state *state, const kn_drive *drive);

// Follows the drive until a time. tolerance: local error of a step, of the largest strain of a part (1e-9 gives six
// exact digits and more after thousands of seconds). False when no step converges, which needs absurd numbers.
bool kn_network_advance(const kn_network *net, kn_network_state *state, const kn_drive *drive, double until_s,
                        double tolerance);

#endif
