#ifndef KN_CLIENTS_RIG_H
#define KN_CLIENTS_RIG_H
// Rig: a haptic loop in simulated time. It consists of device and hand (arm.h), the link in both directions, an object,
// and the client's passivity controller. The result states whether the loop buzzes (vibrates audibly or palpably) and
// whether the loop gives energy to the hand.
//
//     +--> position, velocity --> object --> force --> round trip --> passivity --> saturation --+
//     |                                                                                          |
//     +------------------------------- arm, hand, 1 ms held <------------------------------------+
//
// Press and lean: the loop buzzes if, over the last second,
//     rms of the force above 10 Hz      > 1.5 (k_vc q + b_vc q a / T) + 2 mN, or
//     rms of the position above 10 Hz   > 1.5 q + 2 um
// k_vc, b_vc: virtual coupling. q: encoder step. T: period, 1 ms. a: weight of the newest difference in the velocity
// filter. The term in parentheses is the resolution of the force: one encoder step changes the force by that much.
//
// Tap: the loop buzzes if the force reverses its direction of change more than KN_RIG_TURNS times per stroke.
// Slide: the loop buzzes if the force along z or x reverses more than 20 times in the last second (10 Hz).
// A reversal (a turn) counts only if it is larger than twice the force bound above. Taps and slides are judged by
// turns, because cells or a ridge shake a sliding tool, and a light hand swings by itself on soft objects. The position
// alone would not show a chatter of 500 Hz.
#include "clients/knead/arm.h"
#include "core/coupling.h"
#include "core/passivity.h"

// Number of reversals of the force per stroke of a tap above which the loop counts as buzzing.
#define KN_RIG_TURNS 10.0
#define KN_RIG_TRIP_MAX_MS 64

// Step an object by one period of 1 ms and write the force on the device to `force_n`. position_m, velocity_m_s: of the
// device; z points up, and the undeformed surface of the object is at z = 0. Return the energy stored in the object, J,
// or a value below 0 if the energy is not known.
typedef double kn_rig_object(void *self, const double position_m[3], const double velocity_m_s[3], double force_n[3]);

typedef enum kn_rig_motion {
    KN_RIG_LEAN, // no hand: a constant force of 1 N pushes the resting device into the surface for 4 s
    // The hand moves in 1 s from 2 mm above the surface to the place where its springs would press with 2 N against a
    // wall, and stays there for 3 s.
    KN_RIG_PRESS,
    KN_RIG_TAP,  // the hand moves 10 mm up and down at 2 Hz, 10 times
    KN_RIG_SLIDE // the hand presses 1 cm beside the object's middle; 1 s later it moves 2 cm along x at 10 mm/s
} kn_rig_motion;

typedef struct kn_rig_def {
    kn_arm_def arm; // device and hand. The grip NONE is allowed with LEAN only. The motion sets the field bias_n.
    // Virtual coupling as felt at the hand. It sets the force resolution, and the energy reservoir of the passivity
    // controller.
    kn_coupling coupling;
    // Round trip from a pose to its force, 0 .. KN_RIG_TRIP_MAX_MS [ms]. 0: the force arrives in the period of its
    // pose. 1: the force arrives in the next period, as from a server.
    int trip_ms;
    bool passivity; // true: the passivity controller acts on the force; false: it only observes
    kn_rig_motion motion;
} kn_rig_def;

typedef struct kn_rig_result {
    // Root mean square of force and position above 10 Hz in the last second; for a tap, in the whole run.
    double force_rms_n, position_rms_m;
    double resolution_n; // change of the force by one encoder step, k_vc q + b_vc q a / T
    // Number of reversals of the force: per stroke of a tap, or in the last second of a slide.
    double turns;
    // Largest energy that one stroke gave to the hand, >= 0. A stroke lasts from one time in the air to the next.
    double returned_j;
    double peak_n;
    int strokes;
    int64_t acted; // number of 1 ms periods in which the passivity controller damped the force
    bool finite, buzzes;
} kn_rig_result;

// Simulate the motion `def->motion` on an object, which must be in its initial state. self: first argument of the
// function `object`. No memory is allocated.
kn_rig_result kn_rig_run(const kn_rig_def *def, kn_rig_object *object, void *self);

#endif
