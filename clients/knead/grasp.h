#ifndef KN_CLIENTS_GRASP_H
#define KN_CLIENTS_GRASP_H
// A virtual hand (player.h) that holds a simulated device (arm.h). The path is the intended motion. Arm, grip and
// returned forces determine where the tool goes. The grasp plays in the thread of a virtual device (device.h), so the
// loop is closed over the real bus.
//
//     path --> arm (arm.h) --> pose --> kneadd --> force, contact --> delay, loss --> output stage (render.h) --+
//                 ^                                                                                            |
//                 +------------------------------------ held for 1 ms <----------------------------------------+
//
// The device's time advances by one millisecond per pose. If this process stalls, the path takes longer in real time.
// The force is judged while the path is played. A loop buzzes if the force turns round more than 20 times a second (10
// Hz) in two seconds in a row, by more than the encoder's steps can cause. A single such second may be a knock whose
// oscillation dies away.
#include "clients/knead/arm.h"
#include "clients/knead/buzz.h"
#include "clients/knead/player.h"
#include "clients/knead/render.h"

// Largest number of forces in the simulated link, and thus the limit of its delay, ms.
#define KN_GRASP_WAY 256

typedef struct kn_grasp_def {
    kn_render_def render; // its device is aligned with the scene's axes
    kn_grip grip;
    int axes;     // 1 or 3, see arm.h
    int delay_ms; // delay of the simulated link, added to the round trip, 0 .. KN_GRASP_WAY - 1
    double loss;  // share of the poses and of the forces that the link loses, 0 .. 1
} kn_grasp_def;

// Net energy above which a loop drives the hand, J. The net energy of a calm loop is 0 within a millijoule. A loop that
// oscillates slowly for lack of damping gives a hundred millijoules and more.
#define KN_GRASP_GIVEN_J 0.01

typedef struct kn_grasp_news { // results of the last try
    double loudest_n;          // rms of the force above 10 Hz, in the worst second
    int turns;                 // turns of the force in the second with the most turns
    double given_j;            // net energy given to the hand; below 0 the hand did work
    int64_t acted;             // periods in which the passivity controller added damping
    bool buzzes;
    bool drives; // gave the hand more than KN_GRASP_GIVEN_J
} kn_grasp_news;

typedef struct kn_grasp { // used by the device's thread; afterwards the caller may read news and arm
    kn_grasp_def def;
    kn_player *player;
    kn_arm arm;
    kn_render render;
    int64_t answered;                // newest pose of the session that a force has answered
    int64_t tick;                    // tick of the newest force of the session
    kn_hand_force way[KN_GRASP_WAY]; // ring buffer of the link's forces
    bool came[KN_GRASP_WAY];
    int64_t ms;
    uint64_t dice;
    bool holding;    // the arm is where the hand's last pose was
    bool alone;      // grip NONE: nobody holds the device at present
    double left_z_m; // height at which the device was released
    kn_buzz buzz;
    kn_turns turns;
    int second_ms;
    bool busy; // the last second had too many turns, too
    kn_grasp_news news;
} kn_grasp;

void kn_grasp_init(kn_grasp *grasp, const kn_grasp_def *def, kn_player *player);    // `player` must outlive `grasp`
kn_hand_out kn_grasp_tick(void *grasp, const kn_hand_force *force, int elapsed_ms); // a kn_device_hand

#endif
