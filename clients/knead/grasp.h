#ifndef KN_CLIENTS_GRASP_H
#define KN_CLIENTS_GRASP_H
// A player's hand with a simulated device in it: the path is what it intends, and where the tool goes is what arm, grip
// and the forces that come back make of it. As a device's hand (device.h), so the loop is closed over the very bus.
//
//     path --> arm (arm.h) --> pose --> kneadd --> force, contact --> delay, loss --> output stage (render.h) --+
//                 ^                                                                                            |
//                 +------------------------------------ held for 1 ms <----------------------------------------+
//
// A millisecond of the device is a pose, as with any path: a stall of this process stretches its time. What it felt is
// judged while the path is played: a loop buzzes when for two seconds the force turns round more than 20 times each (10
// Hz) by more than the encoder's steps make of it. One second may be a knock that rings off.
#include "clients/knead/arm.h"
#include "clients/knead/buzz.h"
#include "clients/knead/player.h"
#include "clients/knead/render.h"

#define KN_GRASP_WAY 256 // forces on their way: as many milliseconds of delay at most

typedef struct kn_grasp_def {
    kn_render_def render; // its device stands in the scene's axes
    kn_grip grip;
    int axes;     // 1 or 3, see arm.h
    int delay_ms; // that a simulated link adds to the round trip, 0 .. KN_GRASP_WAY - 1
    double loss;  // share of the poses and of the forces that it loses, 0 .. 1
} kn_grasp_def;

// A calm loop gives nothing, to a millijoule; one that swings slowly for want of damping, a hundred of them and more.
#define KN_GRASP_GIVEN_J 0.01

typedef struct kn_grasp_news { // of the path of the last try
    double loudest_n;          // rms of the force above 10 Hz, in the second in which that was most
    int turns;                 // of the force, in the second with most of them
    double given_j;            // to the hand, net; below 0 the hand worked
    int64_t acted;             // periods in which the passivity controller damped
    bool buzzes;
    bool drives; // it gave the hand more than KN_GRASP_GIVEN_J
} kn_grasp_news;

typedef struct kn_grasp { // the device's thread's; news and arm: once that has ended the caller's
    kn_grasp_def def;
    kn_player *player;
    kn_arm arm;
    kn_render render;
    int64_t answered;                // newest pose of the session that a force has answered
    int64_t tick;                    // of its newest force
    kn_hand_force way[KN_GRASP_WAY]; // force that came in n ms ago
    bool came[KN_GRASP_WAY];
    int64_t ms;
    uint64_t dice;
    bool holding;    // the arm is where the hand's last pose was
    bool alone;      // nobody's hand has let go of it
    double left_z_m; // there
    kn_buzz buzz;
    kn_turns turns;
    int second_ms;
    bool busy; // so was the last second
    kn_grasp_news news;
} kn_grasp;

void kn_grasp_init(kn_grasp *grasp, const kn_grasp_def *def, kn_player *player);    // player is borrowed
kn_hand_out kn_grasp_tick(void *grasp, const kn_hand_force *force, int elapsed_ms); // a kn_device_hand

#endif
