#ifndef KN_CLIENTS_CLOSED_LOOP_HAND_H
#define KN_CLIENTS_CLOSED_LOOP_HAND_H
// A virtual hand (virtual_hand.h) that holds a simulated device (haptic_loop.h). The path is the intended motion. Arm,
// grip and returned forces determine where the tool goes. The closed-loop hand runs in the thread of a virtual device
// (virtual_hand.h), so the loop is closed over the real bus.
//
//     path --> arm --> pose --> kneadd --> force, contact --> delay, loss --> output stage --+
//               ^                                                                            |
//               +------------------------------ held for 1 ms <------------------------------+
//
// The device's time advances by one millisecond per pose. If this process stalls, the path takes longer in real time.
// The force is monitored for buzzing while the path is played. The closed loop buzzes if the force reverses its
// direction more than 20 times a second (10 Hz) in two consecutive seconds. Reversals that the encoder's steps can
// cause are not counted. Too many reversals in a single second may be a knock whose oscillation decays.
#include "clients/hand/haptic_loop.h"
#include "clients/hand/haptic_render.h"
#include "clients/hand/virtual_hand.h"

// Largest number of force messages that the simulated link holds. The link carries one message per millisecond, so its
// delay is below this number of milliseconds.
#define KN_CLOSED_LOOP_HAND_WAY 256

typedef struct kn_closed_loop_hand_def {
    kn_haptic_render_def render; // parameters of the output stage; the device must be aligned with the scene's axes
    kn_grip grip;
    int axes;     // number of axes along which the device moves freely, 1 or 3 (haptic_loop.h)
    int delay_ms; // delay of the simulated link, added to the round trip, 0 .. KN_CLOSED_LOOP_HAND_WAY - 1
    double loss;  // share of the messages that the link loses in each direction, 0 .. 1
} kn_closed_loop_hand_def;

// If the closed loop gives more net energy than this to the hand, the loop counts as driving the hand, J. The net
// energy of a stable loop is 0 within a millijoule. A loop that oscillates slowly for lack of damping gives a hundred
// millijoules and more.
#define KN_CLOSED_LOOP_HAND_GIVEN_J 0.01

typedef struct kn_closed_loop_hand_news { // results of the last attempt to play the path
    double loudest_n;                     // rms of the force above 10 Hz in the worst second, N
    int turns;      // number of direction reversals of the force, in the second with the most reversals
    double given_j; // net energy that the loop gave to the hand, J; negative: the hand did work on the loop
    int64_t acted;  // number of 1 ms periods in which the passivity controller added damping
    bool buzzes;
    bool drives; // true: the loop gave the hand more energy than KN_CLOSED_LOOP_HAND_GIVEN_J
} kn_closed_loop_hand_news;

// State of the virtual hand, used by the device's thread; the caller may read `news` and `arm` after the thread has
// ended.
typedef struct kn_closed_loop_hand {
    kn_closed_loop_hand_def def;
    kn_hand_player *player;
    kn_held_device arm;
    kn_haptic_render render;
    int64_t answered; // number of the newest pose in this session that a force message has answered
    int64_t tick;     // tick number of the newest force message of this session
    kn_hand_force way[KN_CLOSED_LOOP_HAND_WAY]; // ring buffer of the forces that are in the simulated link
    bool came[KN_CLOSED_LOOP_HAND_WAY];
    int64_t ms;
    uint64_t dice;
    bool holding;    // true: the hand holds the simulated device; false: the hand grips the device at the next pose
    bool alone;      // true: with grip NONE, the simulated hand has let go of the device
    double left_z_m; // height z at which the hand let go of the device, m
    kn_buzz buzz;
    kn_turns turns;
    int second_ms;
    bool busy; // true: in the previous second, the force reversed its direction too often
    kn_closed_loop_hand_news news;
} kn_closed_loop_hand;

// Initialise the virtual hand `grasp`, which plays the path of `player`. `player` must outlive `grasp`.
void kn_closed_loop_hand_init(kn_closed_loop_hand *grasp, const kn_closed_loop_hand_def *def, kn_hand_player *player);
// Play one millisecond of the hand. The function has the type kn_virtual_device_hand (virtual_hand.h).
kn_hand_out kn_closed_loop_hand_tick(void *grasp, const kn_hand_force *force, int elapsed_ms);

#endif
