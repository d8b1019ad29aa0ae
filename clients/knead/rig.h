#ifndef KN_CLIENTS_RIG_H
#define KN_CLIENTS_RIG_H
// A haptic loop in simulated time: device and hand (arm.h), the way there and back, an object, the passivity controller
// of the client; and what it comes to: does it buzz, does it give energy away?
//
//     +--> position, velocity --> object --> force --> round trip --> passivity --> saturation --+
//     |                                                                                          |
//     +------------------------------- arm, hand, 1 ms held <------------------------------------+
//
// A loop buzzes when, over the last second of a press or a lean,
//     force above 10 Hz      > 1.5 of the least the device can resolve, k_vc q + b_vc q a / T, + 2 mN rms, or
//     position above 10 Hz   > 1.5 q + 2 um rms
// (q: encoder step, a: the velocity filter's share of one difference); or when the force, by more than twice that, turns
// round more than KN_RIG_TURNS times per stroke of a tap, or along z or x 20 times in the last second of a slide, 10 Hz:
// what slides over cells or a ridge is shaken, and a light hand swings by itself on what is soft. Position alone would
// hide a chatter of 500 Hz.
#include "clients/knead/arm.h"
#include "core/coupling.h"
#include "core/passivity.h"

#define KN_RIG_TURNS 10.0
#define KN_RIG_TRIP_MAX_MS 64

// Force on the device at a position (z up, the surface at 0) and a velocity, and what the object has stored of the
// hand's work, J: one period of the object.
typedef double kn_rig_object(void *self, const double position_m[3], const double velocity_m_s[3], double force_n[3]);

typedef enum kn_rig_motion {
    KN_RIG_LEAN,  // no hand: 1 N pushes, from rest on the surface, 4 s
    KN_RIG_PRESS, // down from 2 mm to where the hand's springs make 2 N at a wall in 1 s, stay for 3 s
    KN_RIG_TAP,   // 10 mm up and down at 2 Hz, 10 times
    KN_RIG_SLIDE  // a press 1 cm beside the middle, and 1 s after it 2 cm along x at 10 mm/s
} kn_rig_motion;

typedef struct kn_rig_def {
    kn_arm_def arm;       // grip NONE with LEAN, another one else; its bias is the motion's
    kn_coupling coupling; // at the hand: what the resolution and the reservoir are worked out of
    int trip_ms;          // 0: force in the period of its pose; 1: in the next one, a server; <= KN_RIG_TRIP_MAX_MS
    bool passivity;       // acts; it observes in any case
    kn_rig_motion motion;
} kn_rig_def;

typedef struct kn_rig_result {
    double force_rms_n, position_rms_m; // above 10 Hz, last second; of a tap over all of it
    double resolution_n;                // k_vc q + b_vc q a / T
    double turns;                       // of the force per stroke of a tap, in the last second of a slide
    double returned_j;                  // most energy that one stroke, from air to air, gave the hand; >= 0
    double peak_n;
    int strokes;
    int64_t acted; // periods in which the controller damped
    bool finite, buzzes;
} kn_rig_result;

// Runs the motion on an object that is as new. Allocates nothing.
kn_rig_result kn_rig_run(const kn_rig_def *def, kn_rig_object *object, void *self);

#endif
