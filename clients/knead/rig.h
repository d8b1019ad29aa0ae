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

// Turns of the force per stroke of a tap above which the loop buzzes.
#define KN_RIG_TURNS 10.0
#define KN_RIG_TRIP_MAX_MS 64

// Step an object by one period and write the force on the device to `force_n`. The device has this position (z up,
// undeformed surface at z = 0) and velocity. Return the energy stored in the object, J, or a value below 0 if the
// energy is not known.
typedef double kn_rig_object(void *self, const double position_m[3], const double velocity_m_s[3], double force_n[3]);

typedef enum kn_rig_motion {
    KN_RIG_LEAN, // no hand: a constant force of 1 N pushes the resting device into the surface for 4 s
    // The hand moves in 1 s from 2 mm above the surface to the place where its springs would press with 2 N against a
    // wall, and stays there for 3 s.
    KN_RIG_PRESS,
    KN_RIG_TAP,  // 10 mm up and down at 2 Hz, 10 times
    KN_RIG_SLIDE // press 1 cm beside the middle; 1 s later move 2 cm along x at 10 mm/s
} kn_rig_motion;

typedef struct kn_rig_def {
    kn_arm_def arm;       // the grip NONE is allowed with LEAN only; the motion sets bias_n
    kn_coupling coupling; // virtual coupling as felt at the hand; sets the force resolution and the energy reservoir
    // Round trip, 0 .. KN_RIG_TRIP_MAX_MS. 0: the force arrives in the period of its pose. 1: the force arrives in the
    // next period, as from a server.
    int trip_ms;
    bool passivity; // the passivity controller acts; if false, it only observes
    kn_rig_motion motion;
} kn_rig_def;

typedef struct kn_rig_result {
    double force_rms_n, position_rms_m; // rms above 10 Hz in the last second; for a tap, in the whole run
    double resolution_n;                // resolution of the force, k_vc q + b_vc q a / T
    double turns;                       // turns of the force: per stroke of a tap, in the last second of a slide
    double returned_j;                  // largest energy that one stroke (air to air) gave to the hand; >= 0
    double peak_n;
    int strokes;
    int64_t acted; // periods in which the controller damped
    bool finite, buzzes;
} kn_rig_result;

// Run the motion of `def` on an object, which must be in its initial state. self: first argument of `object`. Nothing
// is allocated.
kn_rig_result kn_rig_run(const kn_rig_def *def, kn_rig_object *object, void *self);

#endif
